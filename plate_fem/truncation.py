"""How many modes a scene needs, and the share of the impact energy that belongs to the modes left out.

A short impact puts the energy |F(omega)|^2 / 2 into each mode of unit mass at the point of impact, F being the
spectrum of the force. A plate has equally many modes in all bands of equal width. The share of the energy that
belongs to modes above a frequency is therefore the share of the spectrum |F|^2 above it, whatever the plate.
"""

from __future__ import annotations

from functools import cache

import numpy as np


def energy_left_out(max_frequency_Hz: float, contact_time_s: float) -> float:
    """Return the share of a plate's impact energy that would go into modes above max_frequency_Hz.

    It holds for an undamped Hertz contact that lasts contact_time_s, to first order in the plate's motion.

    >>> f"{energy_left_out(max_frequency_Hz=10e3, contact_time_s=2e-4):.1e}"
    '9.4e-04'
    """
    cut_off, share = _pulse_share()
    return float(np.interp(max_frequency_Hz * contact_time_s, cut_off, share))


@cache
def _pulse_share() -> tuple[np.ndarray, np.ndarray]:
    """Return cut-off frequencies times contact time, ascending, and the share of a Hertz pulse's energy above each.

    At the depth d = 1 - v^2 of the largest, v from 1 to 0, a sphere moves by dd = sqrt(1 - d^2.5) dt: the time is an
    integral of a smooth function of v. The contact opens as it closed.
    """
    n, padding, v = 4096, 64, np.linspace(1, 0, 20_001)
    middle = (v[1:] + v[:-1]) / 2
    time = np.append(0, np.cumsum(middle / np.sqrt(-np.expm1(2.5 * np.log1p(-(middle**2))))))
    closing = np.interp(np.arange(n // 2 + 1) / n, time / (2 * time[-1]), (1 - v**2) ** 1.5)
    power = abs(np.fft.rfft(np.append(closing, closing[-2:0:-1]), n * padding)) ** 2
    below = np.cumsum(power) - (power + power[0]) / 2  # trapezoidal rule
    cut_off = np.arange(len(power)) / padding
    kept = cut_off <= 20
    return cut_off[kept], (1 - below / below[-1])[kept]
