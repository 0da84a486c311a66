"""The patch of a stone's surface that carries its contact with the plate, and how far the bonds give way under it.

A packing of sub-spheres touches the plate with single sub-spheres of their own small radius. The smooth stone that it
stands for touches with its own radius R. The engine (dem/engine/smooth/smooth_contact.h) therefore lets the surface
sub-spheres about the contact axis carry Hertz' law of the smooth stone together. They have the weights

    w_i ~ r_i^2 (1 - rho_i^2/b^2) (1 + g . rho_i),   sum of w_i = 1,   sum of w_i rho_i = 0

with the radius r_i of the sub-sphere in the packing and its distance rho_i from the axis; the vector g centres the
patch on the axis, so that the force passes through the centre of the stone. The radius b of the patch is a share of R.

A force F on the patch compresses the bond network by C F, C = w . K^+ w, with the stiffness K of the network as a free
body that the force accelerates. Hertz' approach of the plate and the stone's centre contains this compression, so that
the law of the patch is Hertz' law less C F. C is found here from the static solution of the network, for any packing,
material and axis. A force across the axis acts where the plate is, a lever h_i = R - axis . x_i off each sub-sphere,
which turns under it: so do the sub-spheres of the engine, and what slides on the plate is their surface there.

A flat face is what the triangles of one plane make. Sub-spheres whose gap to it is small lie behind it; each has the
part of its area that is nearer to it than to the others (by the power distance |x - c|^2 - r^2). The column of rock
between this part and the centre of the sub-sphere carries the contact of the face (docs/contact.md).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dtbtrs
from scipy.sparse import bsr_array, csr_array, diags_array
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import LinearOperator, cg
from scipy.spatial import cKDTree

from common.files.cache import cached, key_of
from common.scene.scene import BondTable
from dem.stones.bonds import Bonds, dilatations, dof_scale, stiffness_matrix
from dem.stones.packing import Packing, SphereContainer
from dem.stones.solids import Solid

PATCH_RADIUS = 0.4      # b/R
SURFACE_DEPTH = 0.5     # a sub-sphere is of the surface if it reaches nearer to it than this share of its own radius
SOLVER_TOLERANCE = 1e-6
MOST_FACTORED = 1000      # sub-spheres: factors of a larger network take longer than conjugate gradients
GROUPS = 128              # of sub-spheres, whose motions as rigid bodies conjugate gradients need not find
FIRST_AXIS = np.array([0.0, 0.0, -1.0])  # of a stone that does not turn before its first contact
# The twelve corners of an icosahedron: for contacts after the first
OTHER_AXES = np.array([np.roll([0.0, a, b * (1 + 5**0.5) / 2], k) for k in range(3) for a in (-1, 1) for b in (-1, 1)])
OTHER_AXES /= np.linalg.norm(OTHER_AXES[0])


def _sphere_radius_m(packing: Packing) -> float:
    assert isinstance(packing.container, SphereContainer)
    return packing.container.radius_m


def is_surface(packing: Packing) -> np.ndarray:
    """(n,) bool: which sub-spheres of a packing in a sphere are of its surface."""
    reach = np.linalg.norm(packing.center_m, axis=1) + packing.radius_m
    return reach > _sphere_radius_m(packing) - SURFACE_DEPTH * packing.radius_m


def patch_weights(packing: Packing, axis: np.ndarray) -> np.ndarray:
    """Weights (n,) of the sub-spheres in the patch about the unit vector `axis` (3,), which points outwards. They are
    zero outside the patch. Raises ValueError where the patch has too few sub-spheres to be centred."""
    across = np.linalg.svd(axis[None])[2][1:]  # two unit vectors across the axis
    along, rho = packing.center_m @ axis, packing.center_m @ across.T
    inside = 1 - (rho**2).sum(axis=1) / (PATCH_RADIUS * _sphere_radius_m(packing)) ** 2
    members = is_surface(packing) & (along > 0) & (inside > 0)
    weight = np.where(members, packing.radius_m**2 * inside, 0.0)
    if members.sum() < 3:
        raise ValueError(f"{members.sum()} sub-spheres in the patch; must be at least 3")
    shift = -np.linalg.solve((weight[:, None] * rho).T @ rho, weight @ rho)
    weight = np.where(members, weight * (1 + rho @ shift), 0.0)
    return weight / weight.sum()


def patch_compliance(packing: Packing, bonds: Bonds, modulus_Pa: float, stiffness_ratio: float,
                     axes: np.ndarray, volumetric_ratio: float = 0.0) -> np.ndarray:
    """(k, 2) compression of the bond network per force on the patch about each of the `axes` (k, 3), unit vectors
    outwards, m/N: normal to the surface, and along it, the mean of two directions. Modulus and ratios are of the bonds.
    """
    network = _FreeNetwork(packing, bonds, modulus_Pa, stiffness_ratio, volumetric_ratio)
    loads = []
    for axis in axes:
        lever = (_sphere_radius_m(packing) - packing.center_m @ axis)[:, None] * axis
        directions = np.linalg.svd(axis[None])[2]  # the axis (or its opposite), and two across it
        force = patch_weights(packing, axis)[:, None] * directions[:, None]
        loads.append(network.balanced(force, np.cross(lever, force)))
    normal, *across = network.compliance_m_N(np.vstack(loads)).reshape(-1, 3).T
    return np.column_stack([normal, np.mean(across, axis=0)])


@dataclass(frozen=True)
class StoneSurface:
    """What the smooth contact needs of a stone of n sub-spheres.

    `place_m` (n, 3) from the stone's centre, `is_surface` (n,) bool; `compliance_m_N` (2, 2), normal to the surface and
    along it, of the patch about the stone's lowest point at the start, and the mean over patches elsewhere.
    """

    place_m: np.ndarray
    is_surface: np.ndarray
    compliance_m_N: np.ndarray

    def scaled(self, factor: float) -> Self:
        """With compliances times a factor."""
        return replace(self, compliance_m_N=factor * self.compliance_m_N)


def stone_surface(packing: Packing, bonds: Bonds, bond: BondTable) -> StoneSurface:
    """The surface of one stone. Raises ValueError where a patch has too few sub-spheres."""
    found = patch_compliance(packing, bonds, bond.youngs_modulus_Pa, bond.stiffness_ratio,
                             np.vstack([FIRST_AXIS, OTHER_AXES]), bond.volumetric_ratio)
    mean = [each.mean() for each in found[1:].T]
    return StoneSurface(packing.center_m, is_surface(packing), np.array([found[0], mean]))


class _FreeNetwork:
    """Static compliance of a bond network that nothing holds: a load is balanced by the inertia of the body that it
    accelerates, and displacements count from the body's mean motion."""

    def __init__(self, packing: Packing, bonds: Bonds, *elasticity: float):
        """`elasticity`: modulus and ratios of the bonds, as in `patch_compliance`."""
        self._share = packing.radius_m[:, None] ** 3 / (packing.radius_m**3).sum()  # of the mass
        self._arm = packing.center_m - self._share.T @ packing.center_m
        self._own_inertia = 0.4 * self._share * packing.radius_m[:, None] ** 2
        self._inertia = (((self._share * self._arm**2).sum() + self._own_inertia.sum()) * np.eye(3)
                         - (self._share * self._arm).T @ self._arm)
        self._scale = dof_scale(packing)
        find = _by_factors if len(packing.radius_m) <= MOST_FACTORED else _by_iteration
        self._energies = find(packing, bonds, self._scale, *elasticity)

    def balanced(self, force: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Loads (k, n, 6): `force` and `torque` (k, n, 3) with what the acceleration of the body takes off each
        sub-sphere."""
        moment = (np.cross(self._arm, force) + torque).sum(axis=1)
        spin_up = np.linalg.solve(self._inertia, moment.T).T[:, None]
        pull = force.sum(axis=1, keepdims=True)
        return np.concatenate([force - self._share * (pull + np.cross(spin_up, self._arm)),
                               torque - self._own_inertia * spin_up], axis=2)

    def compliance_m_N(self, load: np.ndarray) -> np.ndarray:
        """Of balanced loads (k, n, 6) that push with 1 N: twice the energy that each stores, as its mean displacement
        counts from that of the body."""
        return self._energies(self._scale * load.reshape(len(load), -1))


# Gives twice the energy (k,) that each of some scaled loads (k, 6 n) stores.
Energies = Callable[[np.ndarray], np.ndarray]


def _by_factors(packing: Packing, bonds: Bonds, scale: np.ndarray, *elasticity: float) -> Energies:
    """By Cholesky's lower factor of the network whose first sub-sphere is held, which a balanced load does not pull at,
    with its unknowns in an order that makes the matrix a band."""
    matrix = stiffness_matrix(len(packing.radius_m), bonds, *elasticity)
    scaled = (diags_array(scale) @ matrix @ diags_array(scale)).tocsr()
    order = 6 + reverse_cuthill_mckee(scaled[6:, 6:], symmetric_mode=True)
    entry = scaled[order][:, order].tocoo()
    below, lower = entry.row - entry.col, entry.row >= entry.col
    band = np.zeros((below.max() + 1, len(order)), order="F")  # which LAPACK overwrites in place
    band[below[lower], entry.col[lower]] = entry.data[lower]
    factor = cholesky_banded(band, lower=True, overwrite_ab=True, check_finite=False)
    return lambda load: np.asarray((dtbtrs(factor, load[:, order].T, uplo="L")[0] ** 2).sum(axis=0))


def _by_iteration(packing: Packing, bonds: Bonds, scale: np.ndarray, modulus_Pa: float, stiffness_ratio: float,
                  volumetric_ratio: float) -> Energies:
    """By conjugate gradients, preconditioned by the diagonal and, what it would take them long to find, the response of
    groups of sub-spheres as rigid bodies. The dilatations tie neighbours of neighbours, so that the product of their
    matrices is never formed: it has more entries than the beams."""
    n, scaling = len(packing.radius_m), diags_array(scale)
    beams = bsr_array(scaling @ stiffness_matrix(n, bonds, modulus_Pa, stiffness_ratio) @ scaling, blocksize=(6, 6))
    volume_m3, strain = dilatations(n, bonds)
    dilated = csr_array(diags_array(np.sqrt(volumetric_ratio * modulus_Pa * volume_m3)) @ strain @ scaling)
    moved = _rigid_motions(packing, scale)
    back, onto = dilated.T.tocsr(), moved.T.tocsr()
    coarse = np.linalg.pinv((onto @ (beams @ moved) + onto @ (back @ (dilated @ moved))).toarray(), 1e-10, True)
    diagonal = beams.diagonal() + dilated.power(2).sum(axis=0)
    stiffness = LinearOperator(beams.shape, lambda u: beams @ u + back @ (dilated @ u), dtype=float)
    nearly = LinearOperator(beams.shape, lambda load: load / diagonal + moved @ (coarse @ (onto @ load)), dtype=float)

    def energy(load: np.ndarray) -> float:
        motion, failed = cg(stiffness, load, rtol=SOLVER_TOLERANCE, maxiter=20000, M=nearly)
        if failed:
            raise RuntimeError("the bond network has no equilibrium that conjugate gradients could find")
        return float(load @ motion)

    return lambda loads: np.array([energy(load) for load in loads])


def _rigid_motions(packing: Packing, scale: np.ndarray) -> csr_array:
    """(6 n, 6 groups), scaled: groups are of sub-spheres that follow each other, which are neighbours in space."""
    n = len(packing.radius_m)
    group = np.arange(n) * GROUPS // n
    center_m = np.column_stack([np.bincount(group, x) / np.bincount(group) for x in packing.center_m.T])
    motion = np.tile(np.eye(6), (n, 1, 1))
    motion[:, :3, 3:] = np.cross(np.eye(3), (packing.center_m - center_m[group])[:, None]).swapaxes(1, 2)
    return bsr_array((motion / scale.reshape(n, 6, 1), group, np.arange(n + 1)), shape=(6 * n, 6 * GROUPS)).tocsr()


BEHIND = 0.5      # of its radius: the gap of a sub-sphere that lies behind a face
FEWEST = 3        # sub-spheres behind a face; a plane with fewer is taken to be part of a curved surface
SPACING = 0.15    # of the mean radius of the sub-spheres: between the points that a face is measured by
SAME_PLANE = 1e-6
PARALLEL_rad = 0.005  # a face turned further from the plate's meets it with an edge or a corner; so in dem/engine


@dataclass(frozen=True)
class FaceColumns:
    """k columns: the `sub_sphere` (k,) behind each, the outward `normal` (k, 3) of its face, its `height_m` (k,) from
    the centre of the sub-sphere to the face, its `area_m2` (k,), and the radius (k,) of the circle of the whole face's
    area."""

    sub_sphere: np.ndarray
    normal: np.ndarray
    height_m: np.ndarray
    area_m2: np.ndarray
    face_radius_m: np.ndarray

    def scaled(self, size: float) -> Self:
        """Of the stone `size` times as large."""
        return replace(self, height_m=size * self.height_m, area_m2=size**2 * self.area_m2,
                       face_radius_m=size * self.face_radius_m)

    def turned(self, matrix: np.ndarray) -> Self:
        """Of the stone turned by the matrix (3, 3)."""
        return replace(self, normal=self.normal @ matrix.T)

    def lowest_m(self, center_m: np.ndarray) -> float:
        """Least height of a face that is parallel to the plate; `center_m` (n, 3) of all sub-spheres."""
        parallel = -self.normal[:, 2] > np.cos(PARALLEL_rad)
        return float((center_m[self.sub_sphere, 2] - self.height_m)[parallel].min(initial=np.inf))


def face_columns(packing: Packing, solid: Solid, size_m: float) -> FaceColumns:
    """Of a packing in a solid that is `size_m` times as large as that of the unit sphere's volume. Sorted by
    sub-sphere."""
    plane, corners = _planes(solid)
    rows = [_behind(packing, plane[k], size_m * corners[k]) for k in range(len(plane))]
    index, normal, height, area, radius = (np.concatenate(column) for column in zip(*rows, strict=True))
    order = np.argsort(index, kind="stable")
    return FaceColumns(index[order], normal[order], height[order], area[order], radius[order])


def _planes(solid: Solid) -> tuple[np.ndarray, list[np.ndarray]]:
    """Outward normals (p, 3), and of each plane the corners (t, 3, 3) of its triangles."""
    key = np.round(np.column_stack([solid.normal, solid.offset]) / SAME_PLANE).astype(np.int64)
    _, first, member = np.unique(key, axis=0, return_index=True, return_inverse=True)
    corners = solid.corner[solid.triangle]
    return solid.normal[first], [corners[member.ravel() == k] for k in range(len(first))]


def _behind(packing: Packing, normal: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, ...]:
    """The columns of one face: sub-spheres, normals, heights, areas and radius."""
    height = (corners[0, 0] - packing.center_m) @ normal
    behind = np.flatnonzero((height > 0) & (height < (1 + BEHIND) * packing.radius_m))
    point, weight = _points_of(corners, SPACING * packing.radius_m.mean())
    owner = _owner(packing, behind, point) if len(behind) else np.zeros(0, dtype=int)
    area = np.bincount(owner, weight[:len(owner)], len(behind))
    behind, area = behind[area > 0], area[area > 0]
    if len(behind) < FEWEST:
        behind, area = behind[:0], area[:0]
    radius = np.full(len(behind), np.sqrt(weight.sum() / np.pi))
    return behind, np.tile(normal, (len(behind), 1)), height[behind], area, radius


def _owner(packing: Packing, behind: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(n,) which of the sub-spheres has each point, by the power distance: the distance in four dimensions."""
    square = packing.radius_m[behind] ** 2
    above = np.sqrt(square.max() - square)  # of the largest exactly nothing
    tree = cKDTree(np.column_stack([packing.center_m[behind], above]))
    return np.asarray(tree.query(np.column_stack([point, np.zeros(len(point))]))[1])


def _points_of(corners: np.ndarray, spacing_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) spread over triangles (t, 3, 3), and their shares (n,) of the area: the middles of the n^2 equal
    triangles that each is cut into."""
    points, weights = [], []
    for a, b, c in corners:
        longest = max(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b))
        cuts = max(1, int(np.ceil(longest / spacing_m)))
        i, j = (grid.ravel() for grid in np.meshgrid(np.arange(cuts), np.arange(cuts), indexing="ij"))
        upward, downward = i + j < cuts, i + j < cuts - 1
        u = np.concatenate([i[upward] + 1 / 3, i[downward] + 2 / 3]) / cuts
        v = np.concatenate([j[upward] + 1 / 3, j[downward] + 2 / 3]) / cuts
        points.append(a + u[:, None] * (b - a) + v[:, None] * (c - a))
        weights.append(np.full(len(u), np.linalg.norm(np.cross(b - a, c - a)) / 2 / cuts**2))
    return np.vstack(points), np.concatenate(weights)


def surface_of(packing: Packing, bonds: Bonds, bond: BondTable, cache_dir: Path | None) -> StoneSurface:
    """As `stone_surface`; the compliances, which take longest, come from the cache in `cache_dir` if they are there."""

    def find() -> dict[str, np.ndarray]:
        return {"compliance_m_N": stone_surface(packing, bonds, bond).compliance_m_N}

    key = key_of(Path(__file__), packing.container, packing.center_m.tobytes(), packing.radius_m.tobytes(),
                 bonds.first.tobytes(), bonds.second.tobytes(), bonds.radius_m.tobytes(), bond.youngs_modulus_Pa,
                 bond.stiffness_ratio, bond.volumetric_ratio)
    kept = cached(cache_dir, "surface", key, find)
    return StoneSurface(packing.center_m, is_surface(packing), kept["compliance_m_N"])


def faces_of(packing: Packing, solid: Solid, size_m: float, cache_dir: Path | None) -> FaceColumns:
    """As `face_columns`, from the cache in `cache_dir` if they are there."""
    key = key_of(Path(__file__), packing.center_m.tobytes(), packing.radius_m.tobytes(), solid.corner.tobytes(),
                 solid.triangle.tobytes(), size_m)
    return FaceColumns(**cached(cache_dir, "faces", key, lambda: vars(face_columns(packing, solid, size_m))))
