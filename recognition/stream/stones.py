"""The list of stones that were heard, and the mixing ratio in a window that slides over it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from recognition.estimation.arrays import Floats
from recognition.innovations.bank import DURATION, IMPULSE, TIME, X, Y
from recognition.stream.listen import Heard
from recognition.stream.prior import StonePrior

DRAWS, SHARES = 1000, 200  # of the ratio; nodes of the share of gangue in its posterior
LEVELS = (0.05, 0.5, 0.95)
#: Two stones within this time are heard as one (docs/listening.md); the largest share that is ever missed so.
DEAD_S, MOST_MISSED = 0.2e-3, 0.5


def stone_table(heard: Sequence[Heard], log_odds: Floats, prior: StonePrior, rate_Hz: float,
                least_doubt: float) -> pd.DataFrame:
    """One row for each stone, in order of arrival: first touch t_s, place, probability of gangue, mean and standard
    deviation of mass, radius and speed over both materials, and the probability of gangue by each law of the speeds.

    log_odds (stones, laws): of gangue, by laws that are equally likely. least_doubt: no material is surer than
    1 - least_doubt, the share of stones whose material is wrong in a stream of known truth.
    """
    rows = [_row(h, prior, rate_Hz, least_doubt) for h in heard]
    by_law = pd.DataFrame(_doubted(log_odds, least_doubt)).rename(columns=lambda k: f"{BY_LAW}{k + 1}")
    return pd.concat([pd.DataFrame(rows, columns=COLUMNS), by_law], axis=1).sort_values("t_s", ignore_index=True)


COLUMNS = ["t_s", "t_sd_s", "x_m", "y_m", "place_sd_m", "gangue", "impulse_N_s", "duration_s", "radius_m",
           "radius_sd_m", "speed_m_s", "speed_sd_m_s", "mass_coal_kg", "mass_gangue_kg", "mass_coal_sd_kg",
           "mass_gangue_sd_kg", "misfit"]
BY_LAW = "gangue_by_law_"  # of the columns after these, one for each law of the speeds


def _row(h: Heard, prior: StonePrior, rate_Hz: float, least_doubt: float) -> list[float]:
    odds = h.log_evidence[1] - h.log_evidence[0]  # of one stone alone: either material is as likely beforehand
    gangue = float(_doubted(odds, least_doubt))
    m = int(gangue > 0.5)
    stone, cov = h.stone, h.covariance
    t_s = stone[TIME] / rate_Hz - prior.forces.start[m] * np.exp(stone[DURATION])
    share = np.array([1 - gangue, gangue])
    size = [prior.grid[:, k] for k in (0, 1)]
    (radius, radius_sd), (speed, speed_sd) = (_moments(share, h.weights, (v, v)) for v in size)
    mass = [4 / 3 * np.pi * size[0] ** 3 * density for density in prior.forces.density_kg_m3]
    (coal, coal_sd), (rock, rock_sd) = (_moments(np.array([1.0]), (h.weights[k],), (mass[k],)) for k in (0, 1))
    return [t_s, np.sqrt(cov[TIME, TIME]) / rate_Hz, stone[X], stone[Y], np.sqrt((cov[X, X] + cov[Y, Y]) / 2), gangue,
            np.exp(stone[IMPULSE]), np.exp(stone[DURATION]), radius, radius_sd, speed, speed_sd, coal, rock, coal_sd,
            rock_sd, h.misfit]


def _doubted(log_odds: Floats, least_doubt: float) -> Floats:
    """Probabilities of any log odds."""
    return np.asarray(least_doubt + (1 - 2 * least_doubt) / (1 + np.exp(-np.clip(log_odds, -50, 50))))


def _moments(share: Floats, weights: Sequence[Floats] | Floats, values: Sequence[Floats]) -> tuple[float, float]:
    mean = sum(s * float(w @ v) for s, w, v in zip(share, weights, values, strict=True))
    square = sum(s * float(w @ v**2) for s, w, v in zip(share, weights, values, strict=True))
    return mean, float(np.sqrt(max(square - mean**2, 0.0)))


def ratio_of(stones: pd.DataFrame, by_mass: bool = False) -> tuple[float, float, float]:
    """Low end, median and high end of the 90 % interval of the mixing ratio of some stones, NaN for none.

    Each stone is gangue with a probability p that is the same for all and unknown, uniform beforehand. Its posterior
    follows from all stones; were it taken as 1/2, stones of uncertain material would pull the ratio there. The law of
    the speeds is unknown too: each of some has its columns, without any only "gangue" counts. Of two stones that
    arrive almost at once one is missed, which is gangue with p too. The distribution is drawn from, always with the
    same seed.
    """
    if len(stones) == 0:
        return (np.nan, np.nan, np.nan)
    rng = np.random.default_rng(1)
    by_law = [name for name in stones.columns if name.startswith(BY_LAW)]
    one = stones[by_law or ["gangue"]].to_numpy()
    law = np.arange(DRAWS) % one.shape[1]
    p = _drawn_share(one, rng)[law, np.arange(DRAWS)]
    one = one.T[law]  # (DRAWS, n)
    of_gangue, of_coal = p[:, None] * one, (1 - p[:, None]) * (1 - one)
    gangue = rng.random(of_gangue.shape) * (of_gangue + of_coal) < of_gangue
    weight = np.ones_like(gangue, dtype=float)
    if by_mass:
        mean = np.where(gangue, stones["mass_gangue_kg"].to_numpy(), stones["mass_coal_kg"].to_numpy())
        sd = np.where(gangue, stones["mass_gangue_sd_kg"].to_numpy(), stones["mass_coal_sd_kg"].to_numpy())
        shape = np.log1p((sd / mean) ** 2)  # log-normal of that mean and deviation
        weight = mean * np.exp(np.sqrt(shape) * rng.standard_normal(mean.shape) - shape / 2)
    missed = rng.poisson(missed_of(stones), DRAWS)
    missed_gangue = rng.binomial(missed, p)
    gangue_weight = _with_missed(weight, gangue, missed_gangue)
    share = gangue_weight / (gangue_weight + _with_missed(weight, ~gangue, missed - missed_gangue))
    low, middle, high = np.quantile(share, LEVELS)
    return float(low), float(middle), float(high)


def _drawn_share(one: Floats, rng: np.random.Generator) -> Floats:
    """(laws, DRAWS): shares p of gangue, from their posterior by stones whose probabilities are `one` (n, laws) with
    p = 1/2."""
    p = (np.arange(SHARES) + 0.5) / SHARES
    log = np.log(p[:, None, None] * one + (1 - p[:, None, None]) * (1 - one)).sum(axis=1)
    weight = np.exp(log - log.max(axis=0))
    drawn = [rng.choice(p, DRAWS, p=w / w.sum()) for w in weight.T]
    return np.asarray(drawn) + (rng.random((one.shape[1], DRAWS)) - 0.5) / SHARES


def _with_missed(weight: Floats, chosen: NDArray[np.bool_], missed: NDArray[np.int64]) -> Floats:
    """(draws,): weight of the chosen stones (draws, n) and of those that were missed, which weigh as much as the chosen
    ones do in the mean, or as all do where none is chosen."""
    count, total = chosen.sum(axis=1), (weight * chosen).sum(axis=1)
    each = np.where(count > 0, total / np.maximum(count, 1), weight.mean(axis=1))
    return np.asarray(total + missed * each, dtype=float)


def missed_of(stones: pd.DataFrame) -> float:
    """How many stones are missed, by the rate of those that were heard one by one."""
    if len(stones) < 2:
        return 0.0
    span_s = float(stones["t_s"].max() - stones["t_s"].min())
    return len(stones) * min(DEAD_S * (len(stones) - 1) / max(span_s, 1e-9), MOST_MISSED)


def sliding_ratio(stones: pd.DataFrame, window_s: float, step_s: float, end_s: float) -> pd.DataFrame:
    """The ratio by number and by mass of the stones of the last window_s, every step_s up to end_s."""
    rows = []
    for t_s in np.arange(step_s, end_s + step_s / 2, step_s):
        inside = stones[(stones["t_s"] > t_s - window_s) & (stones["t_s"] <= t_s)]
        rows.append([t_s, len(inside), *ratio_of(inside), *ratio_of(inside, by_mass=True)])
    names = ["t_s", "stones", "low", "ratio", "high", "mass_low", "mass_ratio", "mass_high"]
    return pd.DataFrame(np.reshape(rows, (-1, len(names))), columns=names).astype({"stones": int})  # numbers, if no row
