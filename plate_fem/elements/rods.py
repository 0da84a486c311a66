"""Rods below the plate: bars in tension, beams in bending and shafts in torsion, clamped at their foot; and what their
joints add to the theories of plate and rod, from a table that a solid gave.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.interpolate import interpn

from common.scene.plate import FlexiblePlate, Rod
from plate_fem.elements.mesh import (
    bending_stiffness,
    line_integral as integral,
    parabolas,
    shear_stiffness,
    smooth_cubics,
)
from plate_fem.elements.system import PlateSystem, grown

JOINTS = Path(__file__).with_name("rod_joints.csv")  # written by `python -m lab run rod_joint`
LEAST_COMPLIANCE = 3e-3  # of a joint, in 1/(E a): less is as good as rigid


@dataclass(frozen=True)
class Joint:
    """What the material about a rod's head does beyond the theories of plate and rod (lab/plate/rod_joint.py).

    The disc of the plate above the rod is stiffer by 1 + `stub`, and by 1 + `stub_twist` where it bends into a saddle.
    The head moves by `offset_m2` tr e more than the mid-plane, e = sym grad theta, and by `sheared`, in m and in 1,
    times grad w - theta more sideways and in turn than the normals. `axial_m_N` and `bending` (2, 2), in m/N, 1/N
    and 1/(N m), are compliances under a pull, and under a push sideways and a moment.
    """

    stub: float
    stub_twist: float
    offset_m2: float
    sheared: tuple[float, float]
    axial_m_N: float
    bending: np.ndarray


def joint_of(plate: FlexiblePlate, rod: Rod, theory: str) -> Joint:
    """Return the joint of a rod, from a table by its radius over the plate's thickness, Poisson's ratio and the modulus
    of the rod over the plate's. Beyond the table's ends the joint is that at its end."""
    a, modulus = rod.diameter_m / 2, plate.youngs_modulus_Pa
    names, axes, values = _joints()
    at = [math.log(a / plate.thickness_m), plate.poisson_ratio, math.log(rod.youngs_modulus_Pa / modulus)]
    inside = [np.clip(x, axis[0], axis[-1]) for x, axis in zip(at, axes, strict=True)]
    found = dict(zip(names, interpn(axes, values, inside)[0], strict=True))
    of = "kirchhoff_" if theory == "kirchhoff" else ""
    scaled = np.array([[found[f"{of}side"], found[f"{of}side_turn"]], [found[f"{of}side_turn"], found[f"{of}turn"]]])
    size, directions = np.linalg.eigh(scaled)
    bending = (directions * np.maximum(size, LEAST_COMPLIANCE)) @ directions.T * np.outer([1, 1 / a], [1, 1 / a])
    return Joint(found["stub"], found["stub_twist"], found["offset"] * plate.thickness_m**2,
                 (found["sheared_side"] * plate.thickness_m, found["sheared_turn"]),
                 max(found["axial"], LEAST_COMPLIANCE) / (modulus * a), bending / (modulus * a))


def joint_range() -> list[tuple[float, float]]:
    """Return least and most of radius over the plate's thickness, and of moduli's ratio, of which joints are known."""
    return [(float(np.exp(axis[0])), float(np.exp(axis[-1]))) for axis in _joints()[1][::2]]


@cache
def _joints() -> tuple[list[str], list[np.ndarray], np.ndarray]:
    """Return the names of the table's values, its three axes (radius and modulus as logarithms), and the values."""
    names = JOINTS.read_text().splitlines()[0].split(",")
    table = np.loadtxt(JOINTS, delimiter=",", skiprows=1)
    axes = [np.unique(column) for column in table[:, :3].T]
    values = table[:, 3:].reshape(*map(len, axes), -1)
    return names[3:], [np.log(axes[0]), axes[1], np.log(axes[2])], values


PARTS = 5  # of each rod
CELLS_PER_WAVELENGTH = 8
RADII, ANGLES = 6, 24  # points of the quadrature over a disc
BAR_FOOT, BEAM_FOOT = 0.57, 0.45  # nu^2 radii: a rod is as if shorter, as its foot cannot contract (rod_joint.py)


def load_rows(system: PlateSystem, points_m: np.ndarray, radius_m: float) -> sp.csr_array:
    """Return the sparse matrix (k, size) of the deflection under loads at points (k, 2).

    In Kirchhoff's theory that is w at the point. In Mindlin's, where w is infinite under a point force, it is the mean
    over the part of a disc that lies on the plate.
    """
    if system.theory == "kirchhoff":
        return system.deflection(points_m)
    plate, rows = system.plate, [sp.csr_array((0, system.size))]
    for x, y in points_m:
        points, weights = disc_quadrature(x, y, radius_m)
        inside = np.all(abs(points) <= np.array(plate.size_m) / 2, axis=1)
        rows.append(sp.csr_array(weights[None, inside] / weights[inside].sum()) @ system.deflection(points[inside]))
    return sp.csr_array(sp.vstack(rows))


def disc_quadrature(x_m: float, y_m: float, radius_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (k, 2) in m and weights (k,) of sum one, for the mean over a disc."""
    s, w = np.polynomial.legendre.leggauss(RADII)
    r = radius_m * np.sqrt((s + 1) / 2)  # equal weight per area
    angle = 2 * math.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    x, y = x_m + np.outer(r, np.cos(angle)), y_m + np.outer(r, np.sin(angle))
    return np.column_stack([x.ravel(), y.ravel()]), np.repeat(w / 2 / ANGLES, ANGLES)


Matrices = tuple[sp.csr_array, sp.csr_array, np.ndarray, np.ndarray]  # stiffness, mass, unknowns at top and at base


@dataclass(frozen=True)
class Part:
    """A bar or beam over its own local unknowns.

    The k unknowns `top` are what `rows`, sparse (k, n), give from the unknowns of the plate. Those in `held` are zero,
    and those in `own` belong to the part alone.
    """

    stiffness: sp.csr_array
    mass: sp.csr_array
    top: np.ndarray
    held: np.ndarray
    rows: Any

    @cached_property
    def own(self) -> np.ndarray:
        return np.setdiff1d(np.arange(self.stiffness.shape[0]), [*self.top, *self.held])


def tie(parts: Sequence[Part]) -> sp.csr_array:
    """Return the sparse matrix that gives the local unknowns of parts, one after the other, from those of the plate and
    after them the parts' own."""
    sizes = [part.stiffness.shape[0] for part in parts]
    from_plate = [_pick(size, part.top) @ part.rows for size, part in zip(sizes, parts, strict=True)]
    alone = [_pick(size, part.own) for size, part in zip(sizes, parts, strict=True)]
    return sp.csr_array(sp.hstack([sp.vstack(from_plate), sp.block_diag(alone)]))


def attach(system: PlateSystem, rod: Rod, max_frequency_Hz: float) -> list[Part]:
    """Return the PARTS that a rod adds to a plate: the bar, the beams in the planes xz and yz, the shaft and the stub.

    The head of the rod has the mean deflection of the plate over its disc, the lateral displacement of the plate's
    lower surface and a turn by its rotation and share of shear, but for what its joint gives way.
    """
    points, weights = disc_quadrature(rod.x_m, rod.y_m, rod.diameter_m / 2)
    mean, lower_m = sp.csr_array(weights[None, :]), -system.plate.thickness_m / 2
    joint, nu = joint_of(system.plate, rod, system.theory), system.plate.poisson_ratio
    x, y, _ = system.curvature(points)
    pulled = _joined(*_bar(_alike(rod, nu, BAR_FOOT), max_frequency_Hz), np.array([[joint.axial_m_N]]))
    bent = _joined(*_beam(_alike(rod, nu, BEAM_FOOT), nu, max_frequency_Hz), joint.bending)
    heads = [sp.vstack([mean @ (system.lateral(points, axis, lower_m) + joint.sheared[0] * shear),
                        mean @ (system.rotation(points, axis) + joint.sheared[1] * shear)])
             for axis, shear in enumerate(_shears(system, points))]
    return [Part(*pulled, mean @ (system.deflection(points) + joint.offset_m2 * (x + y))),
            *(Part(*bent, head) for head in heads),
            Part(*_shaft(_alike(rod, nu, 0.0), nu, max_frequency_Hz), mean @ system.yaw(points)),
            _stub(system, joint, points, weights * _area(rod))]


def _alike(rod: Rod, nu: float, foot: float) -> Rod:
    """Return a rod at the origin, whose matrices equal rods share, shorter by about `foot` nu^2 radii."""
    shorter = foot * nu**2 * rod.diameter_m / 2 / rod.length_m
    return rod.model_copy(update={"place_m": (0.0, 0.0), "length_m": rod.length_m / (1 + shorter)})


def _shears(system: PlateSystem, points: np.ndarray) -> list[sp.csr_array]:
    """Return the rows of grad w - theta, along x and y."""
    return [system.deflection(points, by) - system.rotation(points, axis) for axis, by in enumerate(((1, 0), (0, 1)))]


def _stub(system: PlateSystem, joint: Joint, points: np.ndarray, area_m2: np.ndarray) -> Part:
    """Return what the joint adds to the plate's energy over areas (k,) at points (k, 2)."""
    (x, y, twist), plate = system.curvature(points), system.plate
    nu, bending = plate.poisson_ratio, bending_stiffness(plate) / 2
    saddle = joint.stub_twist * bending * (1 - nu)
    rows, stiff = [x + y, x - y, twist], [joint.stub * bending * (1 + nu), saddle, saddle]
    if system.theory == "mindlin":
        rows += _shears(system, points)
        stiff += 2 * [joint.stub * shear_stiffness(plate)]
    diagonal = sp.diags_array(np.outer(stiff, area_m2).ravel(), format="csr")
    size = diagonal.shape[0]
    return Part(diagonal, sp.csr_array((size, size)), np.arange(size), np.array([], int), sp.vstack(rows))


def _joined(stiffness: sp.csr_array, mass: sp.csr_array, top: np.ndarray, base: np.ndarray,
            compliance: np.ndarray) -> Matrices:
    """Return a bar or beam whose k unknowns at the top give way against the plate's by a compliance (k, k)."""
    size, k = stiffness.shape[0], len(top)
    ends = np.append(top, size + np.arange(k))
    joint = np.kron([[1, -1], [-1, 1]], np.linalg.inv(compliance))
    entries = joint.ravel(), (np.repeat(ends, 2 * k), np.tile(ends, 2 * k))
    joined = grown(stiffness, size + k) + sp.csr_array(entries, shape=(size + k, size + k))
    return sp.csr_array(joined), grown(mass, size + k), size + np.arange(k), base


def _pick(size: int, chosen: np.ndarray) -> sp.csr_array:
    """Return the sparse matrix (size, k) that places k numbers at the chosen rows."""
    return sp.csr_array((np.ones(len(chosen)), (chosen, np.arange(len(chosen)))), shape=(size, len(chosen)))


def _lines_m(rod: Rod, wavelength_m: float) -> np.ndarray:
    """Return grid lines from the plate down to the base."""
    n = max(2, math.ceil(CELLS_PER_WAVELENGTH * rod.length_m / wavelength_m))
    return np.linspace(0.0, rod.length_m, n + 1)


def _area(rod: Rod) -> float:
    return math.pi * rod.diameter_m**2 / 4


@lru_cache(maxsize=4)
def _bar(rod: Rod, max_frequency_Hz: float) -> Matrices:
    return _second_order(rod, rod.youngs_modulus_Pa * _area(rod), rod.density_kg_m3 * _area(rod), max_frequency_Hz)


@lru_cache(maxsize=4)
def _shaft(rod: Rod, nu: float, max_frequency_Hz: float) -> Matrices:
    polar = math.pi * rod.diameter_m**4 / 32
    shear_modulus = rod.youngs_modulus_Pa / (2 * (1 + nu))
    return _second_order(rod, shear_modulus * polar, rod.density_kg_m3 * polar, max_frequency_Hz)


def _second_order(rod: Rod, stiff: float, inertia: float, max_frequency_Hz: float) -> Matrices:
    """Return a line whose energies are stiff u'^2 / 2 and inertia du/dt^2 / 2 a unit of length."""
    lines = _lines_m(rod, math.sqrt(stiff / inertia) / max_frequency_Hz)
    u = parabolas(lines)
    top, base = np.array([0]), np.array([len(lines) - 1])
    return stiff * integral(u, u, 1, 1), inertia * integral(u, u), top, base


@lru_cache(maxsize=4)
def _beam(rod: Rod, nu: float, max_frequency_Hz: float) -> Matrices:
    """Return the Timoshenko beam: lateral displacement v and rotation of its sections psi at its top and at its base.

    The rotations are continuous parabolas, which contain the slope of every cubic v, so that a slender beam does not
    lock. Shear coefficient of a circle: 6 (1 + nu)/(7 + 6 nu) (Cowper 1966, J. Appl. Mech. 33:335).
    """
    second_moment = math.pi * rod.diameter_m**4 / 64
    bending, inertia = rod.youngs_modulus_Pa * second_moment, rod.density_kg_m3 * _area(rod)
    shear = 6 * (1 + nu) / (7 + 6 * nu) * rod.youngs_modulus_Pa / (2 * (1 + nu)) * _area(rod)
    wavelength = 2 * math.pi * (bending / inertia) ** 0.25 / math.sqrt(2 * math.pi * max_frequency_Hz)
    lines = _lines_m(rod, wavelength)
    v, psi = smooth_cubics(lines), parabolas(lines)
    k_vp = -shear * integral(v, psi, 1, 0)
    k_pp = bending * integral(psi, psi, 1, 1) + shear * integral(psi, psi)
    stiffness = sp.csr_array(sp.block_array([[shear * integral(v, v, 1, 1), k_vp], [k_vp.T, k_pp]]))
    rotary = rod.density_kg_m3 * second_moment * integral(psi, psi)
    mass = sp.csr_array(sp.block_diag([inertia * integral(v, v), rotary]))
    top, base = (np.array([node, v.size + node]) for node in (0, len(lines) - 1))
    return stiffness, mass, top, base
