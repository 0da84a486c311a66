"""The list of stones that were heard, and the mixing ratio in a window that slides over it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from recognition.estimation.arrays import Floats
from recognition.innovations.bank import DURATION, IMPULSE, PARAMETERS, TIME, X, Y
from recognition.innovations.prior import TRIPLE, StonePrior
from recognition.stream.decision import Followed, Stop, follow
from recognition.stream.listen import Heard
from recognition.stream.stone_law import MASS, UNKNOWN, Integers, LearntLaw, Told

AT_ONCE, DRAWS, SHARES = 16, 1000, 200  # stones; of the ratio; nodes of the share of gangue in its posterior
LEVELS = (0.05, 0.5, 0.95)
#: Two stones within this time are heard as one (docs/listening.md); the largest share that is ever missed so.
DEAD_S, MOST_MISSED = 0.2e-3, 0.5
AGAIN = 0.5  # of the stones that come down slower have touched before, in any stream; others struck one in the air
#: Missed stones: of touches that are none by the law, and, by those that come down slower, of others too weak to hear.
UNLIKE, LOST = 0.5, 0.07
#: Odds of gangue of a missed stone over those of all: coal is lighter and softer, and the weaker of two is lost. In 43
#: streams of the engine 94 stones were missed, of them 17 of gangue and not 34; with 95 % from 0.16 to 0.52.
MISSED_ODDS = 0.3
AGAIN_SAMPLES, AGAIN_M = 20, 0.05  # within which a weaker touch is of the same stone


@dataclass(frozen=True)
class Known:
    """Stones whose material one knows: the first of a record, which are coal, and those of other records, with their
    material, 0 coal and 1 gangue, and whether they fell as those of the record do."""

    coal_first: int = 0
    others: Sequence[tuple[Sequence[Heard], int, bool]] = ()

    def beside(self, own: Sequence[Heard], hearing: StonePrior) -> tuple[list[Heard], Told]:
        """Stones of a record, then those of others, and what is told of them all."""
        others = [(h, m, alike) for stones, m, alike in self.others for h in first_touches(stones)]
        every, first = [*own, *(h for h, _, _ in others)], np.arange(len(own)) < self.coal_first
        material = np.r_[np.where(first, 0, UNKNOWN), [m for _, m, _ in others]].astype(int)
        return every, told_of(every, hearing, material, np.r_[0 * first, [not alike for *_, alike in others]] > 0)


UNKNOWN_ALL = Known()
NONE_KNOWN = "WARNING: no stone is known (--coal-first, --known); the ratio may be far off, outside its interval"
BEYOND = 1.1  # the radii of a law's histories: how a form changes with size is not told farther out


def cautions(known: Known, prior: StonePrior) -> tuple[str, ...]:
    """Why a ratio may be off that seems sure."""
    (small, large), (least, most) = prior.radius_m, prior.forces.radius_m
    sizes = (f"WARNING: --radius {small:g} {large:g} goes beyond the stones of the law, {least:.3g} to {most:.3g} m; "
             "the ratio may be off, outside its interval (a law of such stones: learn-forces)")
    beyond = small * BEYOND < least or large > most * BEYOND
    return tuple(text for text, holds in ((NONE_KNOWN, known == UNKNOWN_ALL), (sizes, beyond)) if holds)


def learnt_table(heard: Sequence[Heard], hearing: StonePrior, prior: StonePrior, known: Known, rate_Hz: float,
                 least_doubt: float, stop: Stop | None = None) -> tuple[pd.DataFrame, dict[str, Any], Followed | None]:
    """One row for each stone that is not known, in order of arrival: first touch t_s, place, probability of gangue by
    all laws of their forces and by each, mean and standard deviation of radius and speed, and of mass as either
    material; where one asks when to `stop`, the sum of the test and its alarms. And what `Checks` has of the law.

    hearing: the prior of the fits; prior: what is told of the stones. least_doubt: no material is surer than
    1 - least_doubt, the share of stones whose material is wrong in a stream of known truth.
    """
    own = first_touches(sorted(heard, key=lambda h: h.stone[TIME]))
    if not own:
        return pd.DataFrame(columns=COLUMNS), {}, None
    every, told = known.beside(own, hearing)
    law = LearntLaw.of(told, prior, rate_of(np.array([h.stone[TIME] for h in own]) / rate_Hz))
    by_law, none = law.probabilities(told, least_doubt)
    unknown = told.known == UNKNOWN
    chosen = np.flatnonzero(unknown & (none < 0.5))
    table = rows_of([every[k] for k in chosen], told.only(chosen), law, prior, by_law[chosen],
                    none[unknown] >= 0.5, rate_Hz)
    count = len(heard) - known.coal_first
    checks = {"none": 1 - len(chosen) / count if count > 0 else 0.0, "beyond": law.beyond,
              "misplaced": law.misplaced(told) / max(np.sum(~unknown), 1)}
    followed = None
    if stop is not None and unknown.any():
        followed = follow(told, np.array([h.stone[TIME] for h in every]) / rate_Hz, prior, stop, least_doubt)
        at = np.cumsum(unknown)[chosen] - 1
        table = table.assign(stop=followed.sum[at], alarm=followed.alarm[at])
    return table, checks, followed


def told_of(heard: Sequence[Heard], hearing: StonePrior, material: Integers, dropped: NDArray[np.bool_]) -> Told:
    """What was heard of the forces of stones, of which materials are known or not."""
    triples = np.array([h.stone[TRIPLE] for h in heard]).reshape(-1, 3)
    errors = np.array([h.covariance[np.ix_(TRIPLE, TRIPLE)] for h in heard]).reshape(-1, 3, 3)
    return Told.of(triples, errors, hearing, material, dropped)


def first_touches(heard: Sequence[Heard], before: Sequence[Heard] = ()) -> list[Heard]:
    """Stones in order of arrival without those that touch again: a stone that turns strikes the plate twice. before:
    those that came last."""
    found = list(before)
    for h in heard:
        again = any(h.stone[TIME] - one.stone[TIME] < AGAIN_SAMPLES and h.stone[IMPULSE] < one.stone[IMPULSE]
                    and np.hypot(*(h.stone[X:Y + 1] - one.stone[X:Y + 1])) < AGAIN_M for one in found[-4:])
        found += [] if again else [h]
    return found[len(before):]


COLUMNS = ["t_s", "t_sd_s", "x_m", "y_m", "place_sd_m", "gangue", "impulse_N_s", "duration_s", "radius_m",
           "radius_sd_m", "speed_m_s", "speed_sd_m_s", "mass_coal_kg", "mass_gangue_kg", "mass_coal_sd_kg",
           "mass_gangue_sd_kg", "again", "misfit", "unlike"]
BY_LAW = "gangue_by_law_"  # of the columns after these, one for each law


def rows_of(heard: Sequence[Heard], told: Told, law: LearntLaw, prior: StonePrior, by_law: Floats,
            none: NDArray[np.bool_], rate_Hz: float) -> pd.DataFrame:
    """A row of COLUMNS for each stone, and by_law (n, laws). none: which touches about then are none by the law."""
    gangue = by_law.mean(axis=1)
    radius, speed = np.exp(np.log(prior.grid).mean(axis=0))
    stone, covariance = np.array([h.stone for h in heard]), np.array([h.covariance for h in heard])
    stone, covariance = stone.reshape(-1, PARAMETERS), covariance.reshape(-1, PARAMETERS, PARAMETERS)
    of = [law.made_of(told, m) for m in (0, 1)]
    likely = (gangue > 0.5).astype(int)
    off, cov = (np.where(likely.reshape(-1, *[1] * (a.ndim - 1)), b, a) for a, b in zip(*of, strict=True))
    r, v = radius * np.exp(off[:, 0]), speed * np.exp(off[:, 1])
    mass = [4 / 3 * np.pi * radius**3 * density * np.exp(o @ MASS) for density, (o, _) in
            zip(prior.forces.density_kg_m3, of, strict=True)]
    mass_sd = [m * np.sqrt(MASS @ c @ MASS) for m, (_, c) in zip(mass, of, strict=True)]
    duration = np.exp(stone[:, DURATION])
    columns = (
        stone[:, TIME] / rate_Hz - prior.forces.start[likely] * duration, np.sqrt(covariance[:, TIME, TIME]) / rate_Hz,
        stone[:, X], stone[:, Y], np.sqrt((covariance[:, X, X] + covariance[:, Y, Y]) / 2), gangue,
        np.exp(stone[:, IMPULSE]), duration, r, r * np.sqrt(cov[:, 0, 0]), v, v * np.sqrt(cov[:, 1, 1]), *mass,
        *mass_sd, AGAIN * law.slowed(told), np.array([h.misfit for h in heard]),
        np.full(len(heard), none.sum() / max(np.sum(~none), 1)))
    names = [*COLUMNS, *(f"{BY_LAW}{k}" for k in range(by_law.shape[1]))]
    return pd.DataFrame(np.column_stack([*columns, by_law]), columns=names)


def ratio_of(stones: pd.DataFrame, by_mass: bool = False) -> tuple[float, float, float]:
    """One of `ratios_of`."""
    return ratios_of(stones)[by_mass]


def ratios_of(stones: pd.DataFrame) -> tuple[tuple[float, float, float], ...]:
    """Low end, median and high end of the 90 % interval of the mixing ratio of some stones, NaN for none, by number
    and, where masses are told, by mass.

    Each stone is gangue with a probability p that is the same for all and unknown, uniform beforehand. Its posterior
    follows from all stones; were it taken as 1/2, stones of uncertain material would pull the ratio there. The law of
    the forces is unknown too: each of some has its column, without any only "gangue" counts. A stone that may have
    touched before (column "again") counts in as many draws less. Stones that are missed are gangue by MISSED_ODDS.
    The distribution is drawn from, always with the same seed.
    """
    if len(stones) == 0:
        return ((np.nan, np.nan, np.nan),) * 2
    rng = np.random.default_rng(1)
    by_law = [name for name in stones.columns if name.startswith(BY_LAW)]
    one = stones[by_law or ["gangue"]].to_numpy()
    law = np.arange(DRAWS) % one.shape[1]
    p = _drawn_share(one, law, rng)
    one = one.T[law]  # (DRAWS, n)
    of_gangue, of_coal = p[:, None] * one, (1 - p[:, None]) * (1 - one)
    gangue = rng.random(of_gangue.shape) * (of_gangue + of_coal) < of_gangue
    missed = rng.poisson(missed_of(stones), DRAWS)
    missed_gangue = rng.binomial(missed, MISSED_ODDS * p / (MISSED_ODDS * p + 1 - p))
    first = np.asarray(rng.random(gangue.shape) >= stones.get("again", pd.Series(0.0, stones.index)).to_numpy(), float)
    first[first.sum(axis=1) == 0] = 1.0
    weights = [first]
    if "mass_coal_kg" in stones:
        mean = np.where(gangue, stones["mass_gangue_kg"].to_numpy(), stones["mass_coal_kg"].to_numpy())
        sd = np.where(gangue, stones["mass_gangue_sd_kg"].to_numpy(), stones["mass_coal_sd_kg"].to_numpy())
        shape = np.log1p((sd / mean) ** 2)  # log-normal of that mean and deviation
        weights.append(first * mean * np.exp(np.sqrt(shape) * rng.standard_normal(mean.shape) - shape / 2))
    found = []
    for weight in weights:
        gangue_weight = _with_missed(weight, gangue, missed_gangue)
        share = gangue_weight / (gangue_weight + _with_missed(weight, ~gangue, missed - missed_gangue))
        low, middle, high = np.quantile(share, LEVELS)
        found.append((float(low), float(middle), float(high)))
    return tuple(found)


def _drawn_share(one: Floats, law: Integers, rng: np.random.Generator) -> Floats:
    """(draws,): of each law (draws,) a share p of gangue, from its posterior by stones whose probabilities are `one`
    (n, laws) with p = 1/2."""
    p = (np.arange(SHARES) + 0.5) / SHARES
    log = np.zeros((SHARES, one.shape[1]))
    for k in range(0, len(one), AT_ONCE):  # whose product is a number
        log += np.log(np.prod(p[:, None, None] * (2 * one[k:k + AT_ONCE] - 1) + 1 - one[k:k + AT_ONCE], axis=1))
    below = np.cumsum(np.exp(log - log.max(axis=0)), axis=0)
    drawn = np.sum((below / below[-1])[:, law] < rng.random(len(law)), axis=0)
    return np.asarray((drawn + rng.random(len(law))) / SHARES)


def _with_missed(weight: Floats, chosen: NDArray[np.bool_], missed: NDArray[np.int64]) -> Floats:
    """(draws,): weight of the chosen stones (draws, n) and of those that were missed, which weigh as much as the chosen
    ones do in the mean, or as all do where none is chosen."""
    count, total = chosen.sum(axis=1), (weight * chosen).sum(axis=1)
    each = np.where(count > 0, total / np.maximum(count, 1), weight.mean(axis=1))
    return np.asarray(total + missed * each, dtype=float)


def missed_of(stones: pd.DataFrame) -> float:
    """How many stones are missed: one of two that arrive almost at once, by the rate of those that were heard one by
    one, some that met others, by those that came down slower, and some of the touches that are none by the law."""
    together = len(stones) * min(DEAD_S * rate_of(stones["t_s"].to_numpy()), MOST_MISSED)
    return together + float(np.sum(LOST / AGAIN * stones.get("again", 0.0) + UNLIKE * stones.get("unlike", 0.0)))


def rate_of(t_s: Floats) -> float:
    """Stones a second, of those that arrive at t_s (n,)."""
    return (len(t_s) - 1) / max(float(np.ptp(t_s)), 1e-9) if len(t_s) > 1 else 0.0


def sliding_ratio(stones: pd.DataFrame, window_s: float, step_s: float, end_s: float) -> pd.DataFrame:
    """The ratio by number and by mass of the stones of the last window_s, every step_s up to end_s."""
    rows: list[list[float]] = []
    for t_s in np.arange(step_s, end_s + step_s / 2, step_s):
        inside = stones[(stones["t_s"] > t_s - window_s) & (stones["t_s"] <= t_s)]
        rows.append([t_s, len(inside), *np.ravel(ratios_of(inside))])
    names = ["t_s", "stones", "low", "ratio", "high", "mass_low", "mass_ratio", "mass_high"]
    return pd.DataFrame(np.reshape(rows, (-1, len(names))), columns=names).astype({"stones": int})  # numbers, if no row
