"""Bending stress at the top surface of the plate in a state of its modes, and the largest one of a motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from common.scene.plate import Rod
from plate_fem.modes import PlateModes


def surface_stress(modes: PlateModes, amplitude: np.ndarray) -> np.ndarray:
    """Return the stress (n_nodes, 3) in Pa at the top surface, columns sx, sy, txy, for modal amplitudes (n,).

    The bottom has the opposite sign. The local stress under a contact is not included.

    >>> modes = plate_modes(read_plate("scenes/small.toml").model_copy(update={"max_frequency_Hz": 500.0}))
    >>> surface_stress(modes, np.ones(modes.frequency_Hz.size)).shape == (len(modes.node_m), 3)
    True
    """
    return modes.surface_stress @ amplitude


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Return the von Mises stress (...,) of plane stress (..., 3) with columns sx, sy, txy.

    >>> von_mises(np.array([[2e6, 0.0, 0.0], [1e6, 1e6, 0.0]])).tolist()  # along one axis, and along both
    [2000000.0, 1000000.0]
    """
    sx, sy, txy = np.moveaxis(np.asarray(stress), -1, 0)
    return np.sqrt(sx**2 - sx * sy + sy**2 + 3 * txy**2)


class StressPeak:
    """Largest von Mises stress of bending over a motion, at the nodes away from the rods and at those near a rod.

    A node is near a rod when it lies within a diameter of its axis. There the stress is only indicative.
    """

    def __init__(self, modes: PlateModes, rods: Sequence[Rod]) -> None:
        self._node_m = modes.node_m
        n_modes = modes.surface_stress.shape[2]
        self._columns = np.moveaxis(modes.surface_stress, 1, 0).reshape(-1, n_modes)  # all sx, all sy, all txy
        near = np.zeros(len(self._node_m), bool)
        for rod in rods:
            near |= np.hypot(*(self._node_m - (rod.x_m, rod.y_m)).T) < rod.diameter_m
        self._nodes = [np.flatnonzero(~near), np.flatnonzero(near)]
        self._best = np.zeros((2, 3))  # of both: von Mises stress squared, node, time
        # Von Mises stress is a norm, so that of a sum is at most the sum of those of the modes.
        unit = von_mises(np.moveaxis(modes.surface_stress, 1, 2))  # (n_nodes, n_modes)
        self._largest = np.array([unit[nodes].max(axis=0, initial=0.0) for nodes in self._nodes])

    def add(self, t_s: np.ndarray, amplitude: np.ndarray) -> None:
        """Note the modal amplitudes (k, n) at the times t_s (k,)."""
        t_s, amplitude = np.asarray(t_s), np.asarray(amplitude)
        above = ((np.abs(amplitude) @ self._largest.T) ** 2 > self._best[:, 0]).any(axis=1)
        if not above.any():
            return
        sx, sy, txy = (self._columns @ amplitude[above].T).reshape(3, len(self._node_m), -1)
        squared = sx * (sx - sy) + sy**2 + 3 * txy**2
        for best, nodes in zip(self._best, self._nodes, strict=True):
            if len(nodes):
                node, k = np.unravel_index(squared[nodes].argmax(), (len(nodes), squared.shape[1]))
                if squared[nodes[node], k] > best[0]:
                    best[:] = squared[nodes[node], k], nodes[node], t_s[above][k]

    def get_state(self) -> dict[str, np.ndarray]:
        """Return a copy of the state, for `set_state`."""
        return {"peak": self._best.copy()}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Take a state from `get_state`."""
        self._best = np.array(state["peak"])

    def result(self, at_rods: bool = False) -> dict[str, float]:
        """Return the peak: "von_mises_Pa", where it is ("x_m", "y_m") and when ("t_s")."""
        squared, node, t_s = self._best[int(at_rods)]
        x, y = self._node_m[int(node)]
        return {"von_mises_Pa": float(np.sqrt(squared)), "x_m": float(x), "y_m": float(y), "t_s": float(t_s)}
