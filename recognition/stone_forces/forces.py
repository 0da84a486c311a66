"""What the force of one stone on the plate looks like, learnt from simulated histories of single stones.

The force of a stone is F(t) = J/s g((t - c)/s): impulse J, centre of time c, duration s, and a form g with unit area.
Stones that break have another form than stones that stay whole: g = g_0 + b g_1 with the mean g_0 of all histories,
each stretched to mean 0 and standard deviation 1, their first principal component g_1, and a number b (`breaking`) for
each stone. J, c, s and b are those of the nearest such force below HEARD_Hz, where a record ends: what lies above is
not heard, and moments of a whole force depend on it. Hertz' contact gives s ~ R v^(-1/5) and J ~ rho R^3 v. So, for
each material,

    log s = a_s + log(R/v^(1/5)) + e_s,    b = a_b + e_b,    log J = a_J + log(m v) + e_J.

Of stones that stay whole e scatters little, and a depends a little on log R, since the plate gives way to heavy stones.
Stones that are struck fast enough break, whatever their size: s and J become smaller, and scatter. Which share of them
breaks depends on material and speed; a and e of broken stones are those of both materials together.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from common.files.whole import read_sealed_json, write_sealed_json
from common.input_error import raised_as
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError

MATERIALS = ("coal", "gangue")
PULSE_S = 0.8e-3  # the longest contact of a stone; what fragments do later is noise
FORM_STEP, FORM_REACH = 0.05, 6.0  # of the form g, in durations s
HEARD_Hz, HEARD_STEP_Hz = 10_000.0, 100.0  # where a record of 20 kHz ends, and between the frequencies of a fit
#: Least standard deviations of log s, b and log J about their laws: stones that fall on a slope, spin or have another
#: number of sub-spheres than those of the histories are off by so much.
LEAST_SCATTER = np.array([0.03, 0.3, 0.03])
SPEEDS_M_S = np.geomspace(1.5, 6.0, 25)  # of the share that breaks; between them it is interpolated, beyond constant
#: Standard deviation in log v of the weights by which histories count at a speed: stones of other strength, or that
#: fall on a slope, break at another speed.
ALIKE = 0.25
REFERENCE_m = 0.025  # radius at which a is told
#: Of log J, by which a stone that broke is below the median of its material: by so much, and by so many times what 84 %
#: of the stones are at most above it, since stones that differ are below it as well.
LOST, LOST_SD = 0.05, 2.0
LEAST_BROKEN = 4  # histories; of fewer no law is made, and no stone is thought to break
FORMAT = "stone forces 5"
#: Of the rock of scenes/single.toml: the stones of the set "learnt" of lab/streams/stone_forces.py.
SHIPPED = Path(__file__).parent / "stone_forces.json"


def refuse_limits(radius_m: tuple[float, float], speed_m_s: tuple[float, float]) -> None:
    """Raises RecognitionError for limits that are not above 0, below a metre or 100 m/s, the lower first."""
    for name, (low, high), most, unit in (("radius", radius_m, 1, "m"), ("speed", speed_m_s, 100, "m/s")):
        if not 0 < low <= high < most:
            raise RecognitionError(f"--{name} {low:g} {high:g}: must be two numbers above 0, below {most} {unit}, the "
                                   "lower first")


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

    def start(self) -> float:
        """Time from the first touch to the centre, in durations."""
        _, centre, duration = self.moments()
        touch = np.flatnonzero(self.force_N > 0.01 * self.force_N.max())[0] * self.step_s
        return float((centre - touch) / duration)


@dataclass(frozen=True)
class StoneForces:
    """The law above for coal and gangue, in this order.

    form (2, n): g_0 and g_1 on the grid `form_grid()`, g_1 by one standard deviation over the histories;
    whole (2, 2, 3): a_s, a_b, a_J at REFERENCE_m and their slopes in log R; scatter (2, 3, 3): covariance of e_s, e_b,
    e_J; radius_m (2,): the smallest and largest of the histories, beyond which a is constant; broken (3,) and
    broken_scatter (3, 3): the same of broken stones; broken_share (2, speeds): of the stones of a material, at
    SPEEDS_M_S; start (2,): time from the first touch to the centre, in durations; density_kg_m3 (2,).
    """

    form: Floats
    whole: Floats
    scatter: Floats
    radius_m: Floats
    broken: Floats
    broken_scatter: Floats
    broken_share: Floats
    start: Floats
    density_kg_m3: Floats

    @classmethod
    def fit(cls, histories: Sequence[History]) -> Self:
        """The law of histories, of which each material needs at least four that stay whole (ValueError)."""
        form = _forms(histories)
        rows = np.array([heard_of(h, form) - _of_size(h.radius_m, h.speed_m_s, h.mass_kg) for h in histories])
        gangue = np.array([h.gangue for h in histories])
        size = np.log([h.radius_m / REFERENCE_m for h in histories])
        broke = np.zeros(len(rows), dtype=bool)
        for chosen in (~gangue, gangue):
            if chosen.any():
                middle, above = np.quantile(rows[chosen, 2], [0.5, 0.84])
                broke[chosen] = rows[chosen, 2] < middle - max(LOST, LOST_SD * (above - middle))
        pieces = rows[broke] if broke.sum() >= LEAST_BROKEN else rows[:0]
        fits = [_whole(rows[chosen & ~broke], size[chosen & ~broke]) for chosen in (~gangue, gangue)]
        speed = np.array([h.speed_m_s for h in histories])
        share = [_share(broke[chosen], speed[chosen]) if len(pieces) else np.zeros(len(SPEEDS_M_S))
                 for chosen in (~gangue, gangue)]
        stones = [[h for h in histories if h.gangue == g] for g in (False, True)]
        return cls(form, np.array([one for one, _ in fits]), np.array([two for _, two in fits]),
                   REFERENCE_m * np.exp([size.min(), size.max()]), *_together(pieces), np.array(share),
                   np.array([np.mean([h.start() for h in some]) for some in stones]),
                   np.array([np.mean([h.density_kg_m3 for h in some]) for some in stones]))

    def mean(self, material: int, radius_m: Floats, speed_m_s: Floats) -> Floats:
        """Mean of log s, b and log J, shape (..., 3), of whole stones of a material (0 coal, 1 gangue)."""
        size = np.log(np.clip(radius_m, *self.radius_m) / REFERENCE_m)
        law = self.whole[material]
        return law[0] + np.multiply.outer(size, law[1]) + self._by_size(material, radius_m, speed_m_s)

    def broken_mean(self, material: int, radius_m: Floats, speed_m_s: Floats) -> Floats:
        """The same of broken stones."""
        return self.broken + self._by_size(material, radius_m, speed_m_s)

    def share_at(self, material: int, speed_m_s: Floats) -> Floats:
        """Share of the stones of a material that break."""
        return np.interp(np.log(speed_m_s), np.log(SPEEDS_M_S), self.broken_share[material])

    def _by_size(self, material: int, radius_m: Floats, speed_m_s: Floats) -> Floats:
        mass = 4 / 3 * np.pi * radius_m**3 * self.density_kg_m3[material]
        return _of_size(radius_m, speed_m_s, mass)

    def pulse(self, form: int, duration_s: float, t_s: Floats) -> Floats:
        """Force (n,) in N of unit impulse by g_0 or g_1 at times (n,) from the centre."""
        return np.interp(t_s / duration_s, form_grid(), self.form[form], left=0.0, right=0.0) / duration_s


def form_grid() -> Floats:
    """Times of the form g, in durations."""
    return np.arange(-FORM_REACH, FORM_REACH + FORM_STEP / 2, FORM_STEP)


def heard_of(history: History, form: Floats) -> Floats:
    """(3,): log s, b and log J of the force with the form g_0 + b g_1 that is nearest to a history below HEARD_Hz, by
    least squares over its spectrum. form (2, n): g_0 and g_1."""
    impulse, centre, duration = history.moments()
    frequency_Hz = np.arange(HEARD_STEP_Hz, HEARD_Hz + 0.5 * HEARD_STEP_Hz, HEARD_STEP_Hz)
    turn = -2j * np.pi * frequency_Hz
    t_s = (np.arange(len(history.force_N)) + 0.5) * history.step_s
    measured = history.force_N @ np.exp(np.outer(t_s, turn)) * history.step_s / impulse

    def left(x: Floats) -> Floats:
        stretched, breaking, relative, late_s = np.exp(x[0]), x[1], np.exp(x[2]), x[3]
        unit = FORM_STEP * (form[0] + breaking * form[1]) @ np.exp(np.outer(stretched * duration * form_grid(), turn))
        off = measured - relative * unit * np.exp((centre + late_s) * turn)
        return np.concatenate([off.real, off.imag])

    found = least_squares(left, np.zeros(4), x_scale=[0.01, 0.3, 0.01, 1e-6]).x
    return np.array([np.log(duration) + found[0], found[1], np.log(impulse) + found[2]])


def _of_size(radius_m: Floats | float, speed_m_s: Floats | float, mass_kg: Floats | float) -> Floats:
    """(..., 3): what size and speed make of log s, b and log J."""
    momentum = np.asarray(mass_kg * speed_m_s)
    return np.stack([np.log(radius_m / speed_m_s**0.2), np.zeros_like(momentum), np.log(momentum)], axis=-1)


def _forms(histories: Sequence[History]) -> Floats:
    """g_0 and g_1 (2, n)."""
    forms = []
    for h in histories:
        impulse, centre, duration = h.moments()
        t = ((np.arange(len(h.force_N)) + 0.5) * h.step_s - centre) / duration
        forms.append(np.interp(form_grid(), t, h.force_N * duration / impulse, left=0.0, right=0.0))
    mean = np.mean(forms, axis=0)
    _, size, directions = np.linalg.svd(forms - mean, full_matrices=False)
    return np.array([mean, size[0] / np.sqrt(len(forms)) * directions[0]])


def _whole(rows: Floats, size: Floats) -> tuple[Floats, Floats]:
    """Means at REFERENCE_m and slopes in log R (2, 3), and covariance about them (3, 3), of rows (n, 3)."""
    if len(rows) < 4:
        raise ValueError(f"{len(rows)} force histories of whole stones of one material; needs at least 4")
    columns = np.column_stack([np.ones_like(size), size])  # the slope of stones of one size is zero
    law = np.linalg.lstsq(columns, rows, rcond=None)[0]
    return np.asarray(law), np.asarray(np.cov((rows - columns @ law).T) + np.diag(LEAST_SCATTER**2))


def _together(rows: Floats) -> tuple[Floats, Floats]:
    """Mean (3,) and covariance (3, 3) of broken stones; zeros and ones where there are none."""
    if not len(rows):
        return np.zeros(3), np.eye(3)
    return rows.mean(axis=0), np.cov(rows.T) + np.diag(LEAST_SCATTER**2)


def _share(broke: NDArray[np.bool_], speed_m_s: Floats) -> Floats:
    """(speeds,): share of stones that break, by those of about that speed, constant below the slowest and above the
    fastest. One half of a stone that breaks and of one that does not are added, since none of a few is not never."""
    at = np.clip(SPEEDS_M_S, speed_m_s.min(), speed_m_s.max())
    weight = np.exp(-0.5 * (np.log(at[:, None] / speed_m_s) / ALIKE) ** 2)
    return np.asarray((weight @ broke + 0.5) / (weight.sum(axis=1) + 1))


def save_forces(forces: StoneForces, file: Path) -> None:
    """Write a JSON file, sealed by its hash."""
    values = {field.name: getattr(forces, field.name).tolist() for field in fields(StoneForces)}
    write_sealed_json(file, {"format": FORMAT, **values})


def load_forces(file: Path = SHIPPED) -> StoneForces:
    """Read what `save_forces` wrote. RecognitionError, one line, for anything else."""
    with raised_as(RecognitionError):
        content = read_sealed_json(file)
    names = {field.name for field in fields(StoneForces)}
    if content is None or content.get("format") != FORMAT or set(content) - {"sha256", "format"} != names:
        raise RecognitionError(f"{file}: no law of the stones' forces; `gangue learn-forces` writes one")
    return StoneForces(**{name: np.array(content[name], float) for name in names})
