"""How far the ratio of stones of unknown size and speed is off, where the law of their forces is right and their speeds
are uniform or not.

Stones of 15 to 35 mm and 2 to 4 m/s are drawn from the law of forces, and measured with errors of 2 %. The logarithm of
the density of their speeds is t x + c (x^2 - 1/3), x from -1 to 1 between the limits; coal and gangue have one density.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from lab.streams.known_streams import SIZES_m, SPEEDS_m_s, heard_as, true_ratio
from lab.study import Row
from recognition.estimation.arrays import Floats
from recognition.stone_forces.law_file import load_forces
from recognition.stream.listen import Heard
from recognition.stream.prior import StonePrior
from recognition.stream.recognise import LEAST_DOUBT, RATE_Hz
from recognition.stream.speed_law import with_speed_laws
from recognition.stream.stones import ratio_of, stone_table

STORED, ERRORS = 3000, np.diag([0.02, np.sqrt(0.1), 0.02]) ** 2
#: t, c, streams and stones of each.
CASES = [(0.0, 0.0, 40, 100), (1.0, 0.0, 40, 100), (-1.0, 0.0, 40, 100), (0.0, 2.0, 40, 100), (0.0, -2.0, 40, 100)]
ANY = [(100, 100), (40, 400)]  # streams and stones, with t and c drawn anew for each stream


class Store:
    """STORED stones of each material, of which streams are drawn, and what a fit makes of them."""

    def __init__(self, prior: StonePrior) -> None:
        rng = np.random.default_rng(77)
        self.prior, self.stones, self.rows = prior, [], []
        for gangue in (False, True):
            radius, speed = rng.uniform(*SIZES_m, STORED), rng.uniform(*SPEEDS_m_s, STORED)
            self.stones.append([drawn(prior, gangue, r, v, rng) for r, v in zip(radius, speed, strict=True)])
            mass = 4 / 3 * np.pi * radius**3 * prior.forces.density_kg_m3[int(gangue)]
            self.rows.append(pd.DataFrame({"gangue": gangue, "mass_kg": mass, "x": speed - np.mean(SPEEDS_m_s)}))

    def stream(self, t: float, c: float, count: int, rng: np.random.Generator) -> dict[str, float]:
        """Errors of the answer to a stream in points, and whether its intervals hold."""
        gangue = rng.random(count) < rng.uniform(0.2, 0.8)
        which = [rng.choice(STORED, p=self._weight(int(g), t, c)) for g in gangue]
        heard = [self.stones[int(g)][k] for g, k in zip(gangue, which, strict=True)]
        truth = pd.DataFrame([self.rows[int(g)].iloc[k] for g, k in zip(gangue, which, strict=True)])
        table = stone_table(*with_speed_laws(heard, self.prior), self.prior, RATE_Hz, LEAST_DOUBT)
        table["t_s"] = 0.02 * np.arange(count)
        row: dict[str, float] = {}
        for name, by_mass in (("number", False), ("mass", True)):
            low, middle, high = ratio_of(table, by_mass)
            right = true_ratio(truth.astype(float), by_mass)
            row |= {f"{name}_error": 100 * (middle - right), f"{name}_inside": float(low <= right <= high)}
        return row

    def _weight(self, material: int, t: float, c: float) -> Floats:
        x = self.rows[material]["x"].to_numpy()
        weight = np.exp(t * x + c * (x**2 - 1 / 3))
        return np.asarray(weight / weight.sum())


def drawn(prior: StonePrior, gangue: bool, radius_m: float, speed_m_s: float, rng: np.random.Generator) -> Heard:
    """A stone that follows the law of forces, as it is measured."""
    law, m = prior.forces, int(gangue)
    broken = rng.random() < law.share_at(m, np.array(speed_m_s))
    mean, scatter = (law.broken_mean, law.broken_scatter) if broken else (law.mean, law.scatter[m])
    triple = rng.multivariate_normal(mean(m, np.array(radius_m), np.array(speed_m_s)), scatter + ERRORS)
    return heard_as(triple, ERRORS, prior)


def speed_laws(out: Path) -> Iterator[Row]:
    """Each of CASES, and laws that are drawn anew for each stream."""
    store = cache(lambda: Store(StonePrior(load_forces(), SIZES_m, SPEEDS_m_s)))

    def of_one(t: float, c: float, streams: int, count: int) -> dict[str, float]:
        rng = np.random.default_rng([6, 1])
        return told([store().stream(t, c, count, rng) for _ in range(streams)])

    def of_any(drawn: list[tuple[float, float]], count: int) -> dict[str, float]:
        return told([store().stream(t, c, count, np.random.default_rng([6, count + k]))
                     for k, (t, c) in enumerate(drawn)])

    for t, c, streams, count in CASES:
        yield Row({"law": f"t = {t:g}, c = {c:g}", "stones": count}, partial(of_one, t, c, streams, count))
    laws = np.random.default_rng(11)
    for streams, count in ANY:
        drawn = [(laws.normal(), laws.normal()) for _ in range(streams)]
        yield Row({"law": "any t and c", "stones": count}, partial(of_any, drawn, count))


def told(rows: list[dict[str, float]]) -> dict[str, float]:
    """Mean and 95th percentile of the sizes of the errors, points, and how often intervals hold, %."""
    table, found = pd.DataFrame(rows), {"streams": float(len(rows))}
    for name in ("number", "mass"):
        size = table[f"{name}_error"].abs()
        found |= {f"{name}_mean": float(size.mean()), f"{name}_95": float(size.quantile(0.95)),
                  f"{name}_inside_percent": 100 * float(table[f"{name}_inside"].mean())}
    return found
