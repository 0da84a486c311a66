"""The damping ratio that gives a smooth stone the restitution of its scene."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

BEGINS = 1e-3     # of the contact: the dashpot is 0 at its very begin
LASTS = 10        # contact times of the elastic sphere, at most
TOLERANCE = 1e-5
PRECISION = 1e-4  # of the damping ratio


def elastic_damping_ratio(restitution: float) -> float:
    """-ln e / sqrt(ln^2 e + pi^2), of a sphere without bonds (T. Antypov and J. A. Elliott, EPL 94 (2011) 50004)."""
    log_e = float(np.log(restitution))
    return -log_e / float(np.hypot(log_e, np.pi))


@lru_cache(maxsize=64)
def damping_ratio(restitution: float, stiffness_N_m15: float, mass_kg: float, speed_m_s: float,
                  compliance_m_N: float) -> float:
    """Of the dashpot of the patch (docs/contact.md) on a stone of one degree of freedom. The stone's centre comes down
    by the approach q of the patch and the compression of the bonds, under the spring and the dashpot together, while
    the law of the patch knows it under the spring alone. Without the difference a restitution of 0.3 would give 0.29.
    """
    elastic = elastic_damping_ratio(restitution)
    if elastic == 0:
        return 0.0

    def excess(ratio: float) -> float:
        return restitution_of(ratio, stiffness_N_m15, mass_kg, speed_m_s, compliance_m_N) - restitution

    return float(brentq(excess, 0.5 * elastic, 1.02 * elastic, xtol=PRECISION * elastic))


def restitution_of(ratio: float, stiffness_N_m15: float, mass_kg: float, speed_m_s: float,
                   compliance_m_N: float) -> float:
    """Rebound over impact speed for Hertz' stiffness 4/3 E* sqrt(R) and the compression of the bonds per force. Raises
    RuntimeError if the stone does not come off."""
    time = 2.94 * (5 * mass_kg / (4 * stiffness_N_m15 * np.sqrt(speed_m_s))) ** 0.4  # Hertz' contact
    begin = BEGINS * speed_m_s * time

    def spring_and_dashpot(q: float) -> tuple[float, float]:
        hertz = _hertz_approach(max(q, 1e-9 * begin), compliance_m_N * stiffness_N_m15)
        stiffness = 1.5 * stiffness_N_m15 * np.sqrt(hertz)
        dashpot = 2 * np.sqrt(5 / 6) * ratio * np.sqrt(stiffness * mass_kg) / (1 - compliance_m_N * stiffness) ** 2
        return stiffness_N_m15 * hertz**1.5, dashpot

    def rates(_: float, state: np.ndarray) -> list[float]:
        q, center, speed = state
        force = (center - q) / compliance_m_N
        spring, dashpot = spring_and_dashpot(q)
        return [(force - spring) / dashpot, speed, -force / mass_kg]

    def comes_off(_: float, state: np.ndarray) -> float:
        return float(state[0] - 1e-3 * begin)

    comes_off.terminal = True  # type: ignore[attr-defined]
    spring, dashpot = spring_and_dashpot(begin)
    start = [begin, begin + compliance_m_N * (spring + dashpot * speed_m_s), speed_m_s]
    found = solve_ivp(rates, (0, LASTS * time), start, method="Radau", rtol=TOLERANCE, events=comes_off,
                      atol=TOLERANCE * np.array([begin, begin, speed_m_s]))
    if found.status != 1:
        raise RuntimeError(f"a stone with a damping ratio of {ratio:.3g} does not come off the plate")
    return float(-found.y[2, -1] / speed_m_s)


def _hertz_approach(q: float, softness: float) -> float:
    """Solve d - softness d^(3/2) = q by Newton's method, which from d = q on rises to the solution."""
    d = q
    for _ in range(30):
        step = (q - d + softness * d**1.5) / (1 - 1.5 * softness * np.sqrt(d))
        d += step
        if abs(step) < 1e-12 * d:
            break
    return float(d)
