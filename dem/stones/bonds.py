"""The network of parallel bonds of a packing, its fragments, and its elastic constants without a time step.

A bond is a short round beam of radius r_b and length L = |v| between the centres of two sub-spheres, with

    k_n = E A/L,   k_s = k_n/stiffness_ratio (acting at mid-length),   k_b = k_n r_b^2/4,   k_t = k_s r_b^2/2

(D. O. Potyondy and P. A. Cundall, Int. J. Rock Mech. Min. Sci. 41 (2004) 1329), the same as in dem/engine. Besides, the
dilatation theta of each sub-sphere may have an energy (docs/bonds.md):

    theta = 3 sum of A (r - L) / W,   W = sum of A L over its bonds,   U = kappa (W/6) theta^2/2,   kappa in shares of E
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import cg

from dem.stones.packing import CylinderContainer, Packing, SphereContainer, near_pairs

GAP_TOLERANCE = 0.2  # of the sum of the two radii
LEAST_BONDS = 3      # that hold a sub-sphere against any force
# Bonds that a crack breaks near its plane, by their section, over its own area (lab/rock/crack_area.py).
CRACK_AREA = 2.1
PLATEN_GAP = 0.02    # of the radius: nearer sub-spheres are held by a platen


@dataclass(frozen=True)
class Bonds:
    """m bonds: `first` < `second` (m,) 0-based sub-spheres, `vector_m` (m, 3) from first to second in the undeformed
    state, `radius_m` (m,) of the beam."""

    first: np.ndarray
    second: np.ndarray
    vector_m: np.ndarray
    radius_m: np.ndarray

    @property
    def length_m(self) -> np.ndarray:
        """(m,) in the undeformed state."""
        return np.linalg.norm(self.vector_m, axis=1)

    @property
    def area_m2(self) -> np.ndarray:
        """(m,) section of the beam."""
        return np.pi * self.radius_m**2

    def __len__(self) -> int:
        return len(self.first)


def bond_network(packing: Packing) -> Bonds:
    """Bond every two sub-spheres with a gap of at most GAP_TOLERANCE times the sum of their radii.

    The bond's radius is the smaller of the two. A sub-sphere left with fewer than three bonds gets its nearest unbonded
    neighbours, by gap over sum of radii, until it has three (or all there are). Raises ValueError where the network
    falls into separate pieces.
    """
    n = len(packing.radius_m)
    pairs = _with_least_bonds(packing, near_pairs(packing.center_m, packing.radius_m, GAP_TOLERANCE))
    pieces = fragments(n, pairs[:, 0], pairs[:, 1], np.ones(len(pairs), dtype=bool)).max() + 1
    if pieces > 1:
        raise ValueError(f"the bonds leave {n} sub-spheres in {pieces} separate pieces")
    first, second = pairs.T
    return Bonds(first, second, packing.center_m[second] - packing.center_m[first],
                 np.minimum(packing.radius_m[first], packing.radius_m[second]))


def _with_least_bonds(packing: Packing, pairs: np.ndarray) -> np.ndarray:
    """The pairs, and more for sub-spheres with fewer than LEAST_BONDS."""
    n = len(packing.radius_m)
    wanted = min(LEAST_BONDS, n - 1)
    added = []
    for k in np.flatnonzero(np.bincount(pairs.ravel(), minlength=n) < wanted):
        distance = np.linalg.norm(packing.center_m - packing.center_m[k], axis=1)
        relative = distance / (packing.radius_m + packing.radius_m[k])
        relative[k] = np.inf
        nearest = np.argsort(relative, kind="stable")[:wanted]
        added += [(min(k, other), max(k, other)) for other in nearest]
    return np.unique(np.vstack([pairs, *added]), axis=0) if added else pairs


def fragments(count: int, first: np.ndarray, second: np.ndarray, intact: np.ndarray) -> np.ndarray:
    """Label (count,), from 0, of the piece that each sub-sphere belongs to by its `intact` (m,) bonds."""
    links = coo_matrix((np.ones(int(np.sum(intact))), (first[intact], second[intact])), shape=(count, count))
    return connected_components(links, directed=False)[1]


def bond_matrices(bonds: Bonds, modulus_Pa: float, stiffness_ratio: float) -> np.ndarray:
    """Stiffness (m, 12, 12) of each bond for (u_first, theta_first, u_second, theta_second), small displacements.

    The ends part by e = u_2 - u_1 + v x (theta_1 + theta_2)/2 and turn by theta_2 - theta_1; k_n and k_s act on e along
    and across the bond, k_t and k_b on the turn. With k_s = 12 E I/L^3 this is the Euler-Bernoulli beam.
    """
    v, length, m = bonds.vector_m, bonds.length_m, len(bonds)
    k_normal = modulus_Pa * bonds.area_m2 / length
    k_shear = k_normal / stiffness_ratio
    k_twist, k_bend = k_shear * bonds.radius_m**2 / 2, k_normal * bonds.radius_m**2 / 4
    along = np.einsum("ma,mb->mab", v, v) / length[:, None, None] ** 2
    across = np.eye(3) - along
    part = k_normal[:, None, None] * along + k_shear[:, None, None] * across
    turn = k_twist[:, None, None] * along + k_bend[:, None, None] * across
    v_cross = np.zeros((m, 3, 3))
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        v_cross[:, b, c], v_cross[:, c, b] = -v[:, a], v[:, a]
    one, none = np.broadcast_to(np.eye(3), (m, 3, 3)), np.zeros((m, 3, 3))
    to_part = np.concatenate([-one, v_cross / 2, one, v_cross / 2], axis=2)
    to_turn = np.concatenate([none, -one, none, one], axis=2)
    return (to_part.transpose(0, 2, 1) @ part @ to_part) + (to_turn.transpose(0, 2, 1) @ turn @ to_turn)


def stiffness_matrix(count: int, bonds: Bonds, modulus_Pa: float, stiffness_ratio: float,
                     volumetric_ratio: float = 0.0) -> csr_matrix:
    """Sparse stiffness (6 count, 6 count) of the network, (u, theta) of each sub-sphere in turn, SI units."""
    dof = np.concatenate([6 * bonds.first[:, None] + np.arange(6), 6 * bonds.second[:, None] + np.arange(6)], axis=1)
    rows, columns = np.repeat(dof, 12, axis=1), np.tile(dof, (1, 12))
    block = bond_matrices(bonds, modulus_Pa, stiffness_ratio)
    matrix = coo_matrix((block.ravel(), (rows.ravel(), columns.ravel())), shape=(6 * count, 6 * count)).tocsr()
    if volumetric_ratio == 0:
        return matrix
    volumes, strain = dilatations(count, bonds)
    return (matrix + volumetric_ratio * modulus_Pa * strain.T @ diags(volumes) @ strain).tocsr()


def dilatations(count: int, bonds: Bonds) -> tuple[np.ndarray, csr_matrix]:
    """Volumes W/6 (count,) in m^3, and the matrix (count, 6 count) that gives each sub-sphere's dilatation for small
    displacements (u, theta)."""
    volume = bonds.area_m2 * bonds.length_m
    weight = np.bincount(bonds.first, volume, count) + np.bincount(bonds.second, volume, count)
    pull = 3 * bonds.area_m2[:, None] * bonds.vector_m / bonds.length_m[:, None]
    ends = [(end, other, sign * pull / weight[end][:, None])
            for end in (bonds.first, bonds.second) for other, sign in ((bonds.first, -1), (bonds.second, 1))]
    rows = np.concatenate([np.repeat(end, 3) for end, _, _ in ends])
    columns = np.concatenate([(6 * other[:, None] + np.arange(3)).ravel() for _, other, _ in ends])
    values = np.concatenate([value.ravel() for _, _, value in ends])
    return weight / 6, coo_matrix((values, (rows, columns)), shape=(count, 6 * count)).tocsr()


@dataclass(frozen=True)
class NetworkStiffness:
    """`youngs_modulus_Pa` and `poisson_ratio` by direction of load: (3,) along x, y, z, or (1,) along z for a
    cylinder. A sphere has one Poisson ratio, given three times."""

    youngs_modulus_Pa: np.ndarray
    poisson_ratio: np.ndarray


def network_stiffness(packing: Packing, bonds: Bonds, modulus_Pa: float, stiffness_ratio: float,
                      volumetric_ratio: float = 0.0) -> NetworkStiffness:
    """Elastic constants of the network at rest (small strain, every sub-sphere in equilibrium).

    A cylinder is pressed between two rigid frictionless platens, which hold the sub-spheres that touch them:
    force over the container's section against the strain imposed on their centres; the lateral strain is fitted to
    all sub-spheres. A sphere carries the body force rho A.x for three stretches A along the axes, three shears, and
    the dilatation, and its strain energy is compared with the closed solution of a homogeneous isotropic sphere.
    """
    matrix = stiffness_matrix(len(packing.radius_m), bonds, modulus_Pa, stiffness_ratio, volumetric_ratio)
    if isinstance(packing.container, SphereContainer):
        return _sphere_stiffness(packing, matrix)
    axes = (2,) if isinstance(packing.container, CylinderContainer) else (0, 1, 2)
    return NetworkStiffness(*np.array([_uniaxial_test(packing, matrix, axis) for axis in axes]).T)


def _uniaxial_test(packing: Packing, matrix: csr_matrix, axis: int) -> tuple[float, float]:
    """Young's modulus and Poisson ratio under unit strain along `axis`."""
    x, n = packing.center_m, len(packing.radius_m)
    half = packing.container.half_size_m[axis]
    upper = x[:, axis] + packing.radius_m > half - PLATEN_GAP * packing.radius_m
    lower = x[:, axis] - packing.radius_m < -half + PLATEN_GAP * packing.radius_m
    displacement, held = np.zeros((n, 6)), np.zeros((n, 6), dtype=bool)
    displacement[:, axis] = x[:, axis]
    held[:, axis] = upper | lower
    # The body must not drift across the axis or spin about it: three supports without reaction.
    a, b = (axis + 1) % 3, (axis + 2) % 3
    middle, side = np.argmin(np.hypot(x[:, a], x[:, b])), np.argmax(x[:, a])
    held[middle, [a, b]] = held[side, b] = True
    fixed, u = held.ravel(), displacement.ravel()
    free = ~fixed
    u[free] = solve_static(matrix[free][:, free], -(matrix[free][:, fixed] @ u[fixed]), dof_scale(packing)[free])
    displacement = u.reshape(n, 6)
    force = (matrix @ u).reshape(n, 6)[upper, axis].sum()
    section = packing.container.volume_m3 / (2 * half)
    lateral = [np.polyfit(x[:, k], displacement[:, k], 1)[0] for k in (a, b)]
    return force / section, -float(np.mean(lateral))


def _sphere_stiffness(packing: Packing, matrix: csr_matrix) -> NetworkStiffness:
    stretches = [np.diag(3.0 * axis - 1) / np.sqrt(6) for axis in np.eye(3)]
    shears = [(np.outer(p, q) + np.outer(q, p)) / np.sqrt(2) for p, q in zip(np.eye(3), np.roll(np.eye(3), 1, axis=0))]
    stretch = np.array([_inertial_energy(packing, matrix, load) for load in stretches])
    shear = np.array([_inertial_energy(packing, matrix, load) for load in shears])
    dilatation = _inertial_energy(packing, matrix, np.eye(3) / np.sqrt(3))
    # The three stretches span two of the five deviators, the three shears the other three.
    deviator = (2 * stretch.mean() + 3 * shear.mean()) / 5

    def excess(nu: float) -> float:
        of_deviator, of_dilatation = sphere_energies(nu)
        return of_deviator / of_dilatation - deviator / dilatation

    assert isinstance(packing.container, SphereContainer)
    nu = brentq(excess, -0.99, 0.4999)
    # Energy goes with (load per volume)^2 R^7/E, and the load here is one per volume.
    modulus = sphere_energies(nu)[0] * packing.container.radius_m**7 / stretch
    return NetworkStiffness(modulus, np.full(3, nu))


def sphere_energies(nu: float) -> tuple[float, float]:
    """Strain energy of a homogeneous sphere, E = R = 1, under the body force A.x with A:A = 1: for a deviator A and
    for the dilatation A = I/sqrt(3).

    With a = A.x and q = x.A.x the displacement is (alpha + beta r^2) a + gamma q x; equilibrium and the free surface
    give the three constants (for the dilatation gamma = 0 and q x merges with r^2 a).
    """
    lam, mu = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))
    alpha, beta, gamma = np.linalg.solve(
        [[0.0, 4 * (lam + mu) + 10 * mu, 10 * (lam + mu) + 4 * mu],  # (lam + mu) grad div u + mu laplace u + a = 0
         [1.0, 2.0, 1.0],                                            # surface traction along a
         [0.0, 2 * (lam + mu), 5 * lam + 4 * mu]], [-1, 0, 0])       # surface traction along x
    deviator = 2 * np.pi * (alpha / 15 + beta / 21 + 2 * gamma / 105)
    beta = -1 / (10 * (lam + 2 * mu))
    alpha = -beta * (5 * lam + 6 * mu) / (3 * lam + 2 * mu)
    dilatation = 2 * np.pi / 3 * (alpha / 5 + beta / 7)
    return deviator, dilatation


def _inertial_energy(packing: Packing, matrix: csr_matrix, load: np.ndarray) -> float:
    """Strain energy of the network under the body force `load` (3, 3).x, one per volume and length."""
    share = packing.radius_m**3 / (packing.radius_m**3).sum()
    x = packing.center_m - share @ packing.center_m
    pull = x @ load
    force = np.zeros((len(x), 6))
    force[:, :3] = share[:, None] * pull
    # No net moment: take off what turns the body as a rigid one (the net force is zero already).
    inertia = (share * (x**2).sum(1)).sum() * np.eye(3) - (share[:, None] * x).T @ x
    moment = np.cross(x, force[:, :3]).sum(0)
    force[:, :3] -= share[:, None] * np.cross(np.linalg.solve(inertia, moment), x)
    assert isinstance(packing.container, SphereContainer)
    # The same mean stress as in the homogeneous sphere, whose mass reaches nearer to the surface.
    virial = (force[:, :3] * pull).sum()
    force = force.ravel() * (4 * np.pi * packing.container.radius_m**5 / 15 / virial)
    return 0.5 * float(force @ solve_static(matrix, force, dof_scale(packing)))


def dof_scale(packing: Packing) -> np.ndarray:
    """(6 n,) factors that bring turns to the size of displacements, for the iterative solver."""
    scale = np.ones((len(packing.radius_m), 6))
    scale[:, 3:] = 1 / packing.radius_m[:, None]
    return scale.ravel()


def solve_static(matrix: csr_matrix, load: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Conjugate gradients; of a free body the load must be balanced, and the motion found is one of many."""
    scaled = diags(scale) @ matrix @ diags(scale)
    solution, failed = cg(scaled, scale * load, rtol=1e-10, maxiter=20000, M=diags(1 / scaled.diagonal()))
    if failed:
        raise RuntimeError("the bond network has no equilibrium that conjugate gradients could find")
    return scale * solution
