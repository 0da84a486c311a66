"""Stones that are no clones: how far the ratio is off where the law of the stones is learnt from what was heard of them.

What is heard of a stone, (log s, b, log J), is that of a simulated one of another set than the law was fitted to, brought to
a size and speed by Hertz' law, changed as its kind says, and measured with an error. No wave form is computed: stones
that are missed, or heard twice, are those that the kind says. A stream has STONES; before them others may fall that one
knows (REFERENCES), or thinks that one does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from lab.known_truth.stone_histories import histories
from lab.study import Row
from recognition.estimation.arrays import Floats
from recognition.innovations.prior import StonePrior
from recognition.stone_forces.forces import heard_of, load_forces
from recognition.stream.recognise import LEAST_DOUBT
from recognition.stream.stone_law import UNKNOWN, LearntLaw, Told, doubted
from recognition.stream.stones import BY_LAW, ratio_of

STONES, SEEDS = 60, 1
SETS = ("held_out", "one_fall", "any_fall")
ERROR = np.array([0.02, 0.4, 0.025])
LOST_BELOW_N_s = 0.02  # of stones of a smaller impulse some are not heard


@dataclass(frozen=True)
class Reference:
    """Stones that are said to be of coal and of gangue, how many of the first are of the other material, whether they
    were dropped, and how much faster they fell."""

    coal: int = 0
    gangue: int = 0
    wrong: int = 0
    dropped: bool = False
    faster: float = 1.0


REFERENCES = {"none": Reference(), "15 coal first": Reference(15), "10 + 10 dropped": Reference(10, 10, dropped=True),
              "15 coal first, 2 of gangue": Reference(15, wrong=2),
              "10 + 10 dropped, 10 % faster": Reference(10, 10, dropped=True, faster=1.1)}
SILENT = 10.0  # points
REACH = 5.0  # points to either side that an answer has at most


@dataclass(frozen=True)
class Kind:
    """Of the stones of a stream: radii and speeds (evenly spread), limits told, standard deviations of log stiffness,
    density and size, lowest restitution, how much faster coal is, share of lumps, of corners, of what is no stone, and
    by how much errors are larger."""

    name: str
    radius_m: tuple[float, float] = (0.025, 0.025)
    speed_m_s: tuple[float, float] = (2.9, 3.1)
    told_m: tuple[float, float] | None = None
    told_m_s: tuple[float, float] | None = (2.0, 4.0)
    stiffness: float = 0.0
    density: float = 0.0
    size: float = 0.0
    restitution: tuple[float, float] = (0.9, 0.9)
    coal_speed: float = 1.0
    whole: bool = False
    lumps: float = 0.0
    corners: bool = False
    none: float = 0.0
    error: float = 1.0
    gangue: tuple[float, float] = (0.1, 0.9)


def kinds() -> list[Kind]:
    """Those of the result."""
    small, all_sizes, any_speed = (0.02, 0.03), (0.015, 0.035), (2.0, 4.0)
    return [Kind("clones"), Kind("any speed", speed_m_s=any_speed), Kind("22 mm for 25", (0.022, 0.022), told_m=(0.025, 0.025)),
            Kind("28 mm for 25", (0.028, 0.028), told_m=(0.025, 0.025)), Kind("20 to 30 mm", small),
            Kind("15 to 35 mm", all_sizes), Kind("5 to 30 mm", (0.005, 0.03)), Kind("size 15 %", size=0.15),
            Kind("15 to 35 mm, 2.5 to 3.5 m/s", all_sizes, (2.5, 3.5)), Kind("15 to 35 mm, 2 to 4 m/s", all_sizes, any_speed),
            Kind("coal does not break, any speed", speed_m_s=any_speed, whole=True), Kind("coal does not break", whole=True),
            Kind("coal 15 % faster", coal_speed=1.15), Kind("coal 30 % faster", coal_speed=1.3),
            Kind("gangue 15 % faster", coal_speed=1 / 1.15), Kind("lumps of 100 mm", lumps=0.05),
            Kind("stiffness 10 %", stiffness=0.1), Kind("stiffness 20 %", stiffness=0.2), Kind("stiffness 30 %", stiffness=0.3),
            Kind("restitution 0.6 to 0.9", restitution=(0.6, 0.9)), Kind("restitution 0.5", restitution=(0.5, 0.5)),
            Kind("density 5 %", density=0.05), Kind("corners", corners=True), Kind("double hits", none=0.1),
            Kind("fragments", none=0.25), Kind("natural", speed_m_s=(2.75, 3.25), stiffness=0.2, density=0.05, size=0.15,
                                               restitution=(0.6, 0.9)),
            Kind("natural, corners", speed_m_s=(2.75, 3.25), stiffness=0.2, density=0.05, size=0.1, corners=True,
                 restitution=(0.6, 0.9)),
            Kind("10 dB", error=3.0), Kind("machine", error=1.5), Kind("coal alone", gangue=(0.0, 0.0)),
            Kind("gangue alone", gangue=(1.0, 1.0))]


@cache
def pool() -> pd.DataFrame:
    """What an ear without error hears of stones, brought to 25 mm and 1 m/s."""
    form, rows = load_forces().form, []
    for h in (one for name in SETS for one in histories(name)):
        x = heard_of(h, form) - hertz(h.radius_m / 0.025, h.speed_m_s)
        rows.append({"gangue": h.gangue, "speed_m_s": h.speed_m_s, "s": x[0], "b": x[1], "J": x[2]})
    return pd.DataFrame(rows)


def hertz(size: Floats | float, speed: Floats | float) -> Floats:
    """(..., 3): what size and speed, relative, make of log s, b and log J."""
    size, speed = np.log(size), np.log(speed)
    return np.stack([size - 0.2 * speed, 0 * (size + speed), 3 * size + speed], axis=-1)


def stones(kind: Kind, gangue: np.ndarray, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """What is heard (n, 3) of stones, and their masses, relative."""
    n = len(gangue)
    size = rng.uniform(*kind.radius_m, n) / 0.025 * np.exp(kind.size * rng.standard_normal(n))
    size = np.where(rng.random(n) < kind.lumps, 4.0, size)
    speed = rng.uniform(*kind.speed_m_s, n) * np.where(gangue, 1.0, kind.coal_speed)
    among = pool()
    every = among[["s", "b", "J"]].to_numpy()
    alike = among["gangue"].to_numpy() == gangue[:, None]
    alike &= (abs(among["speed_m_s"].to_numpy() - speed[:, None]) < 0.5) & ((every[:, 1] < 1.0) | (not kind.whole))
    there = alike.sum(axis=1)  # those of one material that fall about as fast: one of them
    x = every[np.nonzero(alike)[1][np.cumsum(there) - there + rng.integers(0, there)]]
    density, stiffness = (d * rng.standard_normal(n) for d in (kind.density, kind.stiffness))
    rebound = np.log((1 + rng.uniform(*kind.restitution, n)) / 1.9)
    x += hertz(size, speed)
    x[:, 0] += 0.4 * (density - stiffness) - 0.6 * rebound
    x[:, 2] += density + rebound
    if kind.corners:
        x[:, 0] -= 0.2 * np.log(rng.uniform(0.2, 1.0, n))
        x[:, 2] += np.log(rng.uniform(0.7, 1.0, n))
    x += kind.error * ERROR * rng.standard_normal((n, 3))
    mass = np.where(gangue, 2400.0, 1380.0) * np.exp(density) * size**3
    return x, mass


@dataclass(frozen=True)
class Fallen:
    """What is heard of a stream, known stones first, the error of that (3, 3), and which stones of all were gangue."""

    x: Floats
    error: Floats
    known: NDArray[np.int64]
    dropped: NDArray[np.bool_]
    gangue: NDArray[np.bool_]


def fallen(kind: Kind, seed: int, reference: str) -> Fallen:
    """A stream of STONES, after stones that one knows."""
    rng = np.random.default_rng([29, [k.name for k in kinds()].index(kind.name), seed])
    gangue = rng.random(STONES) < rng.uniform(*kind.gangue)
    x, _ = stones(kind, gangue, rng)
    heard = rng.random(STONES) < np.exp(x[:, 2]) / LOST_BELOW_N_s
    other = rng.random(STONES) < kind.none  # second touches and fragments: weaker, of another form
    spurious = x[other] + [-0.5, 1.0, -1.5] + rng.standard_normal((other.sum(), 3)) * [0.3, 1.5, 0.8]
    of = REFERENCES[reference]
    before = np.arange(of.coal + of.gangue) >= of.coal  # as one is told
    true = np.where(np.arange(len(before)) < of.wrong, ~before, before)
    falls = replace(kind, speed_m_s=(of.faster * kind.speed_m_s[0], of.faster * kind.speed_m_s[1]))
    every = np.vstack([stones(falls, true, rng)[0], x[heard], spurious])
    unknown = np.full(len(every) - len(before), UNKNOWN)
    return Fallen(every, np.diag((kind.error * ERROR) ** 2), np.r_[before.astype(int), unknown],
                  np.r_[np.full(len(before), of.dropped), unknown > 0], gangue)


def answered(kind: Kind, seed: int, reference: str) -> dict[str, object]:
    """The answer to a stream, in per cent of gangue, and the share of what was heard that is taken for no stone."""
    fell = fallen(kind, seed, reference)
    prior = StonePrior(load_forces(), kind.told_m or kind.radius_m, kind.told_m_s or kind.speed_m_s)
    told = Told(fell.x, np.tile(fell.error, (len(fell.x), 1, 1)), fell.known, fell.dropped)
    found = LearntLaw.of(told, prior)
    odds, none = found.materials(told)
    chosen = (fell.known == UNKNOWN) & (none < 0.5)
    table = pd.DataFrame(doubted(odds[chosen], LEAST_DOUBT)).add_prefix(BY_LAW).assign(t_s=0.05 * np.arange(chosen.sum()))
    low, said, high = (100 * v for v in ratio_of(table))
    return {"right": 100 * float(fell.gangue.mean()), "low": low, "said": said, "high": high,
            "none": float(none[fell.known == UNKNOWN].mean()), "worth": found.worth}


def stone_kinds(out: Path, seeds: int = SEEDS) -> Iterator[Row]:
    """Each kind, with all references that there may be."""
    for seed, kind, reference in product(range(seeds), kinds(), REFERENCES):
        yield Row({"kind": kind.name, "reference": reference, "seed": seed}, partial(answered, kind, seed, reference))


def stone_kinds_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Of each reference and kind, and all kinds: errors in points of the streams that were answered."""
    whole = [rows.assign(kind="all"), rows]
    return pd.DataFrame([{"reference": reference, "kind": kind} | _told_of(own) for part in whole
                         for (reference, kind), own in part.groupby(["reference", "kind"], sort=False)])


def _told_of(rows: pd.DataFrame) -> dict[str, object]:
    off = (rows["said"] - rows["right"]).abs()
    answer = ~((rows["high"] - rows["said"]).clip(lower=rows["said"] - rows["low"]) > REACH)
    inside = (rows["low"] <= rows["right"] + 1e-9) & (rows["right"] <= rows["high"] + 1e-9)
    return {"streams": len(rows), "answered": int(answer.sum()), "mean": off[answer].mean(), "largest": off[answer].max(),
            "inside_percent": 100 * inside.mean(), "silently_wrong": int((answer & (off > SILENT)).sum()),
            "mean_of_all": off.mean()}
