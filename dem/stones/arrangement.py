"""The list of what falls, from every way in which a scene can say it."""

from __future__ import annotations

import numpy as np

from common.scene.scene import Scene
from common.scene.stones import COAL, GANGUE, By, EachStone
from common.tables import InputError
from dem.stones.drawn import drawn_stones, scattered, shared_packings
from dem.stones.stone import UPRIGHT, Flying, Stone, gap_to_box_m, reach_m

OWN_PACKINGS = 10  # stones of a volley that have a packing each; more share some, as drawn ones do


def stones_of(scene: Scene, file: str) -> list[Stone]:
    """Resolve what falls. Everything downstream goes by this list.

    Raises InputError if the ratio asks for part of a stone, if stones overlap where they enter, or if one misses the
    plate.
    """
    table = scene.stones
    if table.drawn is not None:
        stones = drawn_stones(scene, file)
    elif table.each is not None:
        stones = [_one(scene, k, one) for k, one in enumerate(table.each)]
    else:
        stones = _volley(scene, file)
    if scene.scatter.drawn:
        stones = scattered(scene, stones, file)
    _check_motion(scene, stones, file)
    _check_walls(scene, stones, file)
    if table.drawn is None:  # whose places were drawn so
        _check_places(scene, stones, file)
    return stones


def gangue_ratio(scene: Scene, stones: list[Stone], mass_kg: np.ndarray, by: By | None = None) -> float:
    """The share of gangue that falls, by mass, by number, or by what the scene's mixing ratio is a share of."""
    drawn = scene.stones.drawn
    by = by or ("number" if drawn is None else drawn.gangue_by)
    weight = mass_kg if by == "mass" else np.ones(len(stones))
    return float(weight @ [scene.kind_of(stone.material) == "gangue" for stone in stones] / weight.sum())


def _one(scene: Scene, k: int, one: EachStone) -> Stone:
    """One of stones that are given one by one."""
    speed = one.speed_m_s
    velocity = one.velocity_m_s if speed is None else tuple(speed * d for d in scene.down)
    assert velocity is not None
    return Stone(material=one.material, radius_m=one.radius_m, place_m=one.place_m,
                 velocity_m_s=velocity,  # type: ignore[arg-type]
                 seed=scene.stones.seed + k if one.seed is None else one.seed, gap_m=scene.stones.gap_m,
                 arrival_s=one.arrival_s, spin_rad_s=one.spin_rad_s, attitude=one.attitude or UPRIGHT, shape=one.shape)


def _volley(scene: Scene, file: str) -> list[Stone]:
    """Equal stones on a circle or on given places."""
    table, speed = scene.stones, scene.stones.speed_m_s
    assert table.gangue_ratio is not None and table.count is not None and table.radius_m is not None
    assert speed is not None
    n_gangue = table.gangue_ratio * table.count
    if abs(n_gangue - round(n_gangue)) > 1e-9:
        raise InputError(f"{file}: stones.gangue_ratio = {table.gangue_ratio}: with {table.count} stones it must be "
                         f"a multiple of 1/{table.count}")
    chosen, (dx, dy, dz) = set(table.gangue_order[:round(n_gangue)]), scene.down
    # A place keeps its packing whatever its material, so that a sweep changes the material alone.
    seeds, attitudes = shared_packings(scene, table.count) if table.agglomerate and table.count > OWN_PACKINGS else (
        [table.seed + k for k in range(table.count)], [UPRIGHT] * table.count)
    return [Stone(material=GANGUE if k + 1 in chosen else COAL, radius_m=table.radius_m,
                  place_m=(float(place[0]), float(place[1])), velocity_m_s=(speed * dx, speed * dy, speed * dz),
                  seed=seeds[k], gap_m=table.gap_m, attitude=attitudes[k], flaw_seed=table.seed + k)
            for k, place in enumerate(_positions(scene))]


def _positions(scene: Scene) -> np.ndarray:
    stones = scene.stones
    if stones.positions_m is not None:
        return np.array(stones.positions_m)
    assert stones.count is not None and stones.circle_radius_m is not None
    angle = 2 * np.pi * np.arange(stones.count) / stones.count
    return stones.circle_radius_m * np.column_stack([np.cos(angle), np.sin(angle)])


def _check_motion(scene: Scene, stones: list[Stone], file: str) -> None:
    """Every stone comes down, by its speed or by gravity."""
    for k, stone in enumerate(stones):
        slow = stone.velocity_m_s[2] == 0
        if slow and (scene.time.gravity_m_s2 == 0 or stone.arrival_s > 0):
            raise InputError(f"{file}: stones.{_speed_key(scene, k)} = {stone.speed_m_s:g}: must be above 0 towards "
                             "the plate where there is no time.gravity_m_s2, or an arrival_s: the stone would not come")


def _speed_key(scene: Scene, k: int) -> str:
    table = scene.stones
    if table.each is not None:
        return f"each.{k}." + ("speed_m_s" if table.each[k].velocity_m_s is None else "velocity_m_s")
    if table.drawn is None:
        return "speed_m_s"
    return "drawn." + ("speed_m_s" if table.drawn.speed_m_s is not None else "drop_height_m")


def _check_walls(scene: Scene, stones: list[Stone], file: str) -> None:
    for edge, box_m in scene.plate.wall_boxes_m.items():
        for k, stone in enumerate(stones):
            if gap_to_box_m(scene, stone, box_m) < 0:
                raise InputError(f"{file}: plate.wall_height_m.{edge}: stone {k + 1}, which touches the plate at "
                                 f"({stone.place_m[0]:.4g}, {stone.place_m[1]:.4g}) m, would come through this wall: "
                                 "its path must pass beside or above it, by the footprint, the height of the wall or "
                                 "the velocity")


def _check_places(scene: Scene, stones: list[Stone], file: str) -> None:
    half = np.array([scene.plate.length_m, scene.plate.width_m]) / 2
    flying = Flying(scene)
    for k, stone in enumerate(stones):
        if np.any(np.abs(stone.place_m) > half):
            raise InputError(f"{file}: stones.{_place_key(scene, k, stone)}: stone {k + 1} misses the plate, which "
                             f"reaches to x = {half[0]:g} m and y = {half[1]:g} m")
        other, gap = flying.nearest(stone)
        if gap < 0:
            least = reach_m(scene, stones[other]) + reach_m(scene, stone)
            equal = len({stone.radius_m for stone in stones}) == 1
            raise InputError(f"{file}: stones.{_place_key(scene, k, stone)}: stones {other + 1} and {k + 1} overlap, "
                             f"their centres must be at least {'2 radius_m' if equal else 'the sum of their radii'} = "
                             f"{least:g} m apart")
        flying.add(stone)


def _place_key(scene: Scene, k: int, stone: Stone) -> str:
    place = f"({stone.place_m[0]:g}, {stone.place_m[1]:g})"
    if scene.stones.positions_m is not None:
        return f"positions_m.{k} = {place}"
    if scene.stones.circle_radius_m is not None:
        return f"circle_radius_m = {scene.stones.circle_radius_m:g}"
    return f"each.{k}.place_m = {place}"
