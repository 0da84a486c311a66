"""Force history of one sphere on a plate: laws of damped contact, integrated.

    m z'' = -P,   M w'' = P - w / C,   d = z - w,   P = K d^(3/2) (1 + c d' / v)

with approach z of the sphere, compression d and impact speed v. The plate is rigid, or one mass M on its static
compliance C, the simplest body that deflects (the real plate has many modes: see `plate_fem`). The laws differ in c(e),
all for the exponent 3/2:

    hertz                  c = 0
    flores                 c = 8 (1 - e) / (5 e)     Flores et al. 2011; Eq. 5 of the paper
    hunt_crossley          c = 3 (1 - e) / 2         Hunt and Crossley 1975
    lankarani_nikravesh    c = 3 (1 - e^2) / 4       Lankarani and Nikravesh 1990

Only Flores' law gives nearly the wanted restitution at every e. The other two were made for e near 1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from analysis.signals.records import RecordError

DAMPING: dict[str, Callable[[float], float]] = {
    "hertz": lambda e: 0.0,
    "flores": lambda e: 8.0 * (1 - e) / (5.0 * e),
    "hunt_crossley": lambda e: 1.5 * (1 - e),
    "lankarani_nikravesh": lambda e: 0.75 * (1 - e**2),
}


@dataclass(frozen=True)
class ForceHistory:
    """Compression and force (n,) from the first touch until the force is zero, and the rebound speed of the sphere."""

    t_s: np.ndarray
    deformation_m: np.ndarray
    force_N: np.ndarray
    rebound_m_s: float

    @property
    def peak_force_N(self) -> float:
        return float(self.force_N.max())

    @property
    def duration_s(self) -> float:
        return float(self.t_s[-1])


@dataclass(frozen=True)
class Spring:
    """A plate as one mass (> 0) on a spring of given compliance (> 0)."""

    compliance_m_N: float
    mass_kg: float


def refuse_no_impact(stiffness: float, mass_kg: float, speed_m_s: float, restitution: float,
                     compliance_m_N: float) -> None:
    """RecordError for other numbers than those of an impact."""
    finite = np.isfinite([stiffness, mass_kg, speed_m_s, compliance_m_N]).all()
    if not (finite and min(stiffness, mass_kg, speed_m_s) > 0 and 0 < restitution <= 1 and compliance_m_N >= 0):
        raise RecordError(f"stiffness = {stiffness:g}, mass_kg = {mass_kg:g}, speed_m_s = {speed_m_s:g}, restitution = "
                          f"{restitution:g}, compliance_m_N = {compliance_m_N:g}: must be finite and above 0, the "
                          "restitution at most 1, the compliance may be 0")


def force_history(law: str, stiffness: float, mass_kg: float, speed_m_s: float, restitution: float = 1.0, *,
                  plate: Spring | None = None, samples: int = 2001) -> ForceHistory:
    """Integrate an impact until the first loss of contact, to a relative tolerance of 1e-10.

    The Hertz stiffness K is in N/m^1.5, the restitution 0 < e <= 1; without a plate it is rigid.
    Raises RecordError for an unknown law and what is no impact, and ArithmeticError if the contact does not end.
    """
    if law not in DAMPING:
        raise RecordError(f"law = {law!r}; choose one of {', '.join(DAMPING)}")
    refuse_no_impact(stiffness, mass_kg, speed_m_s, restitution, plate.compliance_m_N if plate else 0.0)
    if plate and not (plate.compliance_m_N > 0 and plate.mass_kg > 0):
        raise RecordError(f"plate = {plate}: compliance and mass must be above 0")
    c = DAMPING[law](restitution)
    # In units of the Hertz compression and v: the force of a sphere is 5/4 d^(3/2) (1 + c d').
    unit_m = (1.25 * mass_kg * speed_m_s**2 / stiffness) ** 0.4
    unit_s = unit_m / speed_m_s
    to_newton = mass_kg * speed_m_s / unit_s
    lightness = mass_kg / plate.mass_kg if plate else 0.0
    spring = unit_m / (plate.compliance_m_N * to_newton) if plate else 0.0

    def force(state: np.ndarray) -> np.ndarray:
        z, z_rate, w, w_rate = state
        return 1.25 * np.maximum(z - w, 0.0) ** 1.5 * (1 + c * (z_rate - w_rate))

    def motion(t: float, state: np.ndarray) -> tuple[Any, ...]:
        _, z_rate, w, w_rate = state
        push = force(state)
        return z_rate, -push, w_rate, lightness * (push - spring * w)

    def gone(t: float, state: np.ndarray) -> float:
        # With damping the force may vanish before the compression does: no pull is allowed.
        z, z_rate, w, w_rate = state
        return min(z - w, 1 + c * (z_rate - w_rate)) if t > 0 else 1.0

    # solve_ivp reads these two attributes of a function
    gone.terminal, gone.direction = True, -1  # type: ignore[attr-defined]
    found = solve_ivp(
        motion, (0, 100), (0.0, 1.0, 0.0, 0.0), "DOP853", events=gone, rtol=1e-10, atol=1e-13, dense_output=True
    )
    if found.status != 1 or found.sol is None:
        raise ArithmeticError(f"{law}: no end of contact within 100 units of time at e = {restitution:g}")
    t = np.linspace(0, found.t[-1], samples)
    state = found.sol(t)
    compression_m = np.maximum(state[0] - state[2], 0.0) * unit_m
    return ForceHistory(t * unit_s, compression_m, force(state) * to_newton, float(-state[1, -1] * speed_m_s))
