"""The list of what falls, from every way in which a scene can say it."""

from __future__ import annotations

import numpy as np

from common.scene import Scene
from common.tables import InputError
from dem.stones.stone import Entry, Stone, entry_of


def stones_of(scene: Scene, file: str) -> list[Stone]:
    """Resolve what falls. Everything downstream goes by this list.

    Raises InputError if the ratio asks for part of a stone, if stones overlap where they enter, or if one misses the
    plate.
    """
    stones = _volley(scene, file)
    _check_places(scene, stones, file)
    return stones


def _volley(scene: Scene, file: str) -> list[Stone]:
    """Equal stones on a circle or on given places."""
    table = scene.stones
    n_gangue = table.gangue_ratio * table.count
    if abs(n_gangue - round(n_gangue)) > 1e-9:
        raise InputError(f"{file}: stones.gangue_ratio = {table.gangue_ratio}: with {table.count} stones it must be "
                         f"a multiple of 1/{table.count}")
    chosen = set(table.gangue_order[:round(n_gangue)])
    # A place keeps its seed whatever its material, so that a sweep changes the material alone.
    return [Stone(material=table.gangue if k + 1 in chosen else table.coal, radius_m=table.radius_m,
                  place_m=(float(place[0]), float(place[1])), velocity_m_s=(0.0, 0.0, -table.speed_m_s),
                  seed=table.seed + k, gap_m=table.gap_m, arrival_s=table.arrival_s[k] if table.arrival_s else 0.0,
                  strength_factor=table.strength_factor[k] if table.strength_factor else 1.0)
            for k, place in enumerate(_positions(scene))]


def _positions(scene: Scene) -> np.ndarray:
    stones = scene.stones
    if stones.positions is not None:
        return np.array([[place.x_m, place.y_m] for place in stones.positions])
    angle = 2 * np.pi * np.arange(stones.count) / stones.count
    return stones.circle_radius_m * np.column_stack([np.cos(angle), np.sin(angle)])


def _check_places(scene: Scene, stones: list[Stone], file: str) -> None:
    half = np.array([scene.plate.length_m, scene.plate.width_m]) / 2
    gravity = scene.gravity_vector_m_s2
    for k, stone in enumerate(stones):
        if np.any(np.abs(stone.place_m) > half):
            raise InputError(f"{file}: stones.{_place_key(scene, k, stone)}: stone {k + 1} misses the plate, which "
                             f"reaches to x = {half[0]:g} m and y = {half[1]:g} m")
    entries = [entry_of(stone, gravity) for stone in stones]
    radius, entry_s, until = (np.array(column) for column in (
        [s.radius_m for s in stones], [e.entry_s for e in entries], [s.arrival_s for s in stones]))
    for k, stone in enumerate(stones):
        # Those that fly when it enters. Where they are after their touch is not known here.
        there = np.flatnonzero((entry_s[:k] <= entry_s[k]) & ((until[:k] > entry_s[k]) | (entry_s[k] == 0)))
        if not len(there):
            continue
        center = np.array([_center_m(stones[i], entries[i], gravity, entry_s[k]) for i in there])
        distance = np.linalg.norm(center - _center_m(stone, entries[k], gravity, entry_s[k]), axis=1)
        gap = distance - radius[there] - stone.radius_m
        if gap.min() < 0:
            other, least = there[gap.argmin()], radius[there[gap.argmin()]] + stone.radius_m
            raise InputError(f"{file}: stones.{_place_key(scene, k, stone)}: stones {other + 1} and {k + 1} overlap, "
                             f"their centres must be at least {_sum_of_radii(stones)}{least:g} m apart")


def _sum_of_radii(stones: list[Stone]) -> str:
    return "2 radius_m = " if len({stone.radius_m for stone in stones}) == 1 else "the sum of their radii, "


def _place_key(scene: Scene, k: int, stone: Stone) -> str:
    if scene.stones.positions is None:
        return f"circle_radius_m = {scene.stones.circle_radius_m:g}"
    return f"positions.{k} = ({stone.place_m[0]:g}, {stone.place_m[1]:g})"


def _center_m(stone: Stone, entry: Entry, gravity: tuple[float, float, float], t_s: float) -> np.ndarray:
    """(3,) centre of a stone on its path, above the plane in which the centres of touching stones of no size lie."""
    flown = t_s - entry.entry_s
    ahead = [v * flown + 0.5 * g * flown**2 for v, g in zip(entry.velocity_m_s, gravity)]
    return np.array([*stone.place_m, stone.radius_m]) + entry.offset_m + ahead
