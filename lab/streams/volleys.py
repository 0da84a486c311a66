"""Volleys of ten stones on unknown places, and what `volley` makes of them.

Forces are those of stones that fell together in runs of the engine (families `ring` and `free` of scenes/dataset.toml,
3 m/s); their sum goes through plates that are not the model's, as in listening.py (plates "1" and "2": frequencies,
damping and shapes scattered by 1, 10 and 1 %), with 20 dB of noise at 20 kHz and four accelerometers. `volley` is given
what four taps taught of the plate, the number, radius and speed of the stones, and neither places nor the time of arrival,
which is anywhere within 1 ms.

volley_shares: the impulse of a stone in m v, from which NEAR_SHARE and FAR_SHARE of recognition/volley/impulses.py are.
volleys: of the records of RECORDS those shares and the limits of misfit and gain were made; `held_out` are runs of
scenes/dataset_held_out.toml, of other seeds and packings.
volley_differences: with something that `volley` is not told, and with numbers and speeds that are told as ranges.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.sweep.runs import Run
from lab.known_truth.faults import FAULTS, Fault
from lab.known_truth.simulated import stone_rows, stream_of
from lab.streams.known_streams import ALL, scaled, tapped, true_plate, true_ratio
from lab.streams.listening import grouped
from lab.study import Row
from recognition.estimation.errors import RecognitionError
from recognition.evaluation.dataset import DataSet, read_dataset
from recognition.physics.force_records import ForceRecord, force_record_of
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import History, load_forces
from recognition.volley.recognise import recognise_volley
from recognition.volley.responses import RATE_Hz, Stones

PAPER, SOME, FAST = Stones((10, 10), 0.025, (3.0, 3.0)), Stones((8, 12), 0.025, (3.0, 3.0)), Stones((10, 10), 0.025, (2.5, 3.2))
DENSITY = {False: 1380.0, True: 2400.0}
FORCE_S, SILENCE_S, AFTER_S = 3e-3, 0.05, 0.16
WRONG_points = 5.0
RECORDS = {"free": 40, "clean": 20}  # of the good ones
DIFFERENT = 6  # records of each difference


@dataclass(frozen=True)
class Difference:
    """What is other than `volley` is told: how many stones fall, their size and speed relative to the paper's (by
    Hertz), how long they arrive after each other, the record, the plate."""

    name: str
    stones: int = 10
    size: float = 1.0
    speed: float = 1.0
    within_s: float = 0.0
    record: Fault | None = None
    taps: str = "1"
    plate: str = "1"
    told: Stones = PAPER


DIFFERENCES = [
    Difference("nothing"), Difference("stones within 0.1 ms", within_s=1e-4),
    Difference("stones within 0.2 ms", within_s=2e-4), Difference("stones within 1 ms", within_s=1e-3),
    Difference("8 stones", 8), Difference("12 stones", 12), Difference("radius 20 mm", size=0.8),
    Difference("radius 30 mm", size=1.2), Difference("speed 2.5 m/s", speed=2.5 / 3), Difference("speed 3.5 m/s", speed=3.5 / 3),
    Difference("taps of another plate", taps="2"), Difference("plate of another theory, tapped", taps="other theory",
                                                              plate="other theory"),
    *(Difference(name, record=FAULTS[name]) for name in ("one gain 0.8", "wrong sign", "two sensors swapped")),
    *(Difference(f"{n} stones, 8 to 12 told", n, told=SOME) for n in (8, 10, 12)),
    *(Difference(f"speed {v:g} m/s, 2.5 to 3.2 told", speed=v / 3, told=FAST) for v in (2.5, 3.0))]


read = cache(read_dataset)


def volleys(out: Path, dataset: str = "runs/dataset", held_out: str = "runs/held_out") -> Iterator[Row]:
    """Runs of two data sets, on the plates in turn."""
    def one(data: DataSet, k: int, kind: str, number: int) -> dict[str, object]:
        return heard(data.runs[k], Difference("nothing", plate=kind, taps=kind), number, out)

    parts = [("good", dataset, family, count) for family, count in RECORDS.items()] + [("held out", held_out, "clean", None)]
    for name, path, family, count in parts:
        data = read(path)
        for number, k in enumerate(np.random.default_rng(1).permutation(data.of(family))[:count]):
            kind = "12"[number % 2]
            yield Row({"set": name, "family": family, "number": number, "plate": kind}, partial(one, data, k, kind, number))


def volleys_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Errors in points over the records that were answered."""
    return grouped(rows, ["set", "family"], told_of)


def volley_differences(out: Path, dataset: str = "runs/dataset") -> Iterator[Row]:
    """The same runs with each difference."""
    data = read(dataset)
    chosen = np.random.default_rng(2).permutation(data.of("free"))[:2 * DIFFERENT]
    for seed in range(DIFFERENT):
        one, other = (data.runs[k] for k in chosen[[seed, seed + DIFFERENT]])
        for difference in DIFFERENCES:
            yield Row({"differs": difference.name, "seed": seed}, partial(heard, one, difference, seed, out, other))


def volley_differences_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    return grouped(rows, ["differs"], told_of)


def volley_shares(out: Path, dataset: str = "runs/dataset") -> Iterator[Row]:
    """Mean impulse of a stone of coal and of gangue in m v, of each family."""
    def shares(family: str) -> dict[str, float]:
        data, found = read(dataset), {False: list[float](), True: list[float]()}
        for k in data.of(family):
            for history, _ in stones_of(force_record_of(data.runs[k], FORCE_S)):
                found[history.gangue].append(history.moments()[0] / (history.mass_kg * history.speed_m_s))
        return {"coal": float(np.mean(found[False])), "gangue": float(np.mean(found[True]))}

    for family in RECORDS:
        yield Row({"family": family}, partial(shares, family))


def heard(run: Run, difference: Difference, seed: int, out: Path, more: Run | None = None) -> dict[str, object]:
    """What is made of a run's stones; of more than it has, the rest are those of another run."""
    rng = np.random.default_rng([23, seed])
    record = force_record_of(run, FORCE_S)
    fallen = stones_of(record)
    if difference.stones > len(fallen) and more is not None:
        fallen += stones_of(force_record_of(more, FORCE_S))
    fallen = [(scaled(h, difference.size, difference.speed), place) for h, place in fallen[:difference.stones]]
    histories = [h for h, _ in fallen]
    arrival_s = SILENCE_S + rng.uniform(-1e-3, 1e-3) + np.sort(rng.uniform(0, difference.within_s, len(fallen)))
    table = stone_rows(histories, np.arange(len(fallen)), arrival_s, np.array([place for _, place in fallen]))
    values = stream_of(true_plate(difference.plate), ALL, histories, table, RATE_Hz, 20.0, rng, AFTER_S).values
    if difference.record is not None:
        values = difference.record(values, RATE_Hz)
    return judged(tapped(difference.taps, out), values, difference.told, true_ratio(table, False), true_ratio(table, True))


def stones_of(record: ForceRecord) -> list[tuple[History, np.ndarray]]:
    """Force and place of each stone of a run."""
    return [(History(force, record.step_s, bool(gangue), PAPER.radius_m, DENSITY[bool(gangue)], record.speed_m_s), place)
            for force, gangue, place in zip(record.force_N, record.gangue, record.touch_m, strict=True)]


def judged(plate: PlateModel, values: np.ndarray, told: Stones, right: float, right_mass: float) -> dict[str, object]:
    """expected: probability that `volley` itself gives its interval by number."""
    forces, began = load_forces(), time.process_time()
    row: dict[str, object] = {"ratio": right, "refused": ""}
    try:
        found = recognise_volley(plate, ALL.accelerometers, told, forces, values)
    except RecognitionError as error:
        return {**row, "refused": str(error)}
    row |= {"cpu_s": time.process_time() - began, "refused": found.refused, "misfit": found.likelihood.misfit,
            "outside": found.outside, "gain": float(abs(found.likelihood.gain - 1).max())}
    for name, true, by_mass in (("number", right, False), ("mass", right_mass, True)):
        low, middle, high = found.ratio(by_mass)
        share, weight = found.posterior(by_mass)
        row |= {f"{name}_error": 100 * (middle - true), f"{name}_inside": low - 1e-9 <= true <= high + 1e-9,
                f"{name}_width": 100 * (high - low),
                f"{name}_expected": float(weight[(share >= low - 1e-9) & (share <= high + 1e-9)].sum())}
    return row


def told_of(rows: pd.DataFrame) -> dict[str, object]:
    answered = rows[rows["refused"] == ""]
    told: dict[str, object] = {"records": len(rows), "refused": len(rows) - len(answered)}
    for name in ("number", "mass"):
        if "number_error" not in answered or answered.empty:
            return told
        size = answered[f"{name}_error"].abs()
        told |= {f"{name}_mean": round(size.mean(), 2), f"{name}_95": round(float(np.quantile(size, 0.95)), 1),
                 f"{name}_worst": round(size.max(), 1), f"{name}_bias": round(answered[f"{name}_error"].mean(), 1),
                 f"{name}_wrong": int((size > WRONG_points).sum()),
                 f"{name}_inside": int((answered[f"{name}_inside"] == True).sum()),  # noqa: E712, of strings
                 f"{name}_width": round(answered[f"{name}_width"].mean(), 1),
                 f"{name}_expected": round(answered[f"{name}_expected"].mean(), 3)}
    told["misfit"] = f"{rows['misfit'].min():.2f} to {rows['misfit'].max():.2f}"
    told["cpu_s"] = round(float(rows["cpu_s"].mean()), 2)
    return told
