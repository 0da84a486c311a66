"""Forces of stones by Hertz, and records of forces that are finer than the record."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.signal import resample_poly

from common import hertz
from common.hertz import ElasticBody
from recognition.estimation.arrays import Floats
from recognition.plate.plate_model import PlateModel

HERTZ_POWER = 1.6  # sin(pi t / T) to this power has a Hertz pulse's impulse and its peak


class Stone(ElasticBody, Protocol):
    """An elastic body of a density."""

    @property
    def density_kg_m3(self) -> float: ...


def hertz_pulse(stone: Stone, plate: ElasticBody, radius_m: float, speed_m_s: float, rate_Hz: float,
                arrival_s: float, duration_s: float, stretch: float = 1.0) -> Floats:
    """(t,): force of an elastic sphere on a rigid plate of that material, as a power of a sine with Hertz's contact
    time, `stretch` times as long, and the impulse of a stone that rebounds."""
    mass_kg = stone.density_kg_m3 * 4 / 3 * np.pi * radius_m**3
    stiffness = hertz.stiffness_N_m32(hertz.contact_modulus_Pa(stone, plate), radius_m)
    approach_m = hertz.largest_approach_m(stiffness, mass_kg, speed_m_s)
    contact_s = stretch * float(hertz.contact_time_s(approach_m, speed_m_s))
    t_s = (np.arange(round(duration_s * rate_Hz)) + 0.5) / rate_Hz - arrival_s
    touches = (t_s > 0) & (t_s < contact_s)
    pulse = np.where(touches, np.sin(np.pi * np.where(touches, t_s / contact_s, 0.5)) ** HERTZ_POWER, 0.0)
    return np.asarray(pulse / (pulse.sum() / rate_Hz) * 2 * mass_kg * speed_m_s, float)


def records(plate: PlateModel, force_N: Floats, places_m: Floats, rate_Hz: float, finer: int) -> Floats:
    """Accelerations (s, t) at a sample rate, of forces (n, t finer) that are `finer` times finer, filtered as a
    measurement would be."""
    return np.asarray(resample_poly(plate.response(force_N, places_m, finer * rate_Hz), 1, finer, axis=1), float)
