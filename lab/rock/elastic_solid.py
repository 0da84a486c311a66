"""An elastic solid of cubic finite elements that hits a rigid plane without friction: what faces.py compares with.

Elements of eight nodes with full integration, masses lumped at the nodes, central differences in time at half of the time
that a pressure wave takes through an element. A node that would come through the plane is put on it, which takes its
momentum towards the plane; the force on the plane is what that takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

COURANT = 0.5
NEAR = 0.3  # of the solid's size: nodes nearer to the plane than this may touch it


@dataclass(frozen=True)
class Rock:
    """An isotropic elastic material."""

    youngs_modulus_Pa: float
    poisson_ratio: float
    density_kg_m3: float

    @property
    def pressure_wave_m_s(self) -> float:
        """Speed of a plane wave of pressure."""
        nu = self.poisson_ratio
        stiffness = self.youngs_modulus_Pa * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
        return float(np.sqrt(stiffness / self.density_kg_m3))


def element_stiffness(rock: Rock, edge_m: float) -> np.ndarray:
    """(24, 24) of a cube, corners in the order of x fastest, then y, then z."""
    nu = rock.poisson_ratio
    lame = rock.youngs_modulus_Pa * nu / ((1 + nu) * (1 - 2 * nu))
    shear = rock.youngs_modulus_Pa / (2 * (1 + nu))
    elastic = np.diag([2 * shear] * 3 + [shear] * 3)
    elastic[:3, :3] += lame
    sign = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
    stiffness = np.zeros((24, 24))
    for at in sign / np.sqrt(3):
        factor = 1 + sign * at
        slope = sign * factor[:, [1, 0, 0]] * factor[:, [2, 2, 1]] / (4 * edge_m)
        strain = np.zeros((6, 24))
        for axis in range(3):
            strain[axis, axis::3] = slope[:, axis]
        for row, (a, b) in enumerate([(0, 1), (1, 2), (2, 0)], start=3):
            strain[row, a::3], strain[row, b::3] = slope[:, b], slope[:, a]
        stiffness += strain.T @ elastic @ strain * (edge_m / 2) ** 3
    return stiffness


def hit(rock: Rock, edge_m: float, solid: np.ndarray, up: np.ndarray, speed_m_s: float,
        duration_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) in s and force on the plane (n,) in N. `solid` (nx, ny, nz) bool: which cubes of edge `edge_m` there
    are; `up` (3,): unit normal of the plane in the frame of the solid, which moves against it."""
    shape = np.array(solid.shape) + 1
    cell = np.argwhere(solid)
    ends = [[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    corner = np.stack([np.ravel_multi_index(tuple((cell + end).T), tuple(shape)) for end in ends], axis=1)
    used, corner = np.unique(corner, return_inverse=True)
    corner = corner.reshape(-1, 8)
    count = len(used)
    mass = np.bincount(corner.ravel(), minlength=count) * rock.density_kg_m3 * edge_m**3 / 8
    gap = edge_m * np.column_stack(np.unravel_index(used, tuple(shape))) @ up
    gap -= gap.min()
    near = np.flatnonzero(gap < NEAR * edge_m * max(solid.shape))
    degrees = (3 * corner[:, :, None] + np.arange(3)).reshape(-1, 24)
    stiffness, flat = element_stiffness(rock, edge_m), degrees.ravel()
    moved, velocity = np.zeros((count, 3)), np.tile(-speed_m_s * up, (count, 1))
    dt = COURANT * edge_m / rock.pressure_wave_m_s
    force = []
    for _ in range(int(duration_s / dt)):
        pull = np.bincount(flat, (moved.ravel()[degrees] @ stiffness).ravel(), 3 * count).reshape(-1, 3)
        gained = -pull / mass[:, None]
        through = -(gap[near] + (moved[near] + dt * (velocity[near] + dt * gained[near])) @ up)
        push = np.maximum(through, 0) * mass[near] / dt**2
        gained[near] += (push / mass[near])[:, None] * up
        force.append(push.sum())
        velocity += dt * gained
        moved += dt * velocity
    return dt * np.arange(len(force)), np.array(force)


def block(counts: tuple[int, int, int]) -> np.ndarray:
    """All cubes of a block."""
    return np.ones(counts, dtype=bool)


def disc(across: int, high: int) -> np.ndarray:
    """Cubes whose centre is in a disc, `across` in diameter."""
    middle = np.arange(across) + 0.5 - across / 2
    inside = np.hypot(*np.meshgrid(middle, middle, indexing="ij")) < across / 2
    return np.repeat(inside[:, :, None], high, axis=2)
