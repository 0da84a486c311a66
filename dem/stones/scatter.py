"""What each stone has of its own, by the scene's `[scatter]`: drawn after all else is known, each quantity from its own
random stream, so that a change of one leaves the others as they are."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np

from common.distribution import Distribution
from common.scene import Scene
from common.tables import InputError
from dem.stones.paths import Flying
from dem.stones.stone import Stone

PLACE_TRIES = 1000
MOST_SUBSTANCES = 500  # the deck has a number for each pair of them
ONE, NOTHING = Distribution(value=1.0), Distribution(value=0.0)


def scattered(scene: Scene, stones: list[Stone], file: str) -> list[Stone]:
    """The stones with what they have of their own. Raises InputError where they find no place."""
    table, count = scene.scatter, len(stones)

    def drawn(key: str, otherwise: Distribution) -> list[float]:
        return (getattr(table, key) or otherwise).draw(count, _rng(scene, key)).tolist()

    own = zip(stones, *(drawn(key, ONE) for key in ("radius_factor", "density_factor", "youngs_modulus_factor",
                                                    "strength_factor", "speed_factor")),
              drawn("restitution", NOTHING), drawn("arrival_s", NOTHING))
    stones = [replace(
        stone, radius_m=radius * stone.radius_m, density_factor=density, youngs_modulus_factor=modulus,
        strength_factor=strength * stone.strength_factor, restitution=restitution,
        velocity_m_s=tuple(speed * v for v in stone.velocity_m_s),
        arrival_s=stone.arrival_s + arrival)
        for stone, radius, density, modulus, strength, speed, restitution, arrival in own]
    if len({stone.substance for stone in stones}) > MOST_SUBSTANCES:
        raise InputError(f"{file}: scatter: {count} stones of as many moduli or restitutions; must be at most "
                         f"{MOST_SUBSTANCES}, each of which is a type of particle")
    return stones if table.place_m is None else _moved(scene, stones, table.place_m, file)


def _rng(scene: Scene, quantity: str) -> np.random.Generator:
    seed = scene.stones.seed if scene.scatter.seed is None else scene.scatter.seed
    return np.random.default_rng([seed, zlib.crc32(b"scatter"), zlib.crc32(quantity.encode())])


def _moved(scene: Scene, stones: list[Stone], disc_m: float, file: str) -> list[Stone]:
    """Each stone somewhere in a disc about its place, where it is wholly above the plate and meets none that flies."""
    half, rng = np.array([scene.plate.length_m, scene.plate.width_m]) / 2, _rng(scene, "place_m")
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
