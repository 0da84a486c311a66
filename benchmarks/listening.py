"""Streams of known truth, and what `listen` makes of them: goals.csv, silent.csv and good.csv, for docs/listening.md.

    python -m benchmarks.listening [--out runs/listening] [goals | good | silent ...]

Streams are superpositions (recognition/stream/simulated.py) of forces of single stones (benchmarks/stone_forces.py) on
plates that are not the model's: frequencies, damping and shapes scattered by 1, 10 and 1 %, or Kirchhoff's theory. Each
plate is tapped at four places with 20 dB of noise, and what `tap` learnt is what `listen` is given. Places, arrivals and
speeds are unknown, noise is 20 dB at 20 kHz.

good: streams of the set "tried", from which the limits of recognition/stream/checks.py were set.
silent: the same with something that `listen` is not told. Rows that are in a table are not made again.
goals: streams of the set "held_out", whose forces no law or limit has seen.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from common.plate import FlexiblePlate, read_plate
from recognition.estimation.errors import RecognitionError
from recognition.evaluation import other_plates
from recognition.evaluation.stone_histories import histories
from recognition.evaluation.tap_records import hammer_taps
from recognition.plate.plate_model import PlateModel
from recognition.stream.forces import History
from recognition.stream.law_file import load_forces
from recognition.stream.prior import StonePrior
from recognition.stream.recognise import RATE_Hz, recognise_stream
from recognition.stream.signatures import Channels
from recognition.stream.simulated import Stream, draw_stones, stream_of
from recognition.stream.stones import ratio_of
from recognition.tapping.fit import fit_plate
from recognition.tapping.learnt import learnt

SCENE = "scenes/single.toml"
REACH_m, PAPER_m, SIZES_m, SPEEDS_m_s = 0.2, 0.025, (0.015, 0.035), (2.0, 4.0)
ALL, ONE = Channels((0, 1, 2, 3)), Channels((0,))
HIGHEST_Hz, TRUE_Hz = 12500.0, 20000.0  # of the modes that the model has, and of the plate's
PART = 20  # stones of the windows by which intervals are counted
MATCH_s = 1.5e-4  # a stone is heard if its arrival is


@dataclass(frozen=True)
class Case:
    """A stream: stones a second, stones, sensors, all sizes?, gangue ratio."""

    rate_1_s: float = 100.0
    count: int = 30
    channels: Channels = ALL
    all_sizes: bool = False
    gangue: float = 0.5
    noise_db: float = 20.0


@cache
def true_plate(kind: str) -> PlateModel:
    exact = PlateModel.from_scene(SCENE, TRUE_Hz)
    if kind == "other theory":
        return other_plates.other_theory(exact, SCENE)
    return other_plates.scattered(exact, 0.01, np.random.default_rng([100, int(kind)]))


@cache
def tapped(kind: str, out: Path) -> PlateModel:
    """What four taps teach of that plate; kept in a file."""
    file = out / f"plate_{kind.replace(' ', '_')}.json"
    if not file.is_file():
        rng = np.random.default_rng([200, len(kind)])
        taps = hammer_taps(true_plate(kind), rng.uniform(-0.22, 0.22, (4, 2)), rng, rate_Hz=2 * RATE_Hz,
                           place_error_m=1.5e-3)
        learnt(fit_plate(PlateModel.from_scene(SCENE, HIGHEST_Hz), taps)).plate.save(file)
    return PlateModel.load(file)


def stream(plate: PlateModel, case: Case, pool: Sequence[History], rng: np.random.Generator) -> Stream:
    chosen = [h for h in pool if case.all_sizes or abs(h.radius_m - PAPER_m) < 0.01 * PAPER_m]
    truth = draw_stones(chosen, case.count, case.rate_1_s, REACH_m, case.gangue, rng)
    return stream_of(plate, case.channels, chosen, truth, RATE_Hz, case.noise_db, rng)


def heard(plate: PlateModel, case: Case, record: Stream, prior: StonePrior | None = None) -> dict[str, object]:
    """What is made of a record: errors in points, checks, and how often the interval of PART stones holds."""
    size = SIZES_m if case.all_sizes else (PAPER_m, PAPER_m)
    prior = prior or StonePrior(load_forces(), size, SPEEDS_m_s)
    began = time.process_time()
    try:
        found = recognise_stream(plate, case.channels, prior, record.values)
    except RecognitionError as error:
        return {"stones": case.count, "refused": str(error)}
    stones, truth, checks = found.stones, record.truth, found.checks
    row: dict[str, object] = {
        "stones": case.count, "heard": len(stones), **matched(stones, truth), "cpu_s": time.process_time() - began,
        "hear_s": found.hearing_s, "length_s": record.values.shape[1] / RATE_Hz, "refused": found.refused,
        "unexplained": checks.unexplained, "gain": float(abs(checks.gain - 1).max()), "unlike": checks.unlike,
        "silence": checks.silence}
    for name, by_mass in (("number", False), ("mass", True)):
        low, middle, high = ratio_of(stones, by_mass)
        right = true_ratio(truth, by_mass)
        inside = [holds(stones, part, by_mass) for part in parts(truth)]
        row |= {f"{name}_error": 100 * (middle - right), f"{name}_inside": low <= right <= high,
                f"{name}_parts_inside": sum(inside), "parts": len(inside)}
    return row


def true_ratio(truth: pd.DataFrame, by_mass: bool) -> float:
    weight = truth["mass_kg"].to_numpy() if by_mass else np.ones(len(truth))
    return float(weight @ truth["gangue"].to_numpy() / weight.sum())


def parts(truth: pd.DataFrame) -> list[pd.DataFrame]:
    return [truth.iloc[k:k + PART] for k in range(0, len(truth) - PART + 1, PART)]


def holds(stones: pd.DataFrame, part: pd.DataFrame, by_mass: bool) -> bool:
    """Does the interval of the stones that were heard during a part of the stream hold its ratio?"""
    during = stones[stones["t_s"].between(part["t_s"].iloc[0] - MATCH_s, part["t_s"].iloc[-1] + MATCH_s)]
    low, _, high = ratio_of(during, by_mass)
    return low - 1e-9 <= true_ratio(part, by_mass) <= high + 1e-9


def matched(stones: pd.DataFrame, truth: pd.DataFrame) -> dict[str, int]:
    """Stones that were found, those of them with the wrong material, and those that were none."""
    at, found, wrong, none = truth["t_s"].to_numpy(), set(), 0, 0
    for t_s, gangue in zip(stones["t_s"], stones["gangue"] > 0.5, strict=True):
        k = int(np.argmin(abs(at - t_s)))
        if abs(at[k] - t_s) < MATCH_s and k not in found:
            found.add(k)
            wrong += bool(gangue != truth["gangue"].iloc[k])
        else:
            none += 1
    return {"found": len(found), "wrong": wrong, "none": none}


#: Goals of the docs: name, case, plates, on which the streams fall in turn, and how many streams.
GOALS: list[tuple[str, Case, tuple[str, ...], int]] = [
    ("200 a second", Case(200, 100), ("1", "2"), 20),
    ("100 a second", Case(100, 100), ("1", "2"), 20),
    ("all sizes", Case(50, 100, all_sizes=True), ("1", "2"), 10),
    ("20 a second", Case(20, 100), ("1", "2"), 2),
    ("volley of ten", Case(1e5, 10), ("1", "2"), 4),
    ("one accelerometer", Case(20, 60, ONE), ("1",), 10),
    ("400 stones", Case(100, 400), ("1",), 4),
    ("other theory", Case(100, 100), ("other theory",), 4)]


def goals(out: Path) -> None:
    pool = histories("held_out")
    for name, case, kinds, seeds in GOALS:
        for seed in range(seeds):
            kind = kinds[seed % len(kinds)]
            key: dict[str, object] = {"case": name, "plate": kind, "seed": seed}
            if there(key, out / "goals.csv"):
                continue
            rng = np.random.default_rng([3, int(case.rate_1_s), case.count, len(kind), seed])
            one = replace(case, gangue=rng.uniform(0.2, 0.8))
            record = stream(true_plate(kind), one, pool, rng)
            added({**key, "gangue": one.gangue, **heard(tapped(kind, out), one, record)}, out / "goals.csv")


def good(out: Path) -> None:
    pool = histories("tried")
    for number, (kind, rate) in enumerate([(k, r) for k in ("1", "2", "other theory") for r in (20, 50, 100, 200, 50)]):
        key: dict[str, object] = {"plate": kind, "number": number}
        if there(key, out / "good.csv"):
            continue
        rng = np.random.default_rng([5, number])
        case = Case(rate, 60, gangue=rng.uniform(0.2, 0.8), all_sizes=number % 5 == 4)
        record = stream(true_plate(kind), case, pool, rng)
        added({**key, "rate_1_s": rate, "all_sizes": case.all_sizes, **heard(tapped(kind, out), case, record)},
              out / "good.csv")


def scaled(h: History, size: float, speed: float = 1.0) -> History:
    """A stone `size` times as large and `speed` times as fast as another, by Hertz: a larger stone of the same speed has
    the same stresses, and so breaks alike; another speed is for stones that stay whole."""
    stretch, push = size * speed**-0.2, size**2 * speed**1.2
    at = (np.arange(len(h.force_N)) + 0.5) / stretch - 0.5
    return replace(h, force_N=push * np.interp(at, np.arange(len(h.force_N)), h.force_N, right=0.0),
                   radius_m=size * h.radius_m, speed_m_s=speed * h.speed_m_s)


Changed = Callable[[Stream], Stream]


def on_values(change: Callable[[np.ndarray], np.ndarray]) -> Changed:
    return lambda record: replace(record, values=change(record.values.copy()))


def with_factor(channel: int, factor: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(values: np.ndarray) -> np.ndarray:
        values[channel] *= factor
        return values
    return change


def _gains(values: np.ndarray) -> np.ndarray:
    return values * np.array([1.05, 0.95, 1.05, 0.95])[:, None]


def _offset(values: np.ndarray) -> np.ndarray:
    values[1] += 0.05 * abs(values[1]).max()
    return values


def _hum(values: np.ndarray) -> np.ndarray:
    values[2] += 0.05 * abs(values[2]).max() * np.sin(2 * np.pi * 50 * np.arange(values.shape[1]) / RATE_Hz)
    return values


def _clipped(values: np.ndarray) -> np.ndarray:
    values[0] = np.clip(values[0], *(0.4 * abs(values[0]).max() * np.array([-1, 1])))
    return values


def _late(record: Stream) -> Stream:
    """The record from the tenth stone on: no silence before."""
    cut_s = record.truth["t_s"].iloc[9] + 1e-3
    truth = record.truth.iloc[10:].reset_index(drop=True)
    truth = truth.assign(t_s=truth["t_s"] - cut_s, centre_s=truth["centre_s"] - cut_s)
    return replace(record, values=record.values[:, round(cut_s * RATE_Hz):], truth=truth)


def _thinner() -> PlateModel:
    table = read_plate(SCENE)
    assert isinstance(table, FlexiblePlate)
    return PlateModel.from_scene(table.model_copy(update={"thickness_m": 0.99 * table.thickness_m}), TRUE_Hz)


def _moved_sensor(plate: PlateModel) -> PlateModel:
    shape = plate.sensor_shape.copy()
    shape[0] = plate.shape(plate.sensor_m[:1, 0], plate.sensor_m[:1, 1] - 0.02)[0]
    return replace(plate, sensor_shape=shape)


@dataclass(frozen=True)
class Difference:
    """What is other than `listen` is told: the true plate, the record, or the stones."""

    name: str
    plate: Callable[[], PlateModel] | None = None
    record: Changed | None = None
    stones: Callable[[list[History]], list[History]] | None = None
    case: Case = Case()
    untapped: bool = False


def differences() -> list[Difference]:
    first = lambda: true_plate("1")  # noqa: E731
    exact = lambda: PlateModel.from_scene(SCENE, TRUE_Hz)  # noqa: E731
    return [
        Difference("nothing"),
        Difference("record begins amid the stream", record=_late),
        Difference("plate not tapped, modes 1 % off", first, untapped=True),
        Difference("plate not tapped, other theory", lambda: true_plate("other theory"), untapped=True),
        Difference("plate not tapped, 1 % thinner", _thinner, untapped=True),
        Difference("plate not tapped, damping twice", lambda: replace(exact(), damping_ratio=2 * exact().damping_ratio),
                   untapped=True),
        Difference("another plate's taps", lambda: true_plate("2")),
        Difference("a sensor 20 mm off", lambda: _moved_sensor(first())),
        Difference("gains +5, -5, +5, -5 %", record=on_values(_gains)),
        Difference("one gain 0.8", record=on_values(with_factor(1, 0.8))),
        Difference("wrong sign", record=on_values(with_factor(1, -1.0))),
        Difference("two sensors swapped", record=on_values(lambda v: v[[1, 0, 2, 3]])),
        Difference("offset of 5 % of the peak", record=on_values(_offset)),
        Difference("50 Hz of 5 % of the peak", record=on_values(_hum)),
        Difference("clipped at 40 %", record=on_values(_clipped)),
        Difference("dead channel", record=on_values(with_factor(3, 1e-3))),
        Difference("noise of 10 dB", case=Case(noise_db=10.0)),
        Difference("radius 20 mm", stones=lambda pool: [scaled(h, 0.8) for h in pool]),
        Difference("radius 30 mm", stones=lambda pool: [scaled(h, 1.2) for h in pool]),
        Difference("radii 15 to 35 mm", case=Case(all_sizes=True)),
        Difference("speed 1 to 1.5 m/s", stones=lambda pool: [scaled(h, 1.0, 0.5) for h in pool if h.speed_m_s < 2.9]),
        Difference("bonds 25 % weaker or stronger", stones=lambda _: histories("other_rock")),
    ]


def silent(out: Path, streams: int = 20) -> None:
    for seed in range(streams):
        for difference in differences():
            key: dict[str, object] = {"differs": difference.name, "seed": seed}
            if there(key, out / "silent.csv"):
                continue
            rng = np.random.default_rng([9, seed])
            case = replace(difference.case, gangue=(0.2, 0.35, 0.5, 0.65, 0.8)[seed % 5])
            added({**key, **_silent_one(difference, case, rng, out)}, out / "silent.csv")


def _silent_one(difference: Difference, case: Case, rng: np.random.Generator, out: Path) -> dict[str, object]:
    pool = histories("tried")
    if difference.stones is not None:
        pool = difference.stones([h for h in pool if abs(h.radius_m - PAPER_m) < 1e-6])
        pool = [replace(h, radius_m=PAPER_m) for h in pool]
    plate = true_plate("1") if difference.plate is None else difference.plate()
    record = stream(plate, case, pool, rng)
    if difference.record is not None:
        record = difference.record(record)
    model = tapped("1", out)
    if difference.untapped:
        model = PlateModel.from_scene(SCENE, HIGHEST_Hz, frequency_sd=0.03, damping_sd=0.5)
    told = replace(case, all_sizes=False, count=len(record.truth))
    return heard(model, told, record)


def there(key: dict[str, object], file: Path) -> bool:
    """Whether a table has a row of that key: what was made before is kept."""
    if not file.is_file():
        return False
    rows = pd.read_csv(file, dtype=str)
    return bool(np.all([rows[name] == str(value) for name, value in key.items()], axis=0).any())


def added(row: dict[str, object], file: Path) -> None:
    print(row, flush=True)
    before = [pd.read_csv(file)] if file.is_file() else []
    pd.concat([*before, pd.DataFrame([row])]).to_csv(file, index=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=["good", "silent", "goals"], default=["good", "silent", "goals"])
    parser.add_argument("--out", type=Path, default=Path("runs/listening"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for part in options.parts:
        {"good": good, "silent": silent, "goals": goals}[part](options.out)


if __name__ == "__main__":
    main()
