"""What `tap` and `recognise` make of a plate that is no sum of its model's modes: at every place that is struck each
shape has an error of its own, of a share of its rms, so that one blow predicts the next to that share, as hammer hits
on a real plate do (lab/real/records.py). The plate is tapped at four places, and then struck by the stones of runs
(superposed.py) that the arrangement likelihood was not trained on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cache, partial
from pathlib import Path
from zlib import crc32

import numpy as np
import pandas as pd

from common.channels import force_column
from lab.known_truth.tap_records import hammer_taps
from lab.plate.tapping import SCENE, mode_errors
from lab.recognition.superposed import Plate, STEP_s, signals_of, superposed
from lab.study import Row
from recognition.estimation.arrays import Floats, Integers
from recognition.estimation.noise import with_noise
from recognition.evaluation import DataSet, read_dataset
from recognition.physics.arrangement_method import ArrangementLikelihood
from recognition.plate.plate_model import PlateModel
from recognition.tapping.fit import fit_plate
from recognition.tapping.tapped import LARGEST_UNEXPLAINED, Learnt, learnt

ERRORS, FAMILIES, SEEDS, HIGHEST_Hz, TRUE_Hz = (0.04, 0.1, 0.25), ("clean", "stones"), (1, 2), 7500.0, 20e3


@dataclass(frozen=True)
class Uneven(PlateModel):
    """A plate whose shapes have an error at each place, of a share of their rms."""

    error: float = 0.0

    def shape(self, x_m: Floats, y_m: Floats, slope: tuple[int, int] = (0, 0)) -> Floats:
        if any(slope):  # errors of neighbouring places have nothing to do with each other
            return super().shape(x_m, y_m, slope)
        rows = [np.random.default_rng(crc32(np.round([x, y], 9).tobytes())).standard_normal(len(self.rms_shape))
                for x, y in zip(np.atleast_1d(x_m), np.atleast_1d(y_m), strict=True)]
        return super().shape(x_m, y_m) + self.error * self.rms_shape * np.array(rows)


@cache
def struck(error: float, seed: int) -> tuple[Uneven, Learnt]:
    """A plate, and what four taps teach of it."""
    rng = np.random.default_rng([41, seed])
    exact = PlateModel.from_scene(SCENE, TRUE_Hz)
    plate = Uneven(**{one.name: getattr(exact, one.name) for one in fields(exact)}, error=error)
    taps = hammer_taps(plate, rng.uniform(-0.22, 0.22, (4, 2)), rng, place_error_m=1.5e-3)
    return plate, learnt(fit_plate(PlateModel.from_scene(SCENE, HIGHEST_Hz), taps))


def trained(data: DataSet, numbers: Integers) -> ArrangementLikelihood:
    records = [ArrangementLikelihood().prepare(data.signals[k], data.runs[k]) for k in numbers]
    return ArrangementLikelihood().fit(records, data.ratios[numbers], groups=data.table["kin"].to_numpy()[numbers])


def answered(data: DataSet, method: ArrangementLikelihood, numbers: Integers, error: float, seed: int) -> pd.DataFrame:
    """Answers to runs on that plate."""
    plate, found = struck(error, seed)
    method, rows = method.on_plate(found.plate).at_impact(), []
    for k in numbers:
        run = data.runs[k]
        assert run.fast is not None and run.stones is not None
        force_N = np.stack([run.fast[force_column(n + 1)].to_numpy()[1:] for n in range(len(run.stones))])
        steps = round(data.window.n_samples / data.window.rate_Hz / STEP_s) + 30
        force_N = np.pad(force_N, ((0, 0), (0, max(0, steps - force_N.shape[1]))))[:, :steps]
        values = signals_of(Plate(plate, np.zeros(len(plate.frequency_Hz))), force_N,
                            run.stones[["place_x_m", "place_y_m"]].to_numpy())
        record = with_noise(data.window.cut(pd.DataFrame(values), "record"), 20.0, np.random.default_rng([seed, k]))
        rows += [{"true": data.ratios[k], **vars(one)} for one in method.answer([method.prepare(record)])]
    return pd.DataFrame(rows)


def model_errors(out: Path, runs: int = 44) -> Iterator[Row]:
    @cache
    def data() -> DataSet:
        for row in superposed(out / "families", runs=runs, families=FAMILIES):
            row.work()
        return read_dataset(out / "families")

    @cache
    def halves(family: str, seed: int) -> tuple[ArrangementLikelihood, Integers]:
        mixed = np.random.default_rng(seed).permutation(data().of(family))
        return trained(data(), mixed[::2]), mixed[1::2]

    def judged(error: float, family: str, seed: int) -> dict[str, object]:
        plate, found = struck(error, seed)
        modes = abs(mode_errors(found.plate, plate)[3])
        answers = answered(data(), *halves(family, seed), error, seed)
        said = answers[answers["out_of_distribution"] == ""]
        off = 100 * (said["ratio"] - said["true"]).abs()
        return {"unexplained_percent": 100 * float(found.unexplained.mean()),
                "tap_refuses": int(found.unexplained.max() > LARGEST_UNEXPLAINED),
                "modes_inside_percent": 100 * float((modes < 1.645).mean()), "records": len(answers),
                "answered": len(said), "off_points": off.sum(), "worst_points": off.max(),
                "inside": int(said["true"].between(said["low"], said["high"]).sum())}

    for error in ERRORS:
        for family in FAMILIES:
            for seed in SEEDS:
                yield Row({"error": error, "family": family, "seed": seed}, partial(judged, error, family, seed))


def model_errors_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Of all seeds; errors of the records that were answered, in points."""
    found = rows.groupby(["error", "family"], sort=False).agg(
        unexplained_percent=("unexplained_percent", "mean"), modes_inside_percent=("modes_inside_percent", "mean"),
        tap_refuses=("tap_refuses", "sum"), records=("records", "sum"), answered=("answered", "sum"),
        mean=("off_points", "sum"), worst=("worst_points", "max"), inside=("inside", "sum")).reset_index()
    return found.assign(error=100 * found["error"], mean=found["mean"] / found["answered"],
                        inside=100 * found["inside"] / found["answered"])
