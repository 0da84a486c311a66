"""The law of a stone's force on the plate, as simulated stones show it.

From its arrival on, a stone of speed v pushes with

    F = v / v_m e^u (f_0 + a f_1) + rest.

e^u is its impulse at the middle speed v_m of training, f_0 the mean of the forces in shares of their impulses, f_1 the
first principal component of how these shares scatter: mostly how long a stone pushes. u and a are normally distributed,
by a mean and a covariance of coal and of gangue: where sizes scatter, impulses are nearly log-normal. The rest is
normally distributed, by one covariance for both.
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.physics.force_records import ForceRecord

#: About the width of the bins of a force, which is linear between them. With 25 us what begins and ends in a bin makes
#: an error of 4 to 6 % of the accelerations, with 10 us of 0.5 to 0.9 %.
BIN_S = 10e-6
FORCE_S = 1.5e-3  # that a force is taken to last; what pushes later counts as residual
DEGREE = 2  # of the mean of u and a in the speed
#: Covariances from few stones are shrunk towards numbers that are independent of each other, with the weight of so many
#: stones.
SHRINKAGE_STONES = 20
LEAST_DEVIATION = 0.02  # of a number, in shares of the largest
LEAST_STONES = 5  # different ones, of either material
#: Digits in a model file: more than a sensor has, and a third of the size.
SHORT = {"digits": 7}


@dataclass(frozen=True)
class ForceLaw:
    """forms (k, bins): f_0, f_1 ... in hats; mean (2, p, k): of u, a ... of coal and of gangue, by powers of the speed
    beyond middle_m_s; covariance (2, k, k): of them; rest (bins, bins): covariance of what is left. ValueError for
    arrays that do not fit together."""

    forms: Floats = field(metadata=SHORT)
    mean: Floats = field(metadata=SHORT)
    covariance: Floats = field(metadata=SHORT)
    rest: Floats = field(metadata=SHORT)
    middle_m_s: float

    def __post_init__(self) -> None:
        if not (self.forms.ndim == 2 and self.rest.shape == (self.bins,) * 2 and self.mean.ndim == 3
                and self.mean.shape[::2] == (2, len(self.forms))
                and self.covariance.shape == (2, len(self.forms), len(self.forms))):
            raise ValueError("the arrays of the law of forces do not fit together")

    @property
    def bins(self) -> int:
        return self.forms.shape[1]

    def mean_at(self, speed_m_s: float) -> Floats:
        """(2, k): mean of u, a ... of coal and of gangue, the speed counted in u."""
        powers = (speed_m_s - self.middle_m_s) ** np.arange(self.mean.shape[1])
        faster = np.eye(len(self.forms))[0] * np.log(speed_m_s / self.middle_m_s)
        return np.asarray(np.tensordot(powers, self.mean, (0, 1)) + faster)

    @property
    def weights(self) -> tuple[Floats, Floats]:
        """Mean (2, k) and covariance (2, k, k) of the forms' weights e^u (1, a ...) at the middle speed, log-normal."""
        u, of_u = self.mean[:, 0, 0], self.covariance[:, 0, 0]

        def beside(times: int) -> Floats:
            """(1, mean of a ...) where stones count by e^(times u)."""
            return np.column_stack([np.ones(2), self.mean[:, 0, 1:] + times * self.covariance[:, 0, 1:]])

        first = np.exp(u + of_u / 2)[:, None] * beside(1)
        second = beside(2)[:, :, None] * beside(2)[:, None, :]
        second[:, 1:, 1:] += self.covariance[:, 1:, 1:]
        second *= np.exp(2 * u + 2 * of_u)[:, None, None]
        return first, second - first[:, :, None] * first[:, None, :]

    @property
    def of_any(self) -> tuple[Floats, Floats]:
        """Mean (k,) and covariance (k, k) of the weights of a stone that is coal or gangue, both as likely."""
        return of_either(*self.weights)

    @property
    def mean_force(self) -> Floats:
        """(2, bins): of coal and of gangue at the middle speed, N."""
        return np.asarray(self.weights[0] @ self.forms)


def of_either(mean: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Mean (k,) and covariance (k, k) of what is one of two, both as likely, by their means (2, k) and covariances
    (2, k, k)."""
    half = (mean[1] - mean[0]) / 2
    return mean.mean(axis=0), covariance.mean(axis=0) + np.outer(half, half)


def hats(width: int, steps: int, count: int) -> Floats:
    """Hat functions (steps, count) of time, which rise over `width` steps and fall as long, `width` steps apart."""
    middle = (np.arange(count) + 1) * width
    return np.asarray(np.maximum(0.0, 1 - np.abs(np.arange(steps)[:, None] + 0.5 - middle) / width))


def steps_per_bin(record: ForceRecord) -> int:
    return max(1, round(BIN_S / record.step_s))


def bins_of(record: ForceRecord) -> Floats:
    """Hat functions (steps, bins) over the first FORCE_S of a force record."""
    width, steps = steps_per_bin(record), min(round(FORCE_S / record.step_s), record.force_N.shape[1])
    return hats(width, steps, steps // width - 1)


@lru_cache(maxsize=4)
def _to_bins(width: int, steps: int, count: int) -> Floats:
    """Inverse (bins, steps) of the hat functions, the same in every fold."""
    return np.asarray(np.linalg.pinv(hats(width, steps, count)), dtype=float)


def force_law(records: list[ForceRecord], groups: Floats, middle_m_s: float) -> ForceLaw:
    """Of all stones that touched the plate. A group's stones are those of all its runs. RecognitionError for few."""
    width = steps_per_bin(records[0])
    to_bins = _to_bins(width, *bins_of(records[0]).shape)
    forces, beyond, counts = [], [], []
    for gangue in (False, True):
        pushed = [record.from_arrival_N[:, :to_bins.shape[1]] for record in records]
        chosen = [(record.gangue == gangue) & (push.sum(axis=1) > 0)
                  for record, push in zip(records, pushed, strict=True)]
        counts.append(len({(group, k) for group, which in zip(groups, chosen, strict=True)
                           for k in np.flatnonzero(which)}))
        if counts[-1] < LEAST_STONES:
            name = "gangue" if gangue else "coal"
            raise RecognitionError(f"{counts[-1]} different stones of {name}; needs {LEAST_STONES}")
        forces.append(np.vstack([push[which] @ to_bins.T * (middle_m_s / record.speed_m_s)
                                 for record, push, which in zip(records, pushed, chosen, strict=True)]))
        beyond.append(np.repeat([record.speed_m_s - middle_m_s for record in records],
                                [which.sum() for which in chosen]))
    return law_of(forces, beyond, counts, width * records[0].step_s, middle_m_s)


def law_of(forces: list[Floats], beyond: list[Floats], counts: list[int], bin_s: float, middle_m_s: float) -> ForceLaw:
    """Of forces (m, bins) of coal and of gangue, at the middle speed, of stones that fell so much faster (m,), and the
    numbers of different ones."""
    impulse = [force.sum(axis=1, keepdims=True) * bin_s for force in forces]
    first = np.mean([np.mean(force / of, axis=0) for force, of in zip(forces, impulse, strict=True)], axis=0)
    off = [force - of * first for force, of in zip(forces, impulse, strict=True)]
    direction = np.linalg.svd(np.vstack(off), full_matrices=False)[2][:1]
    along = [one @ direction.T / of for one, of in zip(off, impulse, strict=True)]
    deviation = max(np.vstack(along).std(), LEAST_DEVIATION * np.linalg.norm(first))
    numbers = [np.column_stack([np.log(of), a / deviation]) for of, a in zip(impulse, along, strict=True)]
    left = [one - of * a * direction for one, of, a in zip(off, impulse, along, strict=True)]
    degree = DEGREE if np.ptp(np.concatenate(beyond)) > 0 else 0
    powers = [speed[:, None] ** np.arange(degree + 1) for speed in beyond]
    mean = [np.linalg.lstsq(one, of, rcond=None)[0] for one, of in zip(powers, numbers, strict=True)]
    spread = [_covariance(of - one @ by, count, LEAST_DEVIATION)
              for of, one, by, count in zip(numbers, powers, mean, counts, strict=True)]
    rest = [_covariance(one, count, 0.0) for one, count in zip(left, counts, strict=True)]
    return ForceLaw(np.vstack([first, deviation * direction]), np.stack(mean), np.stack(spread), np.mean(rest, axis=0),
                    middle_m_s)


def _covariance(off: Floats, stones: int, least: float) -> Floats:
    """(k, k) of what (m, k) of `stones` different stones is off their mean, at least `least` in each number, or, of the
    largest deviation, LEAST_DEVIATION; and of the mean, which is known from so many stones only."""
    observed = off.T @ off / len(off)
    variance = np.diag(observed)
    variance = np.maximum(variance, max(least**2, LEAST_DEVIATION**2 * variance.max()))
    shrunk = (stones * observed + SHRINKAGE_STONES * np.diag(variance)) / (stones + SHRINKAGE_STONES)
    return np.asarray(shrunk * (1 + 1 / stones))
