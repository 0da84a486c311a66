"""Hertz' contact of an elastic sphere with an elastic half-space (Johnson 1985, Contact Mechanics, chapters 4, 11.4).

Force F, approach d, sphere of radius R and mass m that arrives with speed v:

    1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2,   K = 4/3 E* sqrt(R),   F = K d^(3/2),   p0 = 2/pi E* sqrt(d/R)

    d_max = (5 m v^2/(4 K))^(2/5),   contact time = 2.9432 d_max/v

Arguments are floats, or arrays that numpy can broadcast, in SI units; the result is a float or an array like them.

>>> stiffness = stiffness_N_m32(contact_modulus_Pa=5.4906e9, radius_m=0.025)
>>> depth_m = largest_approach_m(stiffness, mass_kg=0.090321, speed_m_s=3.0)
>>> print(f"{stiffness * depth_m**1.5:.0f} N, {1e6 * contact_time_s(depth_m, 3.0):.0f} us")
4262 N, 234 us
"""

from typing import Any, Protocol

import numpy as np

Values = float | np.ndarray
CONTACT_TIME_FACTOR = 2.9432  # (4/5) sqrt(pi) Gamma(2/5)/Gamma(9/10)


class ElasticBody(Protocol):
    """Anything with the elastic constants of an isotropic body."""

    @property
    def youngs_modulus_Pa(self) -> float: ...

    @property
    def poisson_ratio(self) -> float: ...


def contact_modulus_Pa(first: ElasticBody, second: ElasticBody) -> float:
    """E* of two bodies."""
    return 1 / ((1 - first.poisson_ratio**2) / first.youngs_modulus_Pa
                + (1 - second.poisson_ratio**2) / second.youngs_modulus_Pa)


def stiffness_N_m32(contact_modulus_Pa: Values, radius_m: Values) -> Any:
    """K, in N/m^(3/2)."""
    return 4 / 3 * np.sqrt(radius_m) * contact_modulus_Pa


def largest_approach_m(stiffness_N_m32: Values, mass_kg: Values, speed_m_s: Values) -> Any:
    """d_max on a half-space that does not move."""
    return (5 * mass_kg * speed_m_s**2 / (4 * stiffness_N_m32)) ** 0.4


def contact_time_s(largest_approach_m: Values, speed_m_s: Values) -> Any:
    """Duration of the contact with a half-space that does not move."""
    return CONTACT_TIME_FACTOR * largest_approach_m / speed_m_s


def peak_pressure_Pa(contact_modulus_Pa: Values, approach_over_radius: Values) -> Any:
    """p0, the pressure in the middle of the contact."""
    return 2 / np.pi * contact_modulus_Pa * np.sqrt(approach_over_radius)
