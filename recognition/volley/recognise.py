"""The mixing ratio of a volley, or why it has none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import StoneForces
from recognition.stream.checks import refuse_faulty, without_offset_and_hum
from recognition.volley.impulses import Hypotheses, widened
from recognition.volley.likelihood import Likelihood
from recognition.volley.moments import PHASES, REACHES, Moments
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

SILENCE_S = 0.02  # at least so much at the beginning of a record tells the sensors' noise
LOUD = 8.0  # standard deviations of noise
TRIED = range(-3, 5)  # samples between the first that is loud and the arrival
MOST_MISFIT, MOST_OUTSIDE, MOST_GAIN = 1.6, 0.9, 0.1
LEVELS = (0.05, 0.95)
TOTALS = 400  # between which the probability of other stones is summed


@dataclass(frozen=True)
class Found:
    """What a record says of the stones that it was told to have; arrival_s: of the first stone."""

    likelihood: Likelihood
    stones: Stones
    forces: StoneForces
    arrival_s: float

    def posterior(self, by_mass: bool = False, stones: Stones | None = None) -> tuple[Floats, Floats]:
        """Mixing ratios (n,), rising, and their probability (n,); stones: others than those told."""
        told = Hypotheses.of(stones or self.stones, self.forces)
        log = logsumexp([self.likelihood.at(k, told.total[k], told.squares[k]) for k in range(len(REACHES))], axis=0)
        weight = told.prior * np.exp(log - log.max())
        share = told.share(self.forces.density_kg_m3 if by_mass else np.ones(2))
        order = np.argsort(share)
        return share[order], weight[order] / weight.sum()

    def ratio(self, by_mass: bool = False, stones: Stones | None = None) -> tuple[float, float, float]:
        """Low end, mean and high end of the 90 % interval of the mixing ratio; stones: others than those told."""
        share, weight = self.posterior(by_mass, stones)
        below = np.cumsum(weight)
        low, high = (float(share[min(int(np.searchsorted(below, level)), len(share) - 1)]) for level in LEVELS)
        return low, float(weight @ share), high

    @property
    def outside(self) -> float:
        """Probability that the total impulse is beyond those of all stones that are told, by half a stone at least, if
        any were as likely."""
        told, every = Hypotheses.of(self.stones, self.forces), self.likelihood
        total = np.exp(np.linspace(every.log_total[0], every.log_total[-1], TOTALS))
        number = np.exp(every.log_number.mean())
        log = np.array([every.at(k, total, total**2 / number) for k in range(len(REACHES))])
        inside = [(total > low) & (total < high) for low, high in zip(*told.reached, strict=True)]
        weight = np.exp(log - log.max())
        return float(1 - weight[np.array(inside)].sum() / weight.sum())

    @property
    def refused(self) -> str:
        """Why no ratio can be trusted, "" if it can."""
        off = self.likelihood.gain - 1
        if self.likelihood.misfit > MOST_MISFIT:
            return (f"such stones on this plate do not explain the record: misfit {self.likelihood.misfit:.2f}, "
                    f"limit {MOST_MISFIT}")
        if np.abs(off).max() > MOST_GAIN:
            worst = off[np.abs(off).argmax()]
            return f"the gain of a channel is {worst:+.0%} off, by what the others hear, limit {MOST_GAIN:.0%}"
        if self.outside > MOST_OUTSIDE:
            return "the stones push harder or less than so many of that size and speed can"
        return ""


def recognise_volley(plate: PlateModel, sensors: Sequence[int], stones: Stones, forces: StoneForces,
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
    moments = Moments.of(plate, tuple(sensors), stones, forces, noise)
    starts = [loud + k - round(BEFORE_S * RATE_Hz) for k in TRIED]
    parts = np.array([part_of(values / noise[:, None], start, moments.basis.shape[2]) for start in starts])
    likelihood = Likelihood.of(moments, parts, *Hypotheses.of(widened(stones), forces).ranges)
    arrival_s = (loud + TRIED[likelihood.start]) / RATE_Hz + likelihood.case % PHASES * DELAY_STEP_S
    return Found(likelihood, stones, forces, arrival_s)


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
