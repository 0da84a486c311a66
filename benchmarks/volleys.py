"""Volleys of stones that fall within 0.1 ms, and what `listen` makes of them: volleys.csv, for docs/listening.md.

    python -m benchmarks.volleys [--out runs/listening] [--set held_out] [--records 8] [--stones 10]

A record has silence and five volleys, a quarter of a second apart, on a plate as in benchmarks/listening.py; noise is
20 dB below the rms of the 20 ms after each onset. Stones lie on the paper's circle (turned by any angle) or anywhere,
their middles at least a diameter apart. Each volley is a row: what `listen` answers, and, as a bound, what the same
likelihood answers where the search is spared: from the true stones on (`started`), and with the places known too
(`known`). The number of stones is not told.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.listening import ALL, PAPER_m, REACH_m, SPEEDS_m_s, added, tapped, there, true_plate
from recognition.estimation.arrays import Floats
from recognition.evaluation.stone_histories import histories
from recognition.plate.plate_model import PlateModel
from recognition.stream.bank import PARAMETERS, X, Y
from recognition.stream.fit import Fit
from recognition.stream.forces import History
from recognition.stream.law_file import load_forces
from recognition.stream.prior import StonePrior
from recognition.stream.recognise import RATE_Hz, Recognised, recognise_stream
from recognition.stream.signatures import LEAD
from recognition.stream.simulated import SILENCE_S, Stream, stone_rows, stream_of
from recognition.stream.stones import ratio_of
from recognition.stream.volley import VolleyWindow

VOLLEYS, PAUSE_s, WITHIN_s, LOUD_s = 5, 0.25, 1e-4, 0.02
CIRCLE_m = 0.1  # of the paper
KNOWN_m = 1e-3  # standard deviation of places that are known


def places(where: str, count: int, rng: np.random.Generator) -> Floats:
    if where == "circle":
        angle = 2 * np.pi * np.arange(count) / count + rng.uniform(0, 2 * np.pi)
        return CIRCLE_m * rng.permutation(np.column_stack([np.cos(angle), np.sin(angle)]))
    found: list[Floats] = []
    while len(found) < count:
        place = rng.uniform(-REACH_m, REACH_m, 2)
        if all(np.hypot(*(place - other)) > 2 * PAPER_m for other in found):
            found.append(place)
    return np.array(found)


def volley(pool: list[History], onset_s: float, where: str, count: int, rng: np.random.Generator) -> pd.DataFrame:
    """Rows of stones, any number of which are gangue."""
    gangue = rng.permutation(np.arange(count) < rng.integers(0, count + 1))
    which = np.array([rng.choice([k for k, h in enumerate(pool) if h.gangue == g]) for g in gangue])
    arrival_s = onset_s + np.sort(rng.uniform(0, WITHIN_s, count))
    return stone_rows(pool, which, arrival_s, places(where, count, rng))


def record(plate: PlateModel, pool: list[History], where: str, count: int, rng: np.random.Generator) -> Stream:
    onset_s = SILENCE_S + PAUSE_s * np.arange(VOLLEYS) + rng.uniform(0, 1e-3, VOLLEYS)
    truth = pd.concat([volley(pool, t_s, where, count, rng).assign(volley=k) for k, t_s in enumerate(onset_s)],
                      ignore_index=True)
    clean = stream_of(plate, ALL, pool, truth, RATE_Hz, None, rng)
    loud = np.concatenate([clean.values[:, int(t * RATE_Hz):int((t + LOUD_s) * RATE_Hz)] for t in onset_s], axis=1)
    noise = 0.1 * np.sqrt(np.mean(loud**2, axis=1))
    return replace(clean, values=clean.values + noise[:, None] * rng.standard_normal(clean.values.shape))


@dataclass(frozen=True)
class KnownPlaces(VolleyWindow):
    """A window with stones whose places (k, 2) are known."""

    place_m: Floats = field(kw_only=True)

    def at(self, stones: Floats) -> Fit:
        found = super().at(stones)
        off = (stones[:, [X, Y]] - self.place_m) / KNOWN_m
        slope, curvature = found.slope, found.curvature
        for axis in (X, Y):
            rows = PARAMETERS * np.arange(len(stones)) + axis
            slope[rows] += off[:, axis - X] / KNOWN_m
            curvature[rows, rows] += KNOWN_m**-2
        return replace(found, cost=found.cost + 0.5 * float(np.sum(off**2)))


def without_search(window: VolleyWindow, truth: pd.DataFrame) -> dict[str, float]:
    """Mean number of gangue by the likelihood about the truth, as errors in points."""
    zero = np.zeros(len(truth))
    time = truth["centre_s"] * RATE_Hz - window.first - LEAD
    true = np.column_stack([time, np.log(truth["duration_s"]), truth["x_m"], truth["y_m"], zero,
                            np.log(truth["impulse_N_s"])])
    place = truth[["x_m", "y_m"]].to_numpy()
    known = KnownPlaces(window.bank, window.prior, window.values, window.first, compressed=window.compressed,
                        place_m=place)
    row: dict[str, float] = {}
    for name, one in (("started", window), ("known", known)):
        log = one.materials(one.fit(true, 40))
        gangue = 1 / (1 + np.exp(np.clip(log[:, 0] - log[:, 1], -30, 30)))
        row |= {f"{name}_error": 100 * float(gangue.mean() - truth["gangue"].mean()),
                f"{name}_wrong": int(np.sum((gangue > 0.5) != truth["gangue"]))}
    return row


def told(found: Recognised, truth: pd.DataFrame) -> dict[str, object]:
    """What was made of one volley; the median of the ratio and the mean of its probabilities."""
    onset_s = float(truth["t_s"].min())
    stones = found.stones[found.stones["t_s"].between(onset_s - 2e-3, onset_s + 2e-2)]
    low, middle, high = ratio_of(stones)
    right = float(truth["gangue"].mean())
    row: dict[str, object] = {
        "gangue": right, "found": len(stones), "jointly": bool(len(stones) and (stones["together"] > 1).all()),
        "error": 100 * (middle - right), "mean_error": 100 * (stones["gangue"].mean() - right), "low": low,
        "high": high,
        "inside": low - 1e-9 <= right <= high + 1e-9}
    first = onset_s * RATE_Hz
    for window in found.volleys.windows:
        if window.first < first < window.first + 2 * LEAD:
            row |= without_search(window, truth)
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("runs/listening"))
    parser.add_argument("--set", default="held_out")
    parser.add_argument("--records", type=int, default=8)
    parser.add_argument("--stones", type=int, default=10)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    prior = StonePrior(load_forces(), (PAPER_m, PAPER_m), SPEEDS_m_s)
    pool = [h for h in histories(options.set) if abs(h.radius_m - PAPER_m) < 0.01 * PAPER_m]
    for number in range(options.records):
        where, kind = ("anywhere", "circle")[number % 2], str(1 + number // 2 % 2)
        key: dict[str, object] = {"set": options.set, "stones": options.stones, "record": number}
        if there(key, options.out / "volleys.csv"):
            continue
        rng = np.random.default_rng([11, options.stones, number])
        made = record(true_plate(kind), pool, where, options.stones, rng)
        found = recognise_stream(tapped(kind, options.out), ALL, prior, made.values, together=True)
        for _, truth in made.truth.groupby("volley"):
            added({**key, "where": where, "plate": kind, **told(found, truth), "refused": found.refused,
                   "unexplained": found.checks.unexplained, "hear_s": found.hearing_s}, options.out / "volleys.csv")


if __name__ == "__main__":
    main()
