"""The force of a tap: as measured, or as hats in time, where it was only a tap."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.tapping.taps import Tap
from recognition.tapping.window import Spectra

HAT_S = 5e-5  # distance of the hats
LASTS_S = 1.5e-3  # at most, a tap
EARLY_S = 3e-4  # before the onset as the sensors see it
LARGEST_N = 1e4  # standard deviation of a hat's height: any tap is smaller


@dataclass(frozen=True)
class Force:
    """A measured force has no coefficients. One that is not known is a sum of hats at times_s (b,) from the onset, with
    heights `coefficients` (b,), N."""

    times_s: Floats
    coefficients: Floats

    @property
    def deviation(self) -> Floats:
        return np.full(self.coefficients.size, LARGEST_N)

    def moved(self, step: Floats) -> Force:
        return replace(self, coefficients=self.coefficients + step)

    def basis(self, found: Spectra) -> np.ndarray:
        """(n, b): transforms of the hats."""
        s = found.s[:, None]
        hat = HAT_S * (np.sinh(s * HAT_S / 2) / (s * HAT_S / 2)) ** 2
        return np.asarray(hat * np.exp(-s * self.times_s))

    def at(self, found: Spectra) -> np.ndarray:
        """(n,): transform of the force."""
        if self.coefficients.size:
            return np.asarray(self.basis(found) @ self.coefficients)
        assert found.force is not None
        return found.force


def force_of(tap: Tap, lead_s: float) -> Force:
    """A tap's force before any fit; hats begin no earlier than the window does."""
    if tap.force_N is not None:
        return Force(np.zeros(0), np.zeros(0))
    start = -min(EARLY_S, lead_s, tap.onset / tap.rate_Hz)
    times_s = np.arange(start, LASTS_S, HAT_S)
    return Force(times_s, np.zeros(times_s.size))
