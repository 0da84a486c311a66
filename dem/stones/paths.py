"""Which stones are on their way at one time, and how near they come to each other where they enter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.scene.scene import Scene
from common.scene.stones import SPHERE
from dem.shapes.solids import solid_of
from dem.stones.stone import Entry, Stone, apex_s, entry_of

LOOKS = 100  # at the path of a stone


class Flying:
    """Stones on their paths, one added after another. Where they are after their touch is not known here."""

    def __init__(self, scene: Scene):
        self._scene, self._gravity = scene, scene.gravity_vector_m_s2
        self._start: list[np.ndarray] = []  # centre where each enters
        self._rows: list[list[float]] = []  # entry_s, arrival_s, velocity (3), radius
        self._array = np.zeros((0, 9))

    def nearest(self, stone: Stone) -> tuple[int, float]:
        """Which of those that fly when a stone enters is nearest to it, and the gap between their spheres, m, negative
        where they overlap; -1 and infinity where none flies."""
        entry = entry_of(stone, self._gravity)
        rows = self._table()
        at_once = (rows[:, 0] == 0) & (entry.entry_s == 0)
        there = np.flatnonzero((rows[:, 0] <= entry.entry_s) & ((rows[:, 1] > entry.entry_s) | at_once))
        if not len(there):
            return -1, float("inf")
        flown = (entry.entry_s - rows[there, 0])[:, None]
        center = rows[there, 6:9] + rows[there, 2:5] * flown + 0.5 * np.array(self._gravity) * flown**2
        gap = np.linalg.norm(center - _center_m(stone, entry), axis=1) - rows[there, 5] - reach_m(self._scene, stone)
        return int(there[gap.argmin()]), float(gap.min())

    def add(self, stone: Stone) -> None:
        """A stone that flies from now on."""
        entry = entry_of(stone, self._gravity)
        self._rows.append([entry.entry_s, stone.arrival_s, *entry.velocity_m_s, reach_m(self._scene, stone),
                           *_center_m(stone, entry)])

    def _table(self) -> np.ndarray:
        """(stones, 9)."""
        if len(self._array) < len(self._rows):
            self._array = np.vstack([self._array, self._rows[len(self._array):]])
        return self._array


def gap_to_box_m(scene: Scene, stone: Stone, box_m: Sequence[float]) -> float:
    """How near the sphere that holds a stone comes to a box (XMIN XMAX YMIN YMAX ZMIN ZMAX) on its way from its entry
    to its touch, at LOOKS points of its path."""
    v, g = np.array(stone.velocity_m_s), np.array(scene.gravity_vector_m_s2)
    tau = np.linspace(0, min(stone.arrival_s, apex_s(stone, scene.gravity_vector_m_s2)), LOOKS)[:, None]
    center = np.array([*stone.place_m, stone.radius_m]) - v * tau + 0.5 * g * tau**2
    low, high = np.array(box_m).reshape(3, 2).T
    return float(np.linalg.norm(center - np.clip(center, low, high), axis=1).min()) - reach_m(scene, stone)


def reach_m(scene: Scene, stone: Stone) -> float:
    """Radius of the sphere about its centre that holds a stone."""
    return stone.radius_m * (1.0 if stone.shape == SPHERE else solid_of(scene.shapes[stone.shape], stone.seed).reach)


def _center_m(stone: Stone, entry: Entry) -> np.ndarray:
    """(3,) centre of a stone where it enters."""
    return np.array([*stone.place_m, stone.radius_m]) + entry.offset_m
