"""How many modes a scene needs, and the share of the impact energy that belongs to the modes left out.

A short impact puts the energy |F(omega)|^2 / 2 into each mode of unit mass at the point of impact, F being the
spectrum of the force. A plate has equally many modes in all bands of equal width. The share of the energy that
belongs to modes above a frequency is therefore the share of the spectrum |F|^2 above it, whatever the plate.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from common.files.cache import cached, key_of, user_cache


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
    """As `_found_pulse_share`, from the user's cache if it is there."""
    def find() -> dict[str, np.ndarray]:
        return dict(zip(("cut_off", "share"), _found_pulse_share(), strict=True))

    kept = cached(user_cache(), "pulse", key_of(Path(__file__)), find)
    return kept["cut_off"], kept["share"]


def _found_pulse_share() -> tuple[np.ndarray, np.ndarray]:
    """Return cut-off frequencies times contact time, ascending, and the share of a Hertz pulse's energy above each."""
    from scipy.integrate import solve_ivp  # late: slow to import, and seldom needed

    duration = 2.943275 * 1.25**0.4  # of d'' = -d^(3/2) from d' = 1: 2.94 times the largest deformation
    n, padding = 4096, 64
    motion = solve_ivp(
        lambda t, d: [d[1], -max(d[0], 0.0) ** 1.5], (0, duration), [0, 1], rtol=1e-9, atol=1e-12,
        t_eval=np.arange(n) / n * duration,
    )  # fmt: skip
    power = abs(np.fft.rfft(np.clip(motion.y[0], 0, None) ** 1.5, n * padding)) ** 2
    below = np.cumsum(power) - (power + power[0]) / 2  # trapezoidal rule
    share = 1 - below / below[-1]
    cut_off = np.arange(len(share)) / padding
    kept = cut_off <= 20
    return cut_off[kept], share[kept]
