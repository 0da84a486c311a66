"""Bending stress at the top surface of the plate, recovered mode by mode."""

import numpy as np
import scipy.sparse as sp
import skfem
from skfem.helpers import dd, grad


def surface_stress(modes, amplitude):
    """Stress (n_nodes, 3) in Pa at the top surface, columns sx, sy, txy; the bottom has the opposite sign.

    modes: PlateModes; amplitude (n,). The local stress under a contact is not in it.
    """
    return modes.surface_stress @ amplitude


def von_mises(stress):
    """Von Mises stress (...,) of plane stress (..., 3) with columns sx, sy, txy."""
    sx, sy, txy = np.moveaxis(np.asarray(stress), -1, 0)
    return np.sqrt(sx**2 - sx * sy + sy**2 + 3 * txy**2)


class StressPeak:
    """Largest von Mises stress of bending over a motion, away from rods and within a diameter of one.

    modes: PlateModes. rods: those of the plate's table; near them the stress is only indicative.
    """

    def __init__(self, modes, rods=()):
        self._node_m = modes.node_m
        n_modes = modes.surface_stress.shape[2]
        self._columns = np.moveaxis(modes.surface_stress, 1, 0).reshape(-1, n_modes)  # all sx, all sy, all txy
        distance = [np.hypot(*(self._node_m - (rod.x_m, rod.y_m)).T) - rod.diameter_m for rod in rods]
        near = np.array([d < 0 for d in distance]).any(axis=0) if rods else np.zeros(len(self._node_m), bool)
        self._kind = {False: np.flatnonzero(~near), True: np.flatnonzero(near)}
        self._best = {False: (0.0, 0, 0.0), True: (0.0, 0, 0.0)}  # (von Mises squared, node, time)
        # Von Mises stress is a norm, so that of a sum is at most the sum of those of the modes.
        unit = von_mises(np.moveaxis(modes.surface_stress, 1, 2))  # (n_nodes, n_modes)
        self._largest = {kind: unit[nodes].max(axis=0, initial=0.0) for kind, nodes in self._kind.items()}

    def add(self, t_s, amplitude):
        """Note the modal amplitudes (k, n) at the times t_s (k,)."""
        t_s, amplitude = np.asarray(t_s), np.asarray(amplitude)
        bound = {kind: np.abs(amplitude) @ self._largest[kind] for kind in self._kind}
        above = np.any([bound[kind] ** 2 > self._best[kind][0] for kind in self._kind], axis=0)
        if not above.any():
            return
        sx, sy, txy = (self._columns @ amplitude[above].T).reshape(3, len(self._node_m), -1)
        squared = sx * (sx - sy) + sy**2 + 3 * txy**2
        for kind, nodes in self._kind.items():
            if not len(nodes):
                continue
            node, k = np.unravel_index(squared[nodes].argmax(), (len(nodes), squared.shape[1]))
            found = squared[nodes[node], k]
            if found > self._best[kind][0]:
                self._best[kind] = (float(found), int(nodes[node]), float(t_s[above][k]))

    def get_state(self):
        """Copy of the state, a dict of arrays, for `set_state`."""
        return {"peak": np.array([self._best[False], self._best[True]])}

    def set_state(self, state):
        """Take a state from `get_state`."""
        self._best = {at_rods: (float(squared), int(node), float(t_s))
                      for at_rods, (squared, node, t_s) in zip((False, True), state["peak"])}

    def result(self, at_rods=False):
        """The peak: {"von_mises_Pa", "x_m", "y_m", "t_s"}."""
        squared, node, t_s = self._best[at_rods]
        x, y = self._node_m[node]
        return {"von_mises_Pa": float(np.sqrt(squared)), "x_m": float(x), "y_m": float(y), "t_s": float(t_s)}


def curvature_operator(system):
    """Function from unknowns u (system.size, n) to curvatures (3, n_nodes, n) at the nodes, in 1/m.

    Curvatures theta_x,x, theta_y,y and theta_x,y + theta_y,x (with theta = grad w in Kirchhoff's theory)
    are least-squares projections of the discontinuous derivatives on continuous biquadratics.
    """
    target = system.basis_w.with_element(skfem.ElementQuad2())
    mass = skfem.BilinearForm(lambda u, v, _: u * v).assemble(target)
    solve = sp.linalg.splu(mass.tocsc()).solve
    rows = _kirchhoff_rows(system, target) if system.theory == "kirchhoff" else _mindlin_rows(system, target)

    def curvature(u):
        return np.array([solve(row @ u)[target.nodal_dofs[0]] for row in rows])

    return curvature


def _kirchhoff_rows(system, target):
    def moments(i, j, factor):
        matrix = skfem.BilinearForm(lambda u, v, _: factor * dd(u)[i, j] * v).assemble(system.basis_w, target)
        return sp.csr_array(matrix)[:, system.order_w]

    return [moments(0, 0, 1.0), moments(1, 1, 1.0), moments(0, 1, 2.0)]


def _mindlin_rows(system, target):
    derivative = [
        skfem.BilinearForm(lambda u, v, _, i=i: grad(u)[i] * v).assemble(system.rotation_basis, target) for i in (0, 1)
    ]
    zero_w, zero_t = (sp.csr_array((target.N, b.N)) for b in (system.basis_w, system.rotation_basis))
    blocks = [(derivative[0], zero_t), (zero_t, derivative[1]), (derivative[1], derivative[0])]
    return [sp.csr_array(sp.hstack([zero_w, *block])) for block in blocks]


def modal_surface_stress(system, u):
    """Stress (n_nodes, 3, n) at the top surface for each column of unknowns u (system.size, n)."""
    plate = system.plate
    nu = plate.poisson_ratio
    kx, ky, kxy = curvature_operator(system)(u)
    scale = -plate.youngs_modulus_Pa * plate.thickness_m / 2 / (1 - nu**2)  # in-plane displacement is -z theta
    return scale * np.stack([kx + nu * ky, ky + nu * kx, (1 - nu) / 2 * kxy], axis=1)
