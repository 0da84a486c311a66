"""What the joint of a rod adds to the theories of plate and rod, from a table that a solid gave."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import interpn

from common.scene.plate import FlexiblePlate, Rod

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
