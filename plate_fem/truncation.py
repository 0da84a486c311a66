"""How many modes a scene needs, and the error that leaving out the others makes.

A short impact puts energy |F(omega)|^2 / 2 into each mode (of unit mass at the point), F the spectrum of its
force, and a plate has as many modes in every band of equal width. The share of the energy that belongs to
modes above a frequency is therefore the share of the pulse's spectrum above it, whatever the plate.
"""

import math
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from plate_fem.mesh import bending_stiffness, bending_wavenumber, choose_theory


def energy_left_out(max_frequency_Hz, contact_time_s):
    """Share of a plate's impact energy that would go into modes above max_frequency_Hz.

    For an undamped Hertz contact lasting contact_time_s; exact to first order in the plate's motion.
    """
    cut_off, share = _pulse_share()
    return float(np.interp(max_frequency_Hz * contact_time_s, cut_off, share))


def frequency_for(tolerance, contact_time_s):
    """Lowest max_frequency_Hz at which `energy_left_out` is at most `tolerance` (1e-6 to 0.5)."""
    cut_off, share = _pulse_share()
    return float(np.interp(-tolerance, -share, cut_off)) / contact_time_s


def compliance_left_out(plate, max_frequency_Hz):
    """Static compliance (m/N) at a point of the modes above max_frequency_Hz, far from edges.

    1 / (4 pi D k^2), k the wavenumber there. Residual modes give it back; without them the peak force of a
    contact of tangent stiffness s (N/m, at the peak) is too high by about s / 2 times this, relatively.
    """
    k = bending_wavenumber(plate, max_frequency_Hz, choose_theory(plate))
    return 1 / (4 * math.pi * bending_stiffness(plate) * k**2)


def with_max_frequency(plate, contact_time_s):
    """The plate's table with `max_frequency_Hz` filled in from its `truncation_tolerance`, if it has one."""
    if plate.truncation_tolerance is None:
        return plate
    frequency = frequency_for(plate.truncation_tolerance, contact_time_s)
    return plate.model_copy(update={"max_frequency_Hz": frequency, "truncation_tolerance": None})


@cache
def _pulse_share():
    """Cut-off frequency times contact time, ascending, and the share of a Hertz pulse's energy above it."""
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
