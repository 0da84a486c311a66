"""Fit of `recognition.physics.arrangement_likelihood` from simulated runs; needs the simulation's plate model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sklearn.model_selection import GroupKFold

from recognition.errors import RecognitionError
from recognition.physics.arrangement_likelihood import MOST_STONES, StoneNumbers, strangeness
from recognition.physics.force_records import Lesson, pushed, response
from recognition.regression.conformal import LEAST_GROUPS, STRANGE_FACTOR, USUAL_SHARE, conformal_quantile

BIN_S = 25e-6  # of forces, linear between bins, about
DEGREE = 2  # of the force in the speed
#: A covariance of few stones is drawn to one of forces independent from bin to bin, as if so many stones more had shown it.
MORE_STONES = 20
LEAST_DEVIATION = 0.02  # of a force at any time, in shares of its largest
LEAST_REST = 0.005  # of the plate's model, in shares of the signal
LEAST_STONES = 5  # different ones, of either material
FOLDS = 5
SMALL_M = 1e-3  # to find how an answer changes with the place


def same_places(lessons: Sequence[Lesson | None]) -> np.ndarray:
    """Numbers of the runs whose stones fall at once and on the places that most have. RecognitionError if they are few."""
    places = {k: lesson.place_m.round(6).tobytes() for k, lesson in enumerate(lessons) if lesson is not None and lesson.at_once}
    keys = list(places.values())
    most = max(keys, key=keys.count, default=b"")
    chosen = np.array([k for k, place in places.items() if place == most], dtype=int)
    if len(chosen) < LEAST_GROUPS:
        raise RecognitionError(f"{len(chosen)} runs whose stones fall at once and on the same places; needs {LEAST_GROUPS}")
    stones = len(most) // (2 * np.dtype(float).itemsize)
    if stones > MOST_STONES:
        raise RecognitionError(f"{stones} stones; at most {MOST_STONES}")
    return chosen


@dataclass(frozen=True)
class Learnt:
    """Of simulated stones: laws of the force of coal and of gangue and their covariance (`force_law`), from so many different
    stones, in bins (rows, bins); at (samples,): steps at which records have samples; scale, rest: as `StoneNumbers`;
    damping_ratio: mean and standard deviation; speed_m_s: mean, least, greatest."""

    laws: list[np.ndarray]
    covariance: np.ndarray
    stones: int
    bins: np.ndarray
    at: np.ndarray
    scale: np.ndarray
    rest: np.ndarray
    damping_ratio: tuple[float, float]
    speed_m_s: tuple[float, float, float]


def learn(X: np.ndarray, lessons: Sequence[Lesson | None], groups: np.ndarray) -> tuple[Learnt, Lesson]:
    """X (runs, channels, samples + 1), lessons and groups of the same runs; and one of the lessons taken."""
    chosen = same_places(lessons)
    taught = [lessons[k] for k in chosen]
    speed = np.array([lesson.speed_m_s for lesson in taught])
    damping = np.array([lesson.plate.damping_ratio for lesson in taught])
    scale = np.sqrt(np.mean(X[chosen, :, :-1] ** 2, axis=(0, 2)))
    at = np.arange(X.shape[2] - 1) * round(taught[0].sample_s / taught[0].step_s)
    bins = force_bins(taught[0], at[-1] + 1)
    laws, covariance, stones = learnt_forces(taught, bins, groups[chosen], float(speed.mean()))
    left = [X[k, :, :-1] - lesson.told[:, at] for k, lesson in zip(chosen, taught, strict=True)]
    rest = np.sqrt(np.mean(np.square(left), axis=(0, 2))) / scale
    return Learnt(laws, covariance, stones, bins, at, scale, np.hypot(rest, LEAST_REST), (damping.mean(), damping.std()),
                  (float(speed.mean()), float(speed.min()), float(speed.max()))), taught[0]


def fit_numbers(X: np.ndarray, lessons: Sequence[Lesson | None], groups: np.ndarray) -> StoneNumbers:
    """X (runs, channels, samples + 1), lessons and groups of the same runs."""
    return numbers_on(*learn(X, lessons, groups))


def numbers_on(learnt: Learnt, lesson: Lesson, unknown_m: float = 0.0) -> StoneNumbers:
    """On the plate and places of a lesson; unknown_m: standard deviation of each stone's place along x and along y."""
    one = _bin_responses(learnt, lesson)
    scatter = _scatter_of_forces(one, learnt.covariance, learnt.stones)
    if learnt.damping_ratio[1] > 0:
        more = _bin_responses(learnt, lesson, damped=sum(learnt.damping_ratio))
        scatter = scatter + _scatter_of_damping(_means(more - one, [law[:1] for law in learnt.laws])[0])
    for moved_m in ((SMALL_M, 0.0), (0.0, SMALL_M)) if unknown_m else ():
        slope = (_bin_responses(learnt, lesson, moved_m) - one) / SMALL_M @ (learnt.laws[0][0] + learnt.laws[1][0]) / 2
        scatter = scatter + unknown_m**2 * slope @ slope.T
    return StoneNumbers(learnt.scale, learnt.rest, scatter, _means(one, learnt.laws), *learnt.speed_m_s)


def learnt_forces(taught: list[Lesson], bins: np.ndarray, groups: np.ndarray,
                  middle_m_s: float) -> tuple[list[np.ndarray], np.ndarray, int]:
    """`force_law` of coal and of gangue, the mean of their covariances, since a place has one or the other, and the fewest
    different stones of either. RecognitionError for too few."""
    laws, covariances, stones = [], [], []
    for gangue in (False, True):
        force, speed_m_s, seen = _forces(taught, bins, groups, gangue, middle_m_s)
        if seen < LEAST_STONES:
            raise RecognitionError(f"{seen} different stones of {'gangue' if gangue else 'coal'}; needs {LEAST_STONES}")
        law, covariance = force_law(force, speed_m_s - middle_m_s, seen)
        laws.append(law)
        covariances.append(covariance)
        stones.append(seen)
    return laws, (covariances[0] + covariances[1]) / 2, min(stones)


def _scatter_of_forces(one: np.ndarray, covariance: np.ndarray, stones: int) -> np.ndarray:
    """Of x: each place by itself; and the means, known from so many stones only, which err alike at all places."""
    alone = sum(one[:, i] @ covariance @ one[:, i].T for i in range(one.shape[1]))
    together = one.sum(axis=1)
    return alone + together @ covariance @ together.T / (2 * stones)


def _scatter_of_damping(change: np.ndarray) -> np.ndarray:
    """Of x, by a standard deviation of the damping: change (d, 1 + stones) of the mean, each place coal or gangue alike."""
    middling = change[:, 0] + change[:, 1:].sum(axis=1) / 2
    return np.outer(middling, middling) + change[:, 1:] @ change[:, 1:].T / 4


def force_bins(lesson: Lesson, rows: int) -> np.ndarray:
    """Hat functions (rows, bins) over the first steps of a lesson, `_steps_apart`."""
    apart = _steps_apart(lesson)
    middle = (np.arange(-(-rows // apart)) + 0.5) * apart
    return np.maximum(0.0, 1 - np.abs(np.arange(rows)[:, None] + 0.5 - middle) / apart)


def _steps_apart(lesson: Lesson) -> int:
    return max(1, round(BIN_S / lesson.step_s))


def _forces(taught: list[Lesson], bins: np.ndarray, groups: np.ndarray, gangue: bool, middle: float):
    """Of all stones of a material: forces (m, bins) in shares of v / middle, speeds (m,), and how many different packings
    of stones there are: a group's stones are the same in all its runs."""
    to_bins = np.linalg.pinv(bins)
    force = np.vstack([lesson.force_N[lesson.gangue == gangue, :len(bins)] @ to_bins.T * (middle / lesson.speed_m_s)
                       for lesson in taught])
    speed = np.concatenate([np.full(np.sum(lesson.gangue == gangue), lesson.speed_m_s) for lesson in taught])
    different = {(group, stone) for lesson, group in zip(taught, groups, strict=True)
                 for stone in np.flatnonzero(lesson.gangue == gangue)}
    return force, speed, len(different)


def force_law(force: np.ndarray, speed: np.ndarray, stones: int) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (p, bins) of the mean force by powers of the speed, and the covariance (bins, bins) about it, of forces
    (m, bins) of `stones` different stones."""
    powers = speed[:, None] ** np.arange(DEGREE + 1 if np.ptp(speed) > 0 else 1)
    law = np.linalg.lstsq(powers, force, rcond=None)[0]
    off = force - powers @ law
    seen = off.T @ off / len(off)
    variance = np.diag(seen)
    variance = np.maximum(variance, LEAST_DEVIATION**2 * variance.max())
    return law, (stones * seen + MORE_STONES * np.diag(variance)) / (stones + MORE_STONES)


def _bin_responses(learnt: Learnt, lesson: Lesson, moved_m: tuple[float, float] = (0.0, 0.0),
                   damped: float | None = None) -> np.ndarray:
    """Records (d, stones, bins) by a unit force in each bin on each place, each channel in shares of its scale."""
    one = response(lesson, learnt.damping_ratio[0] if damped is None else damped, moved_m)[:, :len(learnt.bins)]
    # The plate does not change with time: all bins but the first, which is cut at 0, are the second one, later.
    first, second = (pushed(one, learnt.bins[:, k, None]) for k in (0, 1))
    later = _steps_apart(lesson)
    answers = np.zeros((one.shape[0], len(learnt.at), one.shape[2], learnt.bins.shape[1]))
    answers[..., 0] = first[:, learnt.at]
    for k in range(1, learnt.bins.shape[1]):
        rows = learnt.at - (k - 1) * later
        answers[..., k][:, rows >= 0] = second[:, rows[rows >= 0]]
    return (answers / learnt.scale[:, None, None, None]).reshape(-1, *answers.shape[2:])


def _means(one: np.ndarray, laws: list[np.ndarray]) -> np.ndarray:
    """(p, d, 1 + stones): a record of coal alone, and what each stone of gangue adds."""
    coal, gangue = (np.einsum("dib,pb->pdi", one, law) for law in laws)
    return np.concatenate([coal.sum(axis=2, keepdims=True), gangue - coal], axis=2)


def usual_limits(X: np.ndarray, lessons: Sequence[Lesson | None], groups: np.ndarray,
                 y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of records whose group, or where there are fewer than three groups, whose ratio, was held out: the law of their misfit
    (`strangeness`), and the limits: what 95 % of them keep, times 1.5."""
    chosen = same_places(lessons)
    keys = (groups if np.unique(groups[chosen]).size >= LEAST_GROUPS else y)[chosen]
    found = []
    for train, test in GroupKFold(min(FOLDS, np.unique(keys).size)).split(chosen, groups=keys):
        numbers = fit_numbers(X[chosen[train]], [lessons[k] for k in chosen[train]], groups[chosen[train]])
        found += [numbers.estimate(X[k]) for k in chosen[test]]
    usual = np.polyfit([one.ratio for one in found], np.log([one.misfit for one in found]), 2)
    strange = np.array([strangeness(one, usual) for one in found])
    return usual, STRANGE_FACTOR * np.maximum(1.0, conformal_quantile(strange, USUAL_SHARE))
