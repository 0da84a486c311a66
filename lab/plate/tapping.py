"""What is left after tapping a plate.

Plates off by 1 and 3 %, one off by 1 % with two ribs, which the model has too, the solid and the other theory are tapped at
one to four places, forces measured or not, with noise 20 dB below each record and places known to 1.5 mm. Errors are of
the modes that bend the plate below 5 kHz; the misfit is of a record that took no part in the fit: ten stones on the
circle, first 40 ms, below 6 kHz, no noise.
"""

import itertools
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment
from scipy.signal import resample_poly

from common.resources import resource
from common.scene.plate import FlexiblePlate, read_plate
from lab.known_truth.other_plates import other_theory, scattered, solid_plate
from lab.known_truth.tap_records import hammer_taps
from lab.study import Row
from recognition.plate.plate_model import PlateModel
from recognition.tapping.fit import fit_plate
from recognition.tapping.tapped import learnt

SCENE = resource("scenes") / "paper.toml"
BELOW_Hz, BAND_Hz, MASS_kg = 5000.0, 6000.0, 39.15
SEEDS, COUNTS, RATE_Hz = (1, 2), (1, 2, 4), 120e3
KINDS = ("0.01", "0.03", "ribs", "solid", "other theory")
RIBS = {"x": [(at_m, 0.02, 0.04) for at_m in (-0.1, 0.1)]}
LEAST_MOTION = 0.3  # of a shape's mean square times the mass: less is a mode in the plane or of the rods


def thought(kind: str, highest_Hz: float) -> PlateModel:
    """What the plate is thought to be."""
    plate = read_plate(SCENE)
    assert isinstance(plate, FlexiblePlate)
    ribs = RIBS if kind == "ribs" else {}
    table = FlexiblePlate.model_validate(plate.model_dump(exclude_none=True) | {"ribs_m": ribs})
    return PlateModel.from_scene(table, highest_Hz)


def plates(kind: str, seed: int) -> PlateModel:
    exact = thought(kind, 8000.0)
    if kind == "solid":
        return solid_plate(exact)
    if kind == "other theory":
        return other_theory(exact, SCENE)
    return scattered(exact, 0.01 if kind == "ribs" else float(kind), np.random.default_rng(100 + seed))


def volley(plate: PlateModel, seed: int) -> np.ndarray:
    """Ten half sines of stones, as measured below BAND_Hz: (sensors, n)."""
    rng, angle = np.random.default_rng(seed), 2 * np.pi * np.arange(10) / 10
    t_s = np.arange(round(0.04 * RATE_Hz)) / RATE_Hz
    share = np.clip(t_s / rng.uniform(2.5e-4, 4e-4, (10, 1)), 0, 1)
    force = rng.uniform(3000, 7000, (10, 1)) * np.sin(np.pi * share)
    record = plate.response(force, 0.1 * np.column_stack([np.cos(angle), np.sin(angle)]), RATE_Hz)
    return resample_poly(record, 1, round(RATE_Hz / (2 * BAND_Hz)), axis=1)


def misfit(plate: PlateModel, truth: PlateModel, seed: int) -> float:
    is_, should = volley(plate, seed), volley(truth, seed)
    return float(np.sqrt(np.mean((is_ - should) ** 2) / np.mean(should**2)))


def mode_errors(plate: PlateModel, truth: PlateModel) -> np.ndarray:
    """Of each mode of `truth` that bends the plate: relative errors of frequency, damping and shape, and the first over
    its standard deviation, (4, n)."""
    bends = (np.mean(truth.grid_shape**2, axis=(0, 1)) * MASS_kg > LEAST_MOTION) & (truth.frequency_Hz < BELOW_Hz)
    x, y = (v.ravel() for v in np.meshgrid(*2 * [np.linspace(-0.24, 0.24, 25)]))
    ours, theirs = plate.shape(x, y), truth.shape(x, y)[:, bends]
    ours_rms, theirs_rms = (np.sqrt(np.mean(one**2, axis=0)) for one in (ours, theirs))
    alike = theirs.T @ ours / len(x) / np.outer(theirs_rms, ours_rms)
    far = abs(np.log(plate.frequency_Hz / truth.frequency_Hz[bends][:, None])) > 0.15
    k = linear_sum_assignment(-np.where(far, 0, abs(alike)))[1]
    rows = np.arange(k.size)
    frequency = plate.frequency_Hz[k] / truth.frequency_Hz[bends] - 1
    shape = np.sqrt(np.mean((ours[:, k] * np.sign(alike[rows, k]) - theirs) ** 2, axis=0)) / theirs_rms
    damping = plate.damping_ratio[k] / truth.damping_ratio[bends] - 1
    return np.array([frequency, damping, shape, frequency / np.maximum(plate.frequency_sd[k], 1e-9)])


def figures(plate: PlateModel, truth: PlateModel) -> dict[str, float]:
    """Of a plate that is taken for another, all but the third in per cent."""
    frequency, damping, shape, over_sd = mode_errors(plate, truth)
    middle = [float(np.median(abs(values))) for values in (frequency, damping, shape)]
    return {"frequency_median_percent": 100 * middle[0], "frequency_max_percent": 100 * float(abs(frequency).max()),
            "frequency_over_sd": float(np.median(abs(over_sd))), "damping_median_percent": 100 * middle[1],
            "shape_median_percent": 100 * middle[2],
            "volley_misfit_percent": 100 * float(np.mean([misfit(plate, truth, seed) for seed in range(3)]))}


def tapping(out: Path) -> Iterator[Row]:
    """Each plate before it is tapped, and after some taps."""
    start = cache(partial(thought, highest_Hz=1.25 * BAND_Hz))

    def tapped(kind: str, seed: int, known: bool, count: int) -> dict[str, float]:
        truth = plates(kind, seed)
        if not count:
            return figures(start(kind), truth)
        rng = np.random.default_rng(1000 + seed)
        places = rng.uniform(-0.22, 0.22, (8, 2))[:count]
        found = learnt(fit_plate(start(kind), hammer_taps(truth, places, rng, force_known=known, place_error_m=1.5e-3)))
        return figures(found.plate, truth) | {"identified": int(found.identified.sum()),
                                              "unexplained_percent": 100 * float(found.unexplained.mean())}

    for seed, kind, known in itertools.product(SEEDS, KINDS, (True, False)):
        for count in ((0, *COUNTS) if known else COUNTS):
            yield Row({"plate": kind, "seed": seed, "taps": count, "force": "known" if known else "unknown"},
                      partial(tapped, kind, seed, known, count))


def tapping_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Means over the seeds."""
    return rows.groupby(["plate", "taps", "force"], sort=False).mean().drop(columns="seed").reset_index()
