"""The mixing ratio of a volley, or why it has none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.stream.checks import refuse_faulty, without_offset_and_hum
from recognition.stream.forces import StoneForces
from recognition.volley.responses import (
    BEFORE_S,
    DECIMATION,
    DELAY_STEP_S,
    LENGTH_S,
    MARGIN,
    HIGHEST_Hz,
    RATE_Hz,
    Stones,
    part_of,
)
from recognition.volley.sums import PHASES, Sums

SILENCE_S = 0.02  # at least so much at the beginning of a record tells the sensors' noise
LOUD = 8.0  # standard deviations of noise
TRIED = range(-3, 5)  # samples between the first that is loud and the arrival
MOST_MISFIT, MOST_OUTSIDE = 1.6, 0.9
LEVELS = (0.05, 0.95)


@dataclass(frozen=True)
class Found:
    """gangue (k,): numbers of gangue stones, with their probability (k,); misfit: chi-square of the likeliest, per
    number; outside: probability that the impulse is that of other stones; arrival_s: of the first stone."""

    gangue: Floats
    probability: Floats
    misfit: float
    outside: float
    arrival_s: float

    def ratio(self, weight: Sequence[float] = (1.0, 1.0)) -> tuple[float, float, float]:
        """Low end, mean and high end of the 90 % interval of the mixing ratio; weight: of a stone of coal and of
        gangue."""
        share = self.gangue * weight[1]
        share = share / (share + self.gangue[::-1] * weight[0])
        below = np.cumsum(self.probability)
        low, high = (float(share[min(int(np.searchsorted(below, level)), len(share) - 1)]) for level in LEVELS)
        return low, float(self.probability @ share), high

    @property
    def refused(self) -> str:
        """Why no ratio can be trusted, "" if it can."""
        if self.misfit > MOST_MISFIT:
            return f"such stones on this plate do not explain the record: misfit {self.misfit:.2f}, limit {MOST_MISFIT}"
        if self.outside > MOST_OUTSIDE:
            return "the stones push harder or less than so many of that size and speed can"
        return ""


def recognise_volley(plate: PlateModel, sensors: tuple[int, ...], stones: Stones, forces: StoneForces,
                     values: Floats) -> Found:
    """What accelerations (c, samples) at RATE_Hz, which begin with silence, say of stones that arrive at once.

    NotRecognised for a channel that is dead or clipped, and where nothing arrives, or not long enough before the end;
    RecognitionError for a plate that is not known high enough.
    """
    if plate.max_frequency_Hz < HIGHEST_Hz:
        raise RecognitionError(f"the plate has modes up to {plate.max_frequency_Hz:g} Hz; needs {HIGHEST_Hz:g}")
    refuse_faulty(values, [plate.sensor_names[k] for k in sensors])
    values = without_offset_and_hum(values, RATE_Hz)
    noise = values[:, :round(SILENCE_S * RATE_Hz)].std(axis=1)
    if not (noise > 0).all():
        raise NotRecognised("a channel has no noise at all: the record must begin with 20 ms of silence")
    loud = _first_loud(values, noise)
    sums = Sums.of(plate, sensors, stones, forces, noise)
    return _likeliest(sums, values / noise[:, None], loud)


def _first_loud(values: Floats, noise: Floats) -> int:
    loud = (abs(values) > LOUD * noise[:, None]).any(axis=0)
    first = int(np.argmax(loud))
    margin = MARGIN * DECIMATION
    before, after = BEFORE_S * RATE_Hz + margin - TRIED[0], LENGTH_S * RATE_Hz + margin + TRIED[-1]
    if not loud.any() or first < max(SILENCE_S * RATE_Hz, before):
        raise NotRecognised("nothing is heard, or not after 20 ms of silence")
    if first + after > values.shape[1]:
        raise NotRecognised(f"the record ends less than {LENGTH_S:g} s after the stones arrive")
    return first


def _likeliest(sums: Sums, values: Floats, loud: int) -> Found:
    """The counts' probabilities, all alike beforehand, over all arrivals that are tried."""
    starts = [loud + k - round(BEFORE_S * RATE_Hz) for k in TRIED]
    parts = np.array([sums.basis @ part_of(values, start, sums.samples).ravel() for start in starts])
    log, chi_square = np.empty((2, len(sums.mean), len(sums.gangue), len(starts)))
    for p, k in np.ndindex(*log.shape[:2]):
        factor = cholesky(sums.covariance[p, k] + np.eye(len(sums.basis)) / DECIMATION, lower=True)
        off = solve_triangular(factor, (parts - sums.mean[p, k]).T, lower=True)
        chi_square[p, k] = np.sum(off**2, axis=0)
        log[p, k] = -0.5 * chi_square[p, k] - np.log(factor.diagonal()).sum()
    weight = np.exp(log - log.max())
    best = np.unravel_index(int(log.argmax()), log.shape)
    by_count = weight.sum(axis=(0, 2)) / weight.sum()
    inside = sums.gangue[(sums.gangue >= 0) & (sums.gangue <= sums.gangue[-1] + sums.gangue[0])]
    kept = by_count[np.isin(sums.gangue, inside)]
    arrival_s = (loud + TRIED[int(best[2])]) / RATE_Hz + int(best[0]) % PHASES * DELAY_STEP_S
    return Found(inside, kept / kept.sum(), float(chi_square[best]) / len(sums.basis), float(1 - kept.sum()), arrival_s)
