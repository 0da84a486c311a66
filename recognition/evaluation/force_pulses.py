"""Forces of stones that no model was trained on: of single simulated stones, and Hertz's with scatter."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.signal import resample_poly

from common import hertz
from common.hertz import ElasticBody
from recognition.estimation.arrays import Booleans, Floats
from recognition.plate.plate_model import PlateModel

LIBRARY = Path(__file__).with_name("data") / "force_pulses.npz"  # benchmarks/pulse_library.py
HERTZ_POWER = 1.6  # sin(pi t / T) to this power has a Hertz pulse's impulse and its peak


@dataclass(frozen=True)
class ForcePulses:
    """Forces force_N (p, n), means over steps of step_s from the first touch on, of single stones: gangue, radius_m,
    speed_m_s, seed (p,)."""

    force_N: Floats
    step_s: float
    gangue: Booleans
    radius_m: Floats
    speed_m_s: Floats
    seed: Floats

    @classmethod
    def library(cls) -> ForcePulses:
        """Bonded stones of both rocks on the paper's plate, with radii of 15 to 35 mm at 2 to 4 m/s."""
        with np.load(LIBRARY) as data:
            return cls(data["force_N"].astype(float), float(data["step_s"]), data["gangue"], data["radius_m"],
                       data["speed_m_s"], data["seed"].astype(float))

    @cached_property
    def impulse_N_s(self) -> Floats:
        return np.asarray(self.force_N.sum(axis=1) * self.step_s, float)

    def like(self, gangue: bool, radius_m: float | None = None, speed_m_s: float | None = None) -> list[int]:
        """Numbers of the pulses of a rock, and of a radius and a speed where these are given."""
        chosen = self.gangue == gangue
        for values, wanted in ((self.radius_m, radius_m), (self.speed_m_s, speed_m_s)):
            if wanted is not None:
                chosen = chosen & np.isclose(values, wanted)
        return [int(k) for k in np.flatnonzero(chosen)]

    def at_rate(self, k: int, rate_Hz: float, arrival_s: float, duration_s: float) -> Floats:
        """(t,): pulse k as means over the steps of a sample rate, arriving at a time."""
        edges_s = np.arange(round(duration_s * rate_Hz) + 1) / rate_Hz - arrival_s
        own_s = np.arange(self.force_N.shape[1] + 1) * self.step_s
        impulse = np.concatenate([[0.0], np.cumsum(self.force_N[k])]) * self.step_s
        return np.asarray(np.diff(np.interp(edges_s, own_s, impulse)) * rate_Hz, float)


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
