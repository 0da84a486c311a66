"""What the force of one stone on the plate looks like, learnt from simulated histories of single stones.

The force of a stone is F(t) = J/s g((t - c)/s): impulse J, centre of time c, duration s (standard deviation of time
under the force), and a form g with unit area, mean 0 and standard deviation 1. Stones that break have another form than
stones that stay whole: g = g_0 + b g_1 with the mean g_0 of all histories, their first principal component g_1, and a
number b (`breaking`) for each stone. Hertz' contact gives s ~ R v^(-1/5) and J ~ rho R^3 v. Stones that are struck fast
enough break, whatever their size; then s and J become smaller, and scatter. So, for each material,

    log s = a_s(v) + log(R/v^(1/5)) + e_s,    b = a_b(v) + e_b,    log J = a_J(v) + log(m v) + e_J,

where the means a and the covariance of e at a speed are those of the histories of about that speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from recognition.estimation.arrays import Floats

MATERIALS = ("coal", "gangue")
PULSE_S = 0.8e-3  # the longest contact of a stone; what fragments do later is noise
FORM_STEP, FORM_REACH = 0.05, 6.0  # of the form g, in durations s
#: Least standard deviations of log s, b and log J about their laws: stones that fall on a slope, spin or have another
#: number of sub-spheres than those of the histories are off by so much.
LEAST_SCATTER = np.array([0.03, 0.3, 0.03])
SPEEDS_M_S = np.geomspace(1.5, 6.0, 25)  # of the law; between them it is interpolated, beyond them constant
#: Standard deviation in log v of the weights by which histories count at a speed: stones of other strength, or that
#: fall on a slope, break at another speed.
ALIKE = 0.25


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

    form (2, n): g_0 and g_1 on the grid `form_grid()`, g_1 such that b has standard deviation 1 over the histories;
    offset (2, speeds, 3): a_s, a_b, a_J at SPEEDS_M_S; scatter (2, speeds, 3, 3): covariance of e_s, e_b, e_J; start
    (2,): time from the first touch to the centre, in durations; density_kg_m3 (2,).
    """

    form: Floats
    offset: Floats
    scatter: Floats
    start: Floats
    density_kg_m3: Floats

    @classmethod
    def fit(cls, histories: Sequence[History]) -> StoneForces:
        """The law of histories, of which each material needs at least four (ValueError)."""
        form, breaking = _forms(histories)
        gangue = np.array([h.gangue for h in histories])
        parts = [_fit_one([h for h, one in zip(histories, chosen, strict=True) if one], breaking[chosen])
                 for chosen in (~gangue, gangue)]
        offset, scatter, start, density = (np.array(values) for values in zip(*parts, strict=True))
        return cls(form, offset, scatter, start, density)

    def mean(self, material: int, radius_m: Floats, speed_m_s: Floats) -> Floats:
        """Mean of log s, b and log J, shape (..., 3), of stones of a material (0 coal, 1 gangue)."""
        mass = 4 / 3 * np.pi * radius_m**3 * self.density_kg_m3[material]
        by_size = [np.log(radius_m / speed_m_s**0.2), np.zeros_like(mass * speed_m_s), np.log(mass * speed_m_s)]
        return self._at(self.offset[material], speed_m_s) + np.stack(by_size, axis=-1)

    def scatter_at(self, material: int, speed_m_s: Floats) -> Floats:
        """Covariance (..., 3, 3) of log s, b and log J about their means."""
        return self._at(self.scatter[material], speed_m_s)

    def _at(self, values: Floats, speed_m_s: Floats) -> Floats:
        found: Floats = make_interp_spline(np.log(SPEEDS_M_S), values, k=1)(
            np.log(np.clip(speed_m_s, SPEEDS_M_S[0], SPEEDS_M_S[-1])))
        return found

    def pulse(self, form: int, duration_s: float, t_s: Floats) -> Floats:
        """Force (n,) in N of unit impulse by g_0 or g_1 at times (n,) from the centre."""
        return np.interp(t_s / duration_s, form_grid(), self.form[form], left=0.0, right=0.0) / duration_s


def form_grid() -> Floats:
    """Times of the form g, in durations."""
    return np.arange(-FORM_REACH, FORM_REACH + FORM_STEP / 2, FORM_STEP)


def _forms(histories: Sequence[History]) -> tuple[Floats, Floats]:
    """g_0 and g_1 (2, n), and b (histories,)."""
    forms = []
    for h in histories:
        impulse, centre, duration = h.moments()
        t = ((np.arange(len(h.force_N)) + 0.5) * h.step_s - centre) / duration
        forms.append(np.interp(form_grid(), t, h.force_N * duration / impulse, left=0.0, right=0.0))
    mean = np.mean(forms, axis=0)
    _, size, directions = np.linalg.svd(forms - mean, full_matrices=False)
    scale = size[0] / np.sqrt(len(forms))
    return np.array([mean, scale * directions[0]]), (forms - mean) @ directions[0] / scale


def _fit_one(histories: list[History], breaking: Floats) -> tuple[Floats, Floats, float, float]:
    if len(histories) < 4:
        raise ValueError(f"{len(histories)} force histories of one material; needs at least 4")
    rows, starts = [], []
    for h, b in zip(histories, breaking, strict=True):
        impulse, centre, duration = h.moments()
        rows.append([np.log(duration * h.speed_m_s**0.2 / h.radius_m), b, np.log(impulse / (h.mass_kg * h.speed_m_s))])
        touch = np.flatnonzero(h.force_N > 0.01 * h.force_N.max())[0] * h.step_s
        starts.append((centre - touch) / duration)
    offset, scatter = _by_speed(np.array(rows), np.array([h.speed_m_s for h in histories]))
    return offset, scatter, float(np.mean(starts)), float(np.mean([h.density_kg_m3 for h in histories]))


def _by_speed(rows: Floats, speed_m_s: Floats) -> tuple[Floats, Floats]:
    """Means (speeds, 3) and covariances (speeds, 3, 3) of rows (n, 3), weighted by the distance of speeds. Below the
    slowest and above the fastest history they are those there."""
    at = np.clip(SPEEDS_M_S, speed_m_s.min(), speed_m_s.max())
    weight = np.exp(-0.5 * (np.log(at[:, None] / speed_m_s) / ALIKE) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    mean = weight @ rows
    off = rows - mean[:, None]
    counted = 1 - np.sum(weight**2, axis=1)  # (n - 1)/n where all weigh alike
    covariance = np.einsum("sn,sni,snj->sij", weight, off, off) / np.maximum(counted, 0.5)[:, None, None]
    return mean, covariance + np.diag(LEAST_SCATTER**2)
