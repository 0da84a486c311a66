"""Streams of known truth: plates that are not the model's, what taps teach of them, records,
and what `listen` makes of those."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from lab.known_truth import other_plates
from lab.known_truth.simulated import Stream, draw_stones, stream_of
from lab.known_truth.tap_records import hammer_taps
from recognition.estimation.answer import Answer
from recognition.estimation.errors import RecognitionError
from recognition.innovations.prior import StonePrior
from recognition.innovations.signatures import Channels
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import History, load_forces
from recognition.stream.recognise import QUIET_S, RATE_Hz, recognise_stream
from recognition.stream.stones import ratio_of
from recognition.tapping.fit import fit_plate
from recognition.tapping.tapped import learnt, refuse_unexplained

SCENE = "scenes/single.toml"
REACH_m, PAPER_m, SIZES_m, SPEEDS_m_s = 0.2, 0.025, (0.015, 0.035), (2.0, 4.0)
ALL, ONE = Channels((0, 1, 2, 3)), Channels((0,))
HIGHEST_Hz, TRUE_Hz = 12500.0, 20000.0  # of the modes that the model has, and of the plate's
AGAIN = 5  # times each stone is brought to a radius
PART = 20  # stones of the windows by which intervals are counted
WITHIN_s = 1e-4  # of the stones of a volley
MATCH_s = 1.5e-4  # a stone is heard if its arrival is


@dataclass(frozen=True)
class Case:
    """A stream: stones a second, stones, sensors, all sizes?, gangue ratio, stones that fall within WITHIN_s, radii to
    which stones are brought."""

    rate_1_s: float = 100.0
    count: int = 30
    channels: Channels = ALL
    all_sizes: bool = False
    gangue: float = 0.5
    noise_db: float | None = 20.0
    at_once: int = 1
    brought_to_m: tuple[float, float] | None = None


def scaled(h: History, size: float, speed: float = 1.0) -> History:
    """A stone `size` times as large and `speed` times as fast as another, by Hertz: a larger stone of the same speed has
    the same stresses, and so breaks alike; another speed is for stones that stay whole."""
    stretch, push = size * speed**-0.2, size**2 * speed**1.2
    at = (np.arange(len(h.force_N)) + 0.5) / stretch - 0.5
    return replace(h, force_N=push * np.interp(at, np.arange(len(h.force_N)), h.force_N, right=0.0),
                   radius_m=size * h.radius_m, speed_m_s=speed * h.speed_m_s)


@cache
def true_plate(kind: str) -> PlateModel:
    exact = PlateModel.from_scene(SCENE, TRUE_Hz)
    if kind == "other theory":
        return other_plates.other_theory(exact, SCENE)
    return other_plates.scattered(exact, 0.01, np.random.default_rng([100, int(kind)]))


@cache
def tapped(kind: str, out: Path) -> PlateModel:
    """What four taps teach of that plate; kept in a file."""
    return learnt_by_taps(true_plate(kind), out / f"plate_{kind.replace(' ', '_')}.json", np.random.default_rng([200, 1]))


def learnt_by_taps(true: PlateModel, file: Path, rng: np.random.Generator, count: int = 4) -> PlateModel:
    """What taps with 20 dB of noise teach of a plate, unless a file has it, whose name tells that plate."""
    file = file.with_stem(f"{file.stem}_{hashlib.sha256(true.grid_shape.tobytes()).hexdigest()[:8]}")
    if not file.is_file():
        taps = hammer_taps(true, rng.uniform(-0.22, 0.22, (count, 2)), rng, rate_Hz=2 * RATE_Hz,
                           place_error_m=1.5e-3)
        found = learnt(fit_plate(PlateModel.from_scene(SCENE, HIGHEST_Hz), taps))
        refuse_unexplained(found)
        found.whole_plate(SCENE).save(file)
    return PlateModel.load(file)


def stream(plate: PlateModel, case: Case, pool: Sequence[History], rng: np.random.Generator) -> Stream:
    chosen = of_case(case, pool)
    if case.brought_to_m is not None:
        chosen = [scaled(h, rng.uniform(*case.brought_to_m) / h.radius_m) for h in chosen for _ in range(AGAIN)]
    truth = draw_stones(chosen, case.count, case.rate_1_s, REACH_m, case.gangue, rng)
    if case.at_once > 1:
        truth = in_volleys(truth, case.at_once, rng)
    return stream_of(plate, case.channels, chosen, truth, RATE_Hz, case.noise_db, rng)


def of_case(case: Case, pool: Sequence[History]) -> list[History]:
    """The stones of a pool that a case is about: those of the paper's size, or the others."""
    return [h for h in pool if (abs(h.radius_m - PAPER_m) > 0.01 * PAPER_m) == case.all_sizes]


def in_volleys(truth: pd.DataFrame, count: int, rng: np.random.Generator) -> pd.DataFrame:
    """The same stones, `count` of which fall within WITHIN_s of the first of them."""
    before = truth["t_s"].to_numpy()
    now = np.sort(np.repeat(before[::count], count)[:len(before)] + rng.uniform(0, WITHIN_s, len(before)))
    return truth.assign(t_s=now, centre_s=truth["centre_s"] + now - before)


def prior_of(case: Case) -> StonePrior:
    sizes_m = case.brought_to_m or SIZES_m
    return StonePrior(load_forces(), sizes_m if case.all_sizes else (PAPER_m, PAPER_m), SPEEDS_m_s)


def heard(plate: PlateModel, case: Case, record: Stream, quiet_s: float = QUIET_S) -> dict[str, object]:
    """What is made of a record: errors in points, checks, and how often the interval of PART stones holds."""
    prior = prior_of(case)
    began = time.process_time()
    try:
        found = recognise_stream(plate, case.channels, prior, record.values, quiet_s)
    except RecognitionError as error:
        return {"stones": case.count, "refused": str(error)}
    stones, truth, checks = found.stones, record.truth, found.checks
    row: dict[str, object] = {
        "stones": case.count, "heard": len(stones), **matched(stones, truth), "cpu_s": time.process_time() - began,
        "hear_s": found.hearing.hearing_s, "length_s": record.values.shape[1] / RATE_Hz, "refused": found.refused,
        "warned": not found.hearing.tapped or bool(Answer.between(*ratio_of(stones)).warning),
        "unexplained": checks.unexplained, "gain": float(abs(checks.gain - 1).max()), "no_stone": checks.none,
        "beyond": checks.beyond, "together": checks.together, "change": checks.change}
    for name, by_mass in (("number", False), ("mass", True)):
        low, middle, high = ratio_of(stones, by_mass)
        right = true_ratio(truth, by_mass)
        told = [told_of_part(stones, part, by_mass) for part in parts(truth)]
        row |= {f"{name}_error": 100 * (middle - right), f"{name}_inside": low <= right <= high,
                f"{name}_width": 100 * (high - low),
                f"{name}_parts_inside": sum(inside for inside, _ in told),
                f"{name}_parts_exact": sum(exact for _, exact in told), "parts": len(told)}
    return row


def true_ratio(truth: pd.DataFrame, by_mass: bool) -> float:
    weight = truth["mass_kg"].to_numpy() if by_mass else np.ones(len(truth))
    return float(weight @ truth["gangue"].to_numpy() / weight.sum())


def parts(truth: pd.DataFrame) -> list[pd.DataFrame]:
    return [truth.iloc[k:k + PART] for k in range(0, len(truth) - PART + 1, PART)]


def told_of_part(stones: pd.DataFrame, part: pd.DataFrame, by_mass: bool) -> tuple[bool, bool]:
    """Whether the interval of the stones that were heard during a part of the stream holds its ratio, and whether the
    ratio itself is right within half a point."""
    during = stones[stones["t_s"].between(part["t_s"].iloc[0] - MATCH_s, part["t_s"].iloc[-1] + MATCH_s)]
    low, middle, high = ratio_of(during, by_mass)
    right = true_ratio(part, by_mass)
    return low - 1e-9 <= right <= high + 1e-9, abs(middle - right) < 0.005


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
