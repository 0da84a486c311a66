"""Volleys of ten stones on unknown places, and what `volley` makes of them.

Forces are those of stones that fell together in runs of the engine (families `ring` and `free` of scenes/dataset.toml,
3 m/s); their sum goes through plates that are not the model's, as in listening.py (plates "1" and "2": frequencies,
damping and shapes scattered by 1, 10 and 1 %), with 20 dB of noise at 20 kHz and four accelerometers. `volley` is
given what four taps taught of the plate, the number, radius and speed of the stones, and neither places nor the time
of arrival, which is anywhere within 1 ms.

volley_shares: the impulse of a stone in m v, from which NEAR_SHARE and FAR_SHARE of recognition/volley/recognise.py
are. volleys: of the records of RECORDS those shares and the limits of misfit and gain were made; `held_out` are runs
of scenes/dataset_held_out.toml, of other seeds and packings.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.sweep.runs import Run
from lab.known_truth.simulated import stone_rows, stream_of
from lab.streams.known_streams import ALL, tapped, true_plate, true_ratio
from lab.streams.listening import grouped
from lab.study import Row
from recognition.estimation.errors import RecognitionError
from recognition.evaluation import DataSet, read_dataset
from recognition.physics.force_records import ForceRecord, force_record_of
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import History, load_forces
from recognition.volley.moments import RATE_Hz, Stones
from recognition.volley.recognise import recognise_volley

PAPER = Stones((10, 10), 0.025, (3.0, 3.0))
DENSITY = {False: 1380.0, True: 2400.0}
FORCE_S, SILENCE_S, AFTER_S = 3e-3, 0.05, 0.16
WRONG_points = 5.0
RECORDS = {"free": 40, "clean": 20}  # of the good ones


read = cache(read_dataset)


def volleys(out: Path, dataset: str = "runs/dataset", held_out: str = "runs/held_out") -> Iterator[Row]:
    """Runs of two data sets, on the plates in turn."""
    def one(data: DataSet, k: int, kind: str, number: int) -> dict[str, object]:
        return heard(data.runs[k], kind, number, out)

    parts = [("good", dataset, family, count) for family, count in RECORDS.items()] + [("held out", held_out, "clean", None)]
    for name, path, family, count in parts:
        data = read(path)
        for number, k in enumerate(np.random.default_rng(1).permutation(data.of(family))[:count]):
            kind = "12"[number % 2]
            yield Row({"set": name, "family": family, "number": number, "plate": kind}, partial(one, data, k, kind, number))


def volleys_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Errors in points over the records that were answered."""
    return grouped(rows, ["set", "family"], told_of)


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


def heard(run: Run, kind: str, seed: int, out: Path) -> dict[str, object]:
    """What is made of a run's stones on a plate."""
    rng, fallen = np.random.default_rng([23, seed]), stones_of(force_record_of(run, FORCE_S))
    histories = [h for h, _ in fallen]
    arrival_s = np.full(len(fallen), SILENCE_S + rng.uniform(-1e-3, 1e-3))
    table = stone_rows(histories, np.arange(len(fallen)), arrival_s, np.array([place for _, place in fallen]))
    values = stream_of(true_plate(kind), ALL, histories, table, RATE_Hz, 20.0, rng, AFTER_S).values
    return judged(tapped(kind, out), values, true_ratio(table, False), true_ratio(table, True))


def stones_of(record: ForceRecord) -> list[tuple[History, np.ndarray]]:
    """Force and place of each stone of a run."""
    return [(History(force, record.step_s, bool(gangue), PAPER.radius_m, DENSITY[bool(gangue)], record.speed_m_s), place)
            for force, gangue, place in zip(record.force_N, record.gangue, record.touch_m, strict=True)]


def judged(plate: PlateModel, values: np.ndarray, right: float, right_mass: float) -> dict[str, object]:
    """expected: probability that `volley` itself gives its interval by number."""
    forces, began = load_forces(), time.process_time()
    row: dict[str, object] = {"ratio": right, "refused": ""}
    try:
        found = recognise_volley(plate, ALL.accelerometers, PAPER, forces, values)
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
