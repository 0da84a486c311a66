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
        distance = [np.hypot(*(self._node_m - (rod.x_m, rod.y_m)).T) - rod.diameter_m for rod in rods]
        near = np.array([d < 0 for d in distance]).any(axis=0) if rods else np.zeros(len(self._node_m), bool)
        self._kind = {False: np.flatnonzero(~near), True: np.flatnonzero(near)}
        self._best = {False: (0.0, 0, 0.0), True: (0.0, 0, 0.0)}  # (von Mises squared, node, time)
        # Von Mises stress is a norm, so that of a sum is at most the sum of those of the modes.
        unit = von_mises(np.moveaxis(modes.surface_stress, 1, 2))  # (n_nodes, n_modes)
        self._largest = {kind: unit[nodes].max(axis=0, initial=0.0) for kind, nodes in self._kind.items()}

    def add(self, t_s: np.ndarray, amplitude: np.ndarray) -> None:
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

    def get_state(self) -> dict[str, np.ndarray]:
        """Return a copy of the state, for `set_state`."""
        return {"peak": np.array([self._best[False], self._best[True]])}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Take a state from `get_state`."""
        self._best = {at_rods: (float(squared), int(node), float(t_s))
                      for at_rods, (squared, node, t_s) in zip((False, True), state["peak"], strict=True)}

    def result(self, at_rods: bool = False) -> dict[str, float]:
        """Return the peak: "von_mises_Pa", where it is ("x_m", "y_m") and when ("t_s")."""
        squared, node, t_s = self._best[at_rods]
        x, y = self._node_m[node]
        return {"von_mises_Pa": float(np.sqrt(squared)), "x_m": float(x), "y_m": float(y), "t_s": float(t_s)}
