"""Elastic impact of coal and gangue spheres on a plate: the four contact states (Section II).

A sphere of mass m hits with speed v. Its energy goes into the contact, with stiffness K and restitution e, and into the
deflection w = C P of the plate, with compliance C:

    m v^2 / 2 = 2 K d^(5/2) / (5 e) + C K^2 d^3 / 2,        P = K d^(3/2)      (13, 26, 30)

The four states take e = 1 (Hertz) or e < 1 (Flores), and C = 0 (complete) or C > 0 (with deflection of the plate).
Misprints of the paper are corrected as its other equations demand: 1/E = sum (1 - mu^2)/E in (3, 31, 32), the exponent
2/5 of K in (9), sums in (27, 28) as in (35), and the exponent 3/5 of the force in (36).

P is the force at the largest compression, as the paper takes it. The damped force of Flores' law itself peaks earlier
and higher (1.42 times at e = 0.5): see `analysis.theory.impact`.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from analysis.signals.records import RecordError
from analysis.sweep.runs import Run
from analysis.theory.impact import refuse_no_impact
from common import hertz
from common.run_summary import RecordedMaterial
from common.scene.stones import KINDS

Given = TypeVar("Given")


@dataclass(frozen=True)
class Elastic:
    density_kg_m3: float
    youngs_modulus_Pa: float
    poisson_ratio: float


#: Table 1 of the paper.
COAL = Elastic(1380.0, 5.12e9, 0.3)
GANGUE = Elastic(2400.0, 9.966e9, 0.28)
PLATE = Elastic(7830.0, 2.07e11, 0.3)


@dataclass(frozen=True)
class State:
    """One of the four contact states: with damping or not, with deflection of the plate or not."""

    damped: bool
    deflects: bool


STATES = {
    "PH": State(damped=False, deflects=False),  # complete Hertz
    "HN": State(damped=False, deflects=True),
    "PF": State(damped=True, deflects=False),  # complete Flores
    "FN": State(damped=True, deflects=True),
}


def sphere_mass_kg(rock: Elastic, radius_m: float) -> float:
    return 4.0 / 3.0 * np.pi * radius_m**3 * rock.density_kg_m3


def contact_stiffness(rock: Elastic, radius_m: float, plate: Elastic = PLATE) -> float:
    """Return the Hertz stiffness K of a sphere on a flat plate, N/m^1.5 (Eqs. 2-4, 33, 34; common/hertz.py)."""
    return float(hertz.stiffness_N_m32(hertz.contact_modulus_Pa(rock, plate), radius_m))


def beam_compliance(x_m: ArrayLike, length_m: float, width_m: float, thickness_m: float,
                    plate: Elastic = PLATE) -> np.ndarray:
    """Return the deflection per force, m/N, of the paper's plate, a beam supported at both ends (Eqs. 10, 21).

    C = x y (L^2 - x^2 - y^2) / (6 E I L), y = L - x, I = B h^3 / 12. The distance x from the left end, 0..L, may have
    any shape; RecordError for one beyond. This is right for a simply supported beam, not for a plate on four points.
    """
    x = np.asarray(x_m, dtype=float)
    if not ((x >= -1e-9 * length_m) & (x <= (1 + 1e-9) * length_m)).all():
        raise RecordError(f"x_m = {x.min():g} to {x.max():g}: the beam between the rods is from 0 to {length_m:g} m")
    y = length_m - x
    inertia = width_m * thickness_m**3 / 12.0
    return x * y * (length_m**2 - x**2 - y**2) / (6.0 * plate.youngs_modulus_Pa * inertia * length_m)


def max_deformation_m(stiffness: float, mass_kg: float, speed_m_s: float, *, restitution: float = 1.0,
                      compliance_m_N: float = 0.0) -> float:
    """The largest compression of the sphere, m: the exact root of (13) or (26), with compliance 0 the closed form (8)
    or (19). The restitution is 0 < e <= 1. Raises RecordError for other numbers than those of an impact."""
    refuse_no_impact(stiffness, mass_kg, speed_m_s, restitution, compliance_m_N)
    energy = 0.5 * mass_kg * speed_m_s**2
    rigid = (2.5 * restitution * energy / stiffness) ** 0.4
    if compliance_m_N == 0:
        return float(rigid)

    def excess(d: float) -> float:
        contact = 0.4 * stiffness / restitution * d**2.5
        deflection = 0.5 * compliance_m_N * stiffness**2 * d**3
        return (contact + deflection) / energy - 1.0

    return float(brentq(excess, 0.0, rigid, xtol=1e-15 * rigid, rtol=4 * np.finfo(float).eps))


def peak_force_N(state: State, rock: Elastic, *, radius_m: float = 0.025, speed_m_s: float = 3.0,
                 restitution: float = 0.5, compliance_m_N: float = 0.0, plate: Elastic = PLATE) -> float:
    """Force of one sphere in a state at its largest compression, N (Eqs. 8, 9, 11, 19, 20, 22, 30); restitution and
    compliance count only where the state has damping or deflection."""
    stiffness = contact_stiffness(rock, radius_m, plate)
    d = max_deformation_m(stiffness, sphere_mass_kg(rock, radius_m), speed_m_s,
                          restitution=restitution if state.damped else 1.0,
                          compliance_m_N=compliance_m_N if state.deflects else 0.0)
    return float(stiffness * d**1.5)


def materials_in_order(gangue_count: int, order: list[int]) -> list[str]:
    """Return the material at each position: gangue at the first `gangue_count` of `order` (1-based), else coal."""
    gangue = set(order[:gangue_count])
    return ["gangue" if place in gangue else "coal" for place in range(1, len(order) + 1)]


@dataclass(frozen=True)
class Setup:
    """Of one scene. places_m (count, 2); speed_m_s across the plate; rocks and restitution by "coal" and "gangue";
    support_length_m, support_width_m: distances between the rods along x and y, L and B of the beam formula."""

    places_m: np.ndarray
    radius_m: float
    speed_m_s: float
    gangue_order: list[int]
    rocks: dict[str, Elastic]
    restitution: dict[str, float]
    plate: Elastic
    support_length_m: float
    support_width_m: float
    thickness_m: float


def setup_of(run: Run) -> Setup:
    """The setup of a run. RecordError, naming the key, where the scene does not hold it."""
    stones, plate = run.scene.stones, run.scene.plate
    rods = _given(run, "plate.rods", plate.rods or None)
    length_m, width_m = map(float, np.ptp([rod.place_m for rod in rods], axis=0))
    if not length_m or not width_m:
        raise RecordError(f"{run.path}/run.json: scene.plate.rods stand on one line; needs a length and a width "
                          "between them for the theory")
    count = _given(run, "stones.count", stones.count)
    if stones.speed_m_s == 0:
        raise RecordError(f"{run.path}/run.json: scene.stones.speed_m_s = 0; needs an impact for the theory")
    return Setup(
        places_m=places_of(run),
        radius_m=_given(run, "stones.radius_m", stones.radius_m),
        speed_m_s=_given(run, "stones.speed_m_s", stones.speed_m_s) * np.cos(np.radians(plate.tilt_deg)),
        gangue_order=stones.gangue_order or list(range(1, count + 1)),
        rocks={name: _elastic(run, f"materials.{name}", run.scene.materials.get(name)) for name in KINDS},
        restitution={name: _restitution(run, name) for name in KINDS},
        plate=_elastic(run, "plate", plate),
        support_length_m=length_m,
        support_width_m=width_m,
        thickness_m=_given(run, "plate.thickness_m", plate.thickness_m),
    )


def places_of(run: Run) -> np.ndarray:
    """Where the particles hit, shape (count, 2), by stones.parquet, or by the scene of a run without one. RecordError,
    naming the key, where neither says."""
    stones = run.scene.stones
    if run.stones is not None:
        return run.stones[["place_x_m", "place_y_m"]].to_numpy(dtype=float)
    return np.array(_given(run, "stones.positions_m", stones.positions_m), dtype=float)


def _given(run: Run, key: str, value: Given | None) -> Given:
    if value is None:
        raise RecordError(f"{run.path}/run.json: scene.{key} is missing; needs it for the theory")
    return value


def _elastic(run: Run, key: str, table: RecordedMaterial | None) -> Elastic:
    found = _given(run, key, table)
    return Elastic(_given(run, f"{key}.density_kg_m3", found.density_kg_m3),
                   _given(run, f"{key}.youngs_modulus_Pa", found.youngs_modulus_Pa),
                   _given(run, f"{key}.poisson_ratio", found.poisson_ratio))


def _restitution(run: Run, name: str) -> float:
    found = run.scene.contacts.get(f"{name}_plate")
    return _given(run, f"contacts.{name}_plate.restitution", found.restitution if found else None)
