"""What each mode makes of a stone in the part of a record that a volley is judged by.

Only frequencies below the Nyquist frequency of every third sample count: there the plate is known best, few modes
suffice, and stones that arrive within 0.1 ms are nearly one push.
"""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Self

import numpy as np
from scipy.signal import resample_poly

from recognition.estimation.arrays import Floats
from recognition.innovations.signatures import FINE_S, low_passed, modal_motion
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import StoneForces

RATE_Hz = 20_000.0  # of the record
DECIMATION = 3
HIGHEST_Hz = 6000.0  # of the modes; those above the pass band are felt while a stone pushes
BEFORE_S, LENGTH_S = 4e-3, 0.1  # of the part, before and after the arrival
MARGIN = 20  # samples of the part beside it, for the filter
SPREAD_S, DELAY_STEP_S = 1e-4, 25e-6  # of a volley; of arrivals and delays
FREQUENCY_STEP, DAMPING_STEP = 1e-5, 1e-3  # relative, of the slopes


@dataclass(frozen=True)
class Stones:
    """What is told of a volley: the fewest and the most stones, their radius, and the lowest and highest speed. All
    have one radius and speed, their places are anywhere on the plate, and all of them arrive within SPREAD_S."""

    counts: tuple[int, int]
    radius_m: float
    speeds_m_s: tuple[float, float]


@dataclass(frozen=True)
class Responses:
    """Accelerations of the modes under a unit modal impulse of a stone's form: delayed (delays, m, n) by multiples of
    DELAY_STEP_S; their slopes by_frequency and by_damping (m, n), by the logarithm of either."""

    delayed: Floats
    by_frequency: Floats
    by_damping: Floats

    @classmethod
    def of(cls, plate: PlateModel, stones: Stones, forces: StoneForces, delays: int) -> Self:
        """Of a plate with no modes above HIGHEST_Hz."""
        f, zeta = plate.frequency_Hz, plate.damping_ratio
        fine = round((BEFORE_S + LENGTH_S + MARGIN * DECIMATION / RATE_Hz) / FINE_S)
        sizes = np.array(stones.radius_m), np.array(np.mean(stones.speeds_m_s))
        duration_s = float(np.exp(np.mean([forces.mean(material, *sizes)[0] for material in (0, 1)])))
        t_s: Floats = (np.arange(fine, dtype=float) + 0.5) * FINE_S - BEFORE_S
        pulse = forces.pulse(0, duration_s, t_s)
        push = np.tile(-pulse / (pulse.sum() * FINE_S), (len(f), 1))

        def motion(f: Floats, zeta: Floats) -> Floats:
            return modal_motion(SimpleNamespace(frequency_Hz=f, damping_ratio=zeta), push, FINE_S)

        at_once = motion(f, zeta)
        delayed = np.array([_sampled(at_once, k) for k in range(delays)])
        higher, more = motion(f * (1 + FREQUENCY_STEP), zeta), motion(f, zeta * (1 + DAMPING_STEP))
        return cls(delayed, _sampled((higher - at_once) / FREQUENCY_STEP, delays // 2),
                   _sampled((more - at_once) / DAMPING_STEP, delays // 2))


def _sampled(fine: Floats, delay: int) -> Floats:
    """(m, n): motions (m, fine steps), later by `delay` steps of DELAY_STEP_S, as the record is sampled and used."""
    later = round(delay * DELAY_STEP_S / FINE_S)
    shifted = np.pad(fine, ((0, 0), (later, 0)))[:, :fine.shape[1]]
    sampled = decimated(low_passed(shifted, round(1 / (FINE_S * RATE_Hz))))
    return sampled[:, :round((BEFORE_S + LENGTH_S) * RATE_Hz / DECIMATION)]


def decimated(values: Floats) -> Floats:
    """Every DECIMATION-th sample after a low pass."""
    return np.asarray(resample_poly(values, 1, DECIMATION, axis=-1))


def part_of(values: Floats, start: int, samples: int) -> Floats:
    """`samples` decimated samples of a record (c, t) from its sample `start` on."""
    wide = values[:, start - MARGIN * DECIMATION:start + (samples + MARGIN) * DECIMATION]
    return decimated(wide)[:, MARGIN:MARGIN + samples]
