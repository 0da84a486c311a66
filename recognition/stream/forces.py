"""What the force of one stone on the plate looks like, learnt from simulated histories of single stones.

The force of a stone is F(t) = J/s g((t - c)/s): impulse J, centre of time c, duration s (standard deviation of time
under the force), and a form g of its material with unit area, mean 0 and standard deviation 1. Hertz' contact gives
s ~ R v^(-1/5) and J ~ rho R^3 v; breaking and crushing scatter both. So, for each material,

    log s = a_s + log(R/v^(1/5)) + e_s,    log J = a_J + log(m v) + e_J,

where the means a and the covariance of e are those of the histories.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats

MATERIALS = ("coal", "gangue")
PULSE_S = 0.8e-3  # the longest contact of a stone; what fragments do later is noise
FORM_STEP, FORM_REACH = 0.05, 6.0  # of the form g, in durations s
#: Least standard deviation of log s and log J about their laws: a law from few histories is not surer than that.
LEAST_SCATTER = 0.01


@dataclass(frozen=True)
class History:
    """Force of one simulated stone: force_N (steps,) as means over steps of step_s; gangue or coal; its radius, density
    and speed."""

    force_N: Floats
    step_s: float
    gangue: bool
    radius_m: float
    density_kg_m3: float
    speed_m_s: float

    @property
    def mass_kg(self) -> float:
        return float(4 / 3 * np.pi * self.radius_m**3 * self.density_kg_m3)

    def moments(self) -> tuple[float, float, float]:
        """Impulse (N s), centre of time (s) and duration (s) of the contact."""
        force = self.force_N[: round(PULSE_S / self.step_s)]
        t_s = (np.arange(len(force)) + 0.5) * self.step_s
        total = force.sum()
        centre = float(force @ t_s / total)
        return float(total * self.step_s), centre, float(np.sqrt(force @ (t_s - centre) ** 2 / total))


@dataclass(frozen=True)
class StoneForces:
    """The law above for coal and gangue, in this order.

    form (2, n): g on the grid `form_grid()`; offset (2, 2): a_s, a_J; scatter (2, 2, 2): covariance of e_s, e_J;
    start (2,): time from the first touch to the centre, in durations; density_kg_m3 (2,).
    """

    form: Floats
    offset: Floats
    scatter: Floats
    start: Floats
    density_kg_m3: Floats

    @classmethod
    def fit(cls, histories: Sequence[History]) -> StoneForces:
        """The law of histories, of which each material needs at least four (ValueError)."""
        parts = [_fit_one([h for h in histories if h.gangue == gangue]) for gangue in (False, True)]
        form, offset, scatter, start, density = (np.array(values) for values in zip(*parts, strict=True))
        return cls(form, offset, scatter, start, density)

    def mean_log(self, material: int, radius_m: Floats, speed_m_s: Floats) -> Floats:
        """Mean of log s and log J, shape (2, ...), of stones of a material (0 coal, 1 gangue)."""
        mass = 4 / 3 * np.pi * radius_m**3 * self.density_kg_m3[material]
        return np.array([self.offset[material, 0] + np.log(radius_m / speed_m_s**0.2),
                         self.offset[material, 1] + np.log(mass * speed_m_s)])

    def pulse(self, material: int, duration_s: float, t_s: Floats) -> Floats:
        """Force (n,) in N of a stone of unit impulse at times (n,) from the centre."""
        return np.interp(t_s / duration_s, form_grid(), self.form[material], left=0.0, right=0.0) / duration_s


def form_grid() -> Floats:
    """Times of the form g, in durations."""
    return np.arange(-FORM_REACH, FORM_REACH + FORM_STEP / 2, FORM_STEP)


def _fit_one(histories: list[History]) -> tuple[Floats, Floats, Floats, float, float]:
    if len(histories) < 4:
        raise ValueError(f"{len(histories)} force histories of one material; needs at least 4")
    rows, forms, starts = [], [], []
    for h in histories:
        impulse, centre, duration = h.moments()
        rows.append([np.log(duration * h.speed_m_s**0.2 / h.radius_m), np.log(impulse / (h.mass_kg * h.speed_m_s))])
        t = ((np.arange(len(h.force_N)) + 0.5) * h.step_s - centre) / duration
        forms.append(np.interp(form_grid(), t, h.force_N * duration / impulse, left=0.0, right=0.0))
        touch = np.flatnonzero(h.force_N > 0.01 * h.force_N.max())[0] * h.step_s
        starts.append((centre - touch) / duration)
    scatter = np.cov(np.array(rows).T) + LEAST_SCATTER**2 * np.eye(2)
    return (np.mean(forms, axis=0), np.mean(rows, axis=0), scatter, float(np.mean(starts)),
            float(np.mean([h.density_kg_m3 for h in histories])))
