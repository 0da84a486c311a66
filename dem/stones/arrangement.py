"""Which stone lies where and of what it is made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.scene import Scene
from common.tables import InputError


@dataclass(frozen=True)
class Arrangement:
    """`position_m` (count, 2) of the stones' centres in the plane of the plate, `material` (count,) their names."""

    position_m: np.ndarray
    material: list[str]


def arrange(scene: Scene, file: str) -> Arrangement:
    """Place the stones and share out the gangue.

    Raises InputError if the ratio asks for part of a stone, if stones overlap, or if one misses the plate.
    """
    position = _positions(scene)
    _check_places(scene, position, file)
    stones = scene.stones
    n_gangue = stones.gangue_ratio * stones.count
    if abs(n_gangue - round(n_gangue)) > 1e-9:
        raise InputError(f"{file}: stones.gangue_ratio = {stones.gangue_ratio}: with {stones.count} stones it must be "
                         f"a multiple of 1/{stones.count}")
    chosen = set(stones.gangue_order[:round(n_gangue)])
    material = [stones.gangue if k + 1 in chosen else stones.coal for k in range(stones.count)]
    return Arrangement(position, material)


def _positions(scene: Scene) -> np.ndarray:
    stones = scene.stones
    if stones.positions is not None:
        return np.array([[place.x_m, place.y_m] for place in stones.positions])
    angle = 2 * np.pi * np.arange(stones.count) / stones.count
    return stones.circle_radius_m * np.column_stack([np.cos(angle), np.sin(angle)])


def _check_places(scene: Scene, position: np.ndarray, file: str) -> None:
    circle = scene.stones.positions is None
    half = np.array([scene.plate.length_m, scene.plate.width_m]) / 2
    for k, place in enumerate(position):
        key = (f"circle_radius_m = {scene.stones.circle_radius_m:g}" if circle else
               f"positions.{k} = ({place[0]:g}, {place[1]:g})")
        if np.any(np.abs(place) > half):
            raise InputError(f"{file}: stones.{key}: stone {k + 1} misses the plate, which reaches to "
                             f"x = {half[0]:g} m and y = {half[1]:g} m")
        distance = np.linalg.norm(position[:k] - place, axis=1)
        if k and distance.min() < 2 * scene.stones.radius_m:
            raise InputError(f"{file}: stones.{key}: stones {distance.argmin() + 1} and {k + 1} overlap, "
                             f"their centres must be at least 2 radius_m = {2 * scene.stones.radius_m:g} m apart")
