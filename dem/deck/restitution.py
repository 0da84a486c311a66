"""The damping ratios that give a contact the restitution of its scene."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.optimize import brentq

MOST = 50.0       # a damping ratio that leaves a restitution below any that a scene may have
PRECISION = 1e-12


def elastic_damping_ratio(restitution: float) -> float:
    """-ln e / sqrt(ln^2 e + pi^2): of LIGGGHTS' Hertz contact, which ends when the overlap is zero, so that the dashpot
    pulls at last (D. Antypov and J. A. Elliott, EPL 94 (2011) 50004)."""
    log_e = float(np.log(restitution))
    return -log_e / float(np.hypot(log_e, np.pi))


def restitution_of(damping_ratio: float) -> float:
    """Rebound over impact speed of a mass on Hertz' spring with the dashpot 2 sqrt(5/6) zeta sqrt(S m), S = dF/dd,
    whose contact ends when the force is zero (`damping_ratio` zeta >= 0).

    With u = sqrt(2 U/m), U the energy of the spring, and a time in which u' = v, the motion is that of the linear
    oscillator, v' = -u - 2 zeta v, whatever mass, stiffness and speed. The force is zero at v' = 0, where
    e = exp(-2 a/tan a), cos a = zeta; the linear case is Schwager and Poeschel's (2007, Granular Matter 9:465).
    """
    a = np.arccos(complex(damping_ratio))  # imaginary where overdamped
    return float(np.exp(-2 * damping_ratio * (a / np.sin(a)).real)) if a != 0 else float(np.exp(-2))


@lru_cache(maxsize=64)
def damping_ratio(restitution: float) -> float:
    """The zeta of `restitution_of` for a restitution above 0, up to 1."""
    if restitution == 1:
        return 0.0
    return float(brentq(lambda ratio: restitution_of(ratio) - restitution, 0, MOST, xtol=PRECISION))
