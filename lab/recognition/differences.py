"""What `recognise` makes of records that differ from those of its training.

The model learns from the families paper and clean of a data set but for the last groups of `clean`, of which the
records are, none of their kin among the training. A row is one difference at one noise: *refused* or vetoed records, those
*silently wrong* (answered more than 5 points off without a warning), those *warned* of (their interval reaches more than 5
points), and the errors of all that were answered. Differences of a record are made of its fast stream; those of plate,
stones and speed are superpositions of the forces of the same runs (scaled by Hertz for another size or speed), through
other plates or on other places.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.sweep.runs import Run
from common.channels import ACCELEROMETERS, RODS, rod_column, sensor_column
from common.scene.plate import FlexiblePlate, read_plate
from lab.known_truth import other_plates
from lab.known_truth.faults import FAULTS, Fault
from lab.study import Row
from recognition.estimation.answer import Answer
from recognition.estimation.errors import RecognitionError
from recognition.evaluation.cross_validation import RINGS, with_noise
from recognition.evaluation.dataset import DataSet, read_dataset
from recognition.models import Model
from recognition.physics.force_records import ForceRecord, force_record_of
from recognition.plate.plate_model import PlateModel

SCENE, HIGHEST_Hz = "scenes/paper.toml", 20000.0
FINE, SAMPLES, SAMPLE_s = 30, 267, 1.5e-4  # FINE: steps of the fast stream in a sample of the record
NOISES_dB = (None, 20.0)
WRONG_points = 5.0
Records = Iterator[tuple[pd.DataFrame, float]]


@dataclass(frozen=True)
class Sources:
    """Runs that were held out, and a random number generator of the row."""

    runs: list[Run]
    rng: np.random.Generator

    def fast(self) -> Iterator[tuple[pd.DataFrame, float]]:
        """What sensors give, and the true ratio."""
        for run in self.runs:
            yield _fast(run.path), float(run.gangue_ratio or 0.0)


@lru_cache(maxsize=128)
def _fast(path: Path) -> pd.DataFrame:
    names = pd.read_parquet(path / "signals.parquet").columns
    return pd.read_parquet(path / "fast.parquet",
                           columns=["t_s", *(name for name in names if name.startswith((ACCELEROMETERS, RODS)))])


def plain(sources: Sources) -> Records:
    for fast, ratio in sources.fast():
        yield fast.iloc[::FINE], ratio


def beginning(steps: Callable[[np.random.Generator], int]) -> Callable[[Sources], Records]:
    """Records that begin so many steps of 5 us after the impact, or before it with silence."""

    def records(sources: Sources) -> Records:
        for fast, ratio in sources.fast():
            k = steps(sources.rng)
            before = fast.iloc[np.zeros(max(0, -k), dtype=int)] * 0.0
            table = pd.concat([before, fast.iloc[max(0, k):]]).iloc[::FINE]
            yield padded(table), ratio
    return records


def padded(table: pd.DataFrame) -> pd.DataFrame:
    """Longer than a record must be: runs end with the record of 40 ms, whose last sample is repeated a few times."""
    table = table.iloc[np.minimum(np.arange(max(SAMPLES, len(table)) + 5), len(table) - 1)]
    return table.assign(t_s=np.arange(len(table)) * SAMPLE_s)


def changed(fault: Fault) -> Callable[[Sources], Records]:
    def records(sources: Sources) -> Records:
        for table, ratio in plain(sources):
            names = sensors(table)
            values = fault(table[names].to_numpy().T, 1 / SAMPLE_s)
            yield table.assign(**dict(zip(names, values, strict=True))), ratio
    return records


def sensors(table: pd.DataFrame) -> list[str]:
    return sorted(name for name in table.columns if name.startswith(ACCELEROMETERS))


def only(*prefixes: str) -> Callable[[Sources], Records]:
    def records(sources: Sources) -> Records:
        for table, ratio in plain(sources):
            yield table[["t_s", *(name for name in table.columns.astype(str) if name.startswith(prefixes))]], ratio
    return records


@cache
def exact_plate(thickness: float = 1.0) -> PlateModel:
    table = read_plate(SCENE)
    assert isinstance(table, FlexiblePlate)
    return PlateModel.from_scene(table.model_copy(update={"thickness_m": thickness * table.thickness_m}), HIGHEST_Hz)


def superposed(plate: PlateModel, force_N: np.ndarray, place_m: np.ndarray, step_s: float) -> pd.DataFrame:
    """A record of the plate's sensors under forces (stones, steps)."""
    force = np.pad(force_N, ((0, 0), (0, FINE * (SAMPLES - 1) + 1 - force_N.shape[1])))
    names = [sensor_column(name) for name in plate.sensor_names]
    columns = dict(zip(names, plate.response(force, place_m, 1 / step_s), strict=True))
    rods = plate.rod_forces(force, place_m, 1 / step_s)
    columns |= {rod_column(k): row for k, row in enumerate(rods, 1)}
    table = pd.DataFrame(columns).iloc[::FINE].reset_index(drop=True)
    table.insert(0, "t_s", np.arange(len(table)) * FINE * step_s)
    return table


def forces_of(runs: list[Run]) -> list[ForceRecord]:
    return [force_record_of(run, 4e-3) for run in runs]


def on_plate(plate: Callable[[np.random.Generator], PlateModel]) -> Callable[[Sources], Records]:
    def records(sources: Sources) -> Records:
        for one in forces_of(sources.runs):
            record = superposed(plate(sources.rng), one.force_N, one.touch_m, one.step_s)
            yield record, float(one.gangue.mean())
    return records


def _scattered(rng: np.random.Generator) -> PlateModel:
    return other_plates.scattered(exact_plate(), 0.01, rng)


def _damped(rng: np.random.Generator) -> PlateModel:
    return replace(exact_plate(), damping_ratio=2 * exact_plate().damping_ratio)


@cache
def other_theory() -> PlateModel:
    return other_plates.other_theory(exact_plate(), SCENE)


@cache
def solid() -> PlateModel:
    return other_plates.solid_plate(exact_plate())


def other_count(count: int) -> Callable[[Sources], Records]:
    """So many stones on the circle, of this run and the next."""

    def records(sources: Sources) -> Records:
        found = forces_of(sources.runs)
        angle = 2 * np.pi * np.arange(count) / count
        place_m = np.hypot(*found[0].fall.place_m[0]) * np.column_stack([np.cos(angle), np.sin(angle)])
        for one, other in zip(found, found[1:] + found[:1], strict=True):
            chosen = sources.rng.permutation(2 * len(one.force_N))[:count]
            force_N, gangue = np.vstack([one.force_N, other.force_N])[chosen], np.append(one.gangue, other.gangue)[chosen]
            yield superposed(exact_plate(), force_N, place_m, one.step_s), float(gangue.mean())
    return records


def scaled(size: float, speed: float) -> Callable[[Sources], Records]:
    """Stones so many times as large or as fast, by Hertz."""
    stretch, push = size * speed**-0.2, size**2 * speed**1.2

    def records(sources: Sources) -> Records:
        for one in forces_of(sources.runs):
            at = np.arange(one.force_N.shape[1], dtype=float)
            force_N = push * np.stack([np.interp((at + 0.5) / stretch - 0.5, at, row, right=0.0) for row in one.force_N])
            yield superposed(exact_plate(), force_N, one.touch_m, one.step_s), float(one.gangue.mean())
    return records


ROWS: dict[str, Callable[[Sources], Records]] = {
    "nothing": plain,
    "record starts 10 us late": beginning(lambda rng: 2),
    "record starts 10 us early": beginning(lambda rng: -2),
    "record starts 25 us late": beginning(lambda rng: 5),
    "record starts 25 us early": beginning(lambda rng: -5),
    "15 ms of silence before": beginning(lambda rng: -3000 - int(rng.integers(30))),
    "8 stones": other_count(8),
    "12 stones": other_count(12),
    "radius 20 mm": scaled(0.8, 1.0),
    "plate of another theory": on_plate(lambda rng: other_theory()),
    "superposed, same plate": on_plate(lambda rng: exact_plate()),
    "plate 1 % thinner": on_plate(lambda rng: exact_plate(0.99)),
    "damping twice": on_plate(_damped),
    "speed 3.5 m/s": scaled(1.0, 3.5 / 3),
    "plate as a solid": on_plate(lambda rng: solid()),
    "modes scattered by 1 %": on_plate(_scattered),
    "record starts anywhere within 0.3 ms": beginning(lambda rng: int(rng.integers(-60, 61))),
    "speed 2.5 m/s": scaled(1.0, 2.5 / 3),
    "accelerometers alone": only(ACCELEROMETERS),
    "radius 30 mm": scaled(1.2, 1.0),
    **{name: changed(fault) for name, fault in FAULTS.items()},
}
FAMILIES = ("thin_plate", "soft_coal", "unbreakable", "speed", "damping", "free", "stones", "natural", "wide")


def judged(model: Model, table: pd.DataFrame, noise_dB: float | None,
           rng: np.random.Generator) -> tuple[str, Answer] | str:
    """The method whose ratio `recognise` gives with its answer, or why it gives none."""
    noisy = with_noise(table.reset_index(drop=True), noise_dB, rng)
    if why := model.faults(noisy):
        return "; ".join(why)
    try:
        answers = model.recognise(noisy)
    except RecognitionError as reason:
        return str(reason)
    if vetoes := model.vetoes(answers):
        return "; ".join(f"{name}: {reason}" for name, reason in vetoes.items())
    return model.best(answers) or "no method"


def judged_all(model: Model, records: Callable[[Sources], Records], runs: list[Run],
               seed: int) -> dict[float | None, dict[str, object]]:
    """Figures at each noise."""
    told, reasons = {noise: list[tuple[float, bool]]() for noise in NOISES_dB}, {noise: list[str]() for noise in NOISES_dB}
    rng = np.random.default_rng(seed)
    for table, ratio in records(Sources(runs, np.random.default_rng(seed))):
        for noise_dB in NOISES_dB:
            found = judged(model, table, noise_dB, rng)
            if isinstance(found, str):
                reasons[noise_dB].append(found)
            else:
                told[noise_dB].append((100 * abs(found[1].ratio - ratio), bool(found[1].warning)))
    return {noise_dB: _counted(told[noise_dB], reasons[noise_dB]) for noise_dB in NOISES_dB}


def _counted(told: list[tuple[float, bool]], why: list[str]) -> dict[str, object]:
    size, warned = np.array([error for error, _ in told]), np.array([warning for _, warning in told], dtype=bool)
    return {"records": len(size) + len(why), "answered": len(size),
            "silently_wrong": int((size[~warned] > WRONG_points).sum()), "warned": int(warned.sum()),
            "mean_points": size.mean() if size.size else np.nan, "worst_points": size.max() if size.size else np.nan,
            "by_arrangements": sum("arrangement_likelihood:" in one for one in why),
            "by_energies": sum("energies_sensors:" in one for one in why), "first_reason": why[0][:150] if why else ""}


def recognise_differences(out: Path, dataset: str = "runs/dataset", groups: int = 66) -> Iterator[Row]:
    """groups: of `clean` that are tested, of one record each."""
    data = read_dataset(dataset)
    train, tested = split(data, groups)
    model = cache(lambda: Model.fit([data.runs[k] for k in train], data.table["kin"].to_numpy()[train]))
    rows = {name: (records, [data.runs[k] for k in tested]) for name, records in ROWS.items()}
    rows |= {f"family {name}": (plain, [data.runs[k] for k in data.of(name)]) for name in FAMILIES if data.of(name).size}
    for seed, (name, (records, runs)) in enumerate(rows.items()):
        found = cache(lambda records=records, runs=runs, seed=seed: judged_all(model(), records, runs, seed))
        for noise_dB in NOISES_dB:
            yield Row({"differs": name, "noise_dB": noise_dB}, partial(lambda found, noise: found()[noise], found, noise_dB))


def split(data: DataSet, groups: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the runs of the training, and of those that are tested, the last groups of `clean`."""
    rings, kin, group = data.of(*RINGS), data.table["kin"].to_numpy(), data.table["group"].to_numpy()
    names = np.unique(group[data.of("clean")])[-groups:]
    tested = np.flatnonzero(np.isin(group, names))
    return rings[~np.isin(kin[rings], kin[tested])], tested
