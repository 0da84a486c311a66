"""The list of what falls, from every way in which a scene can say it; and what each stone of any way has of its own
(`[scatter]`).

Of what is drawn, each quantity has a random stream of its own, so that a change of one leaves the others as they are:
at another mixing ratio the same stones fall at the same places, and only their material changes.
"""

import zlib
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from common.scene.distribution import Distribution, one_value
from common.scene.scene import Scene
from common.scene.stones import COAL, GANGUE, MOST_STONES, By, DrawnTable, EachStone
from common.tables import InputError
from dem.stones.stone import UPRIGHT, Flying, Stone, Substance, gap_to_box_m, reach_m, substances_of

PLACE_TRIES = 1000
ROUNDING = 1e-9  # of a radius, by which places that are written in decimals may overlap
PACKINGS = 8  # of each shape, which stones share: to find one takes longer than many an impact
MOST_SUBSTANCES = 500  # the deck has a number for each pair of them
ONE, NOTHING = one_value(1.0), one_value(0.0)


def drawn_stones(scene: Scene, file: str) -> list[Stone]:
    """The stones of `stones.drawn`, by the time of arrival. Raises InputError where they find no place, or are too
    many."""
    table, seed = scene.stones.drawn, scene.stones.seed
    assert table is not None
    rng = partial(_rng, seed)
    size_m = table.size_m.draw(_count(scene, table, file), rng("size"))
    gangue, count = _gangue(scene, table, size_m), len(size_m)
    arrival_s = np.sort(table.arrival_s.draw(count, rng("arrival")))
    fall = table.speed_m_s or table.drop_height_m
    assert fall is not None
    speed = fall.draw(count, rng("speed"))
    if table.speed_m_s is None:
        speed = np.sqrt(2 * scene.time.gravity_m_s2 * speed)
    of_spin = rng("spin")
    axis = of_spin.normal(size=(count, 3))
    spin = table.spin_rad_s.draw(count, of_spin)[:, None] * axis / np.linalg.norm(axis, axis=1)[:, None]
    packing, attitude = shared_packings(scene, count)
    shapes, substances = scene.falling_shapes, substances_of(scene)
    shape = rng("shape").integers(len(shapes), size=count)
    stones = [Stone(substance=substances[GANGUE if gangue[k] else COAL], radius_m=float(size_m[k]) / 2,
                    place_m=(0.0, 0.0), velocity_m_s=scene.down(float(speed[k])),
                    seed=packing[k], gap_m=scene.stones.gap_m, arrival_s=float(arrival_s[k]),
                    spin_rad_s=tuple(spin[k].tolist()), attitude=attitude[k],
                    shape=shapes[shape[k]], flaw_seed=seed + k) for k in range(count)]
    return _placed(scene, stones, table, rng("place"), file)


def shared_packings(scene: Scene, count: int) -> tuple[list[int], list[tuple[float, float, float, float]]]:
    """Seeds and attitudes of so many stones that share PACKINGS packings, turned at random."""
    seed = scene.stones.seed
    packing = _rng(seed, "packing").integers(PACKINGS, size=count)
    turns = Rotation.random(count, random_state=_rng(seed, "attitude")).as_quat().tolist()
    return (seed + packing).tolist(), [(w, x, y, z) for x, y, z, w in turns]


def _rng(seed: int, *quantity: str) -> np.random.Generator:
    """Random numbers of one quantity alone."""
    return np.random.default_rng([seed, *(zlib.crc32(word.encode()) for word in quantity)])


def _gangue(scene: Scene, table: DrawnTable, size_m: np.ndarray) -> np.ndarray:
    """(count,) bool: which stones are gangue. In a random order, each one is that fits below the mixing ratio, and then
    the one more that brings the share nearest to it, if any does."""
    ratio, count = scene.stones.gangue_ratio, len(size_m)
    assert ratio is not None
    order = _rng(scene.stones.seed, "material").permutation(count)
    gangue, coal = (np.ones(count) if table.gangue_by == "number" else size_m**3 * scene.materials[name].density_kg_m3
                    for name in (GANGUE, COAL))
    which, of_gangue, of_coal = np.zeros(count, dtype=bool), 0.0, float(coal.sum())

    def share_with(k: int) -> float:
        more = of_gangue + float(gangue[k])
        return more / (more + max(0.0, of_coal - float(coal[k])))

    for k in order:
        if share_with(k) <= ratio + 1e-12:
            which[k], of_gangue, of_coal = True, of_gangue + float(gangue[k]), max(0.0, of_coal - float(coal[k]))
    if left := [k for k in order if not which[k]]:
        best = min(left, key=lambda k: abs(share_with(k) - ratio))
        which[best] = abs(share_with(best) - ratio) < abs(of_gangue / (of_gangue + of_coal) - ratio)
    return which


def _count(scene: Scene, table: DrawnTable, file: str) -> int:
    """How many stones. A stream by mass goes on until its mass has been drawn."""
    if scene.stones.count is not None:
        return scene.stones.count
    ratio, materials = scene.stones.gangue_ratio, scene.materials
    assert ratio is not None
    if table.rate_1_s is not None:
        count = round(table.rate_1_s * table.lasts_s)
        key = f"rate_1_s = {table.rate_1_s:g}"
    else:
        assert table.rate_kg_s is not None
        coal, gangue = (materials[name].density_kg_m3 for name in (COAL, GANGUE))
        density = 1 / (ratio / gangue + (1 - ratio) / coal)
        size_m = table.size_m.draw(MOST_STONES + 1, _rng(scene.stones.seed, "size"))
        mass = np.cumsum(density * np.pi / 6 * size_m**3)
        count = int(np.abs(mass - table.rate_kg_s * table.lasts_s).argmin()) + 1
        key = f"rate_kg_s = {table.rate_kg_s:g}"
    if not 1 <= count <= MOST_STONES:
        raise InputError(f"{file}: stones.drawn.{key}: leads to {count} stones in {table.lasts_s:g} s; must be "
                         f"from 1 to {MOST_STONES}")
    return count


def _placed(scene: Scene, stones: list[Stone], table: DrawnTable, rng: np.random.Generator,
            file: str) -> list[Stone]:
    """Each stone on a random place where it meets none that flies when it enters. Raises InputError."""
    low, high = _footprint(scene, stones, table, f"{file}: stones.drawn")
    flying, placed = Flying(scene), []
    for k in np.argsort([stone.arrival_s for stone in stones], kind="stable"):
        for _ in range(PLACE_TRIES):
            one = replace(stones[k], place_m=tuple(rng.uniform(low, high).tolist()))
            if flying.nearest(one)[1] >= 0:
                break
        else:
            raise InputError(f"{file}: stones.drawn.footprint_m: {len(stones)} stones find no place on it; must be "
                             "larger, or the stones fewer, smaller or further apart in time")
        flying.add(one)
        placed.append((k, one))
    return [one for _, one in sorted(placed, key=lambda pair: pair[0])]


def _footprint(scene: Scene, stones: list[Stone], table: DrawnTable, where: str) -> tuple[np.ndarray, np.ndarray]:
    half = np.array(scene.plate.size_m) / 2
    if table.footprint_m is not None:
        x, y = table.footprint_m
        if max(map(abs, x)) > half[0] or max(map(abs, y)) > half[1]:
            raise InputError(f"{where}.footprint_m = {x}, {y}: must lie on the plate, which reaches to x = "
                             f"{half[0]:g} m and y = {half[1]:g} m")
        return np.array([x[0], y[0]]), np.array([x[1], y[1]])
    half = half - max(stone.radius_m for stone in stones)
    if half.min() <= 0:
        raise InputError(f"{where}.size_m = {table.size_m.bounds[1]:g}: must be smaller than the plate")
    return -half, half


def scattered(scene: Scene, stones: list[Stone], file: str) -> list[Stone]:
    """The stones with what they have of their own. Raises InputError where they find no place."""
    table, count = scene.scatter, len(stones)
    rng = partial(_rng, scene.stones.seed if table.seed is None else table.seed, "scatter")

    def drawn(key: str, otherwise: Distribution) -> list[float]:
        return (getattr(table, key) or otherwise).draw(count, rng(key)).tolist()

    own = zip(stones, *(drawn(key, ONE) for key in ("radius_factor", "density_factor", "youngs_modulus_factor",
                                                    "strength_factor", "speed_factor")),
              drawn("restitution", NOTHING), drawn("arrival_s", NOTHING))
    stones = [replace(
        stone, radius_m=radius * stone.radius_m, density_factor=density,
        substance=replace(stone.substance, youngs_modulus_factor=modulus, restitution=restitution),
        strength_factor=strength * stone.strength_factor,
        velocity_m_s=tuple(speed * v for v in stone.velocity_m_s),
        arrival_s=stone.arrival_s + arrival)
        for stone, radius, density, modulus, strength, speed, restitution, arrival in own]
    if len({stone.substance for stone in stones}) > MOST_SUBSTANCES:
        raise InputError(f"{file}: scatter: {count} stones of as many moduli or restitutions; must be at most "
                         f"{MOST_SUBSTANCES}, each of which is a type of particle")
    return stones if table.place_m is None else _moved(scene, stones, table.place_m, rng("place_m"), file)


def _moved(scene: Scene, stones: list[Stone], disc_m: float, rng: np.random.Generator, file: str) -> list[Stone]:
    """Each stone somewhere in a disc about its place, where it is wholly above the plate and meets none that flies."""
    half = np.array(scene.plate.size_m) / 2
    flying, moved = Flying(scene), dict[int, Stone]()
    for k in np.argsort([stone.arrival_s for stone in stones], kind="stable").tolist():
        for _ in range(PLACE_TRIES):
            distance, angle = disc_m * np.sqrt(rng.uniform()), 2 * np.pi * rng.uniform()
            place = stones[k].place_m + distance * np.array([np.cos(angle), np.sin(angle)])
            moved[k] = replace(stones[k], place_m=tuple(place.tolist()))
            if np.all(np.abs(place) <= half - stones[k].radius_m) and flying.nearest(moved[k])[1] >= 0:
                break
        else:
            raise InputError(f"{file}: scatter.place_m = {disc_m:g}: stone {k + 1} finds no place in this disc about "
                             "its own; must be larger, or the stones fewer, smaller or further apart")
        flying.add(moved[k])
    return [moved[k] for k in range(len(stones))]


OWN_PACKINGS = 10  # stones that have a packing each; more share some, as drawn ones do


def stones_of(scene: Scene, file: str) -> list[Stone]:
    """Resolve what falls. Everything downstream goes by this list.

    Raises InputError if the ratio asks for part of a stone, if stones overlap where they enter, or if one misses the
    plate.
    """
    table = scene.stones
    if table.drawn is not None:
        stones = drawn_stones(scene, file)
    elif table.each is not None:
        seeds, _ = _packings(scene, len(table.each))
        substances = substances_of(scene)
        stones = [_one(scene, k, one, substances[one.material], seeds[k]) for k, one in enumerate(table.each)]
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
    is_gangue = np.array([stone.substance.kind == "gangue" for stone in stones])
    gangue = weight[is_gangue].sum()
    return float(gangue / (gangue + weight[~is_gangue].sum()))  # rounding makes it no more than 1


def _packings(scene: Scene, count: int) -> tuple[list[int], list[tuple[float, float, float, float]]]:
    """Seeds and attitudes: up to OWN_PACKINGS stones have a packing each, more of them share some."""
    if scene.stones.agglomerate and count > OWN_PACKINGS:
        return shared_packings(scene, count)
    return [scene.stones.seed + k for k in range(count)], [UPRIGHT] * count


def _one(scene: Scene, k: int, one: EachStone, substance: Substance, seed: int) -> Stone:
    velocity = one.velocity_m_s
    return Stone(substance=substance, radius_m=one.radius_m, place_m=one.place_m,
                 velocity_m_s=velocity if isinstance(velocity, tuple) else scene.down(velocity),
                 seed=seed, gap_m=scene.stones.gap_m, flaw_seed=scene.stones.seed + k,
                 arrival_s=one.arrival_s, spin_rad_s=one.spin_rad_s, attitude=one.attitude or UPRIGHT, shape=one.shape)


def _volley(scene: Scene, file: str) -> list[Stone]:
    """Equal stones on a circle or on given places."""
    table, speed = scene.stones, scene.stones.speed_m_s
    assert table.gangue_ratio is not None and table.count is not None and table.radius_m is not None
    assert speed is not None and table.positions_m is not None
    n_gangue = table.gangue_ratio * table.count
    if abs(n_gangue - round(n_gangue)) > 1e-9:
        raise InputError(f"{file}: stones.gangue_ratio = {table.gangue_ratio}: with {table.count} stones it must be "
                         f"a multiple of 1/{table.count}")
    chosen = set(table.gangue_order[:round(n_gangue)])
    # A place keeps its packing whatever its material, so that a sweep changes the material alone.
    seeds, attitudes = _packings(scene, table.count)
    substances = substances_of(scene)
    return [Stone(substance=substances[GANGUE if k + 1 in chosen else COAL], radius_m=table.radius_m,
                  place_m=place, velocity_m_s=scene.down(speed),
                  seed=seeds[k], gap_m=table.gap_m, attitude=attitudes[k], flaw_seed=table.seed + k)
            for k, place in enumerate(table.positions_m)]


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
        return f"each.{k}.velocity_m_s"
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
    half = np.array(scene.plate.size_m) / 2
    flying = Flying(scene)
    for k, stone in enumerate(stones):
        if np.any(np.abs(stone.place_m) > half):
            raise InputError(f"{file}: stones.{_place_key(scene, k, stone)}: stone {k + 1} misses the plate, which "
                             f"reaches to x = {half[0]:g} m and y = {half[1]:g} m")
        other, gap = flying.nearest(stone)
        if gap < -ROUNDING * stone.radius_m:
            least = reach_m(scene, stones[other]) + reach_m(scene, stone)
            equal = len({stone.radius_m for stone in stones}) == 1
            raise InputError(f"{file}: stones.{_place_key(scene, k, stone)}: stones {other + 1} and {k + 1} overlap, "
                             f"their centres must be at least {'2 radius_m' if equal else 'the sum of their radii'} = "
                             f"{least:g} m apart")
        flying.add(stone)


def _place_key(scene: Scene, k: int, stone: Stone) -> str:
    key = f"positions_m.{k}" if scene.stones.each is None else f"each.{k}.place_m"
    return f"{key} = ({stone.place_m[0]:g}, {stone.place_m[1]:g})"
