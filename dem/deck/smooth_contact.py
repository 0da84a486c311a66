"""The contact of stones as smooth spheres, with the plate and with each other: its law, and the file for the engine."""

from __future__ import annotations

from itertools import combinations_with_replacement
from pathlib import Path
from typing import NamedTuple

import numpy as np

from common.hertz import contact_modulus_Pa
from common.scene.plate import Plate
from common.scene.scene import ContactTable, MaterialTable, Scene
from dem.deck.restitution import damping_ratio, elastic_damping_ratio
from dem.stones.assembly import Assembly
from dem.stones.contact_patch import PATCH_RADIUS
from dem.stones.substance import material_of, pair_contact, plate_contact
from plate_fem.contact_stress import YIELD_PRESSURE

OUTSIDE = 0.05  # of a stone's radius: more than its smooth surface lies outside its sub-spheres


class SmoothLaw(NamedTuple):
    """Contact of a smooth sphere with the plate or with another one (docs/contact.md).

    E* and G* in Pa; the damping ratio of the dashpot that gives the restitution, and that of the one across, which is
    LIGGGHTS' own; friction; the pressure in the middle of the contact at which one of the two gives way, Pa, 0 where
    neither does.
    """

    modulus_Pa: float
    shear_modulus_Pa: float
    damping_ratio: float
    damping_ratio_across: float
    friction: float
    yield_pressure_Pa: float


def smooth_law(contact: ContactTable, first: MaterialTable, second: MaterialTable | Plate) -> SmoothLaw:
    """The law of a stone of one material, on the plate or on a stone of another material."""
    bodies = (first, second)
    shear_compliance = sum(2 * (2 - b.poisson_ratio) * (1 + b.poisson_ratio) / b.youngs_modulus_Pa for b in bodies)
    limits = [limit for limit in (first.contact_strength_Pa, _strength_Pa(second)) if limit is not None]
    return SmoothLaw(contact_modulus_Pa(first, second), 1 / shear_compliance, damping_ratio(contact.restitution),
                     elastic_damping_ratio(contact.restitution), contact.friction, min(limits, default=0.0))


def _strength_Pa(body: MaterialTable | Plate) -> float | None:
    if isinstance(body, MaterialTable):
        return body.contact_strength_Pa
    return None if body.yield_stress_Pa is None else YIELD_PRESSURE * body.yield_stress_Pa


def pair_laws(scene: Scene, assembly: Assembly) -> list[tuple[int | float, ...]]:
    """Of each pair of types of stones in the deck the types and the numbers of SmoothLaw; none where no two stones can
    touch as smooth ones."""
    if not assembly.surfaces or len(assembly.sizes) < 2:
        return []
    found: list[tuple[int | float, ...]] = []
    types = list(enumerate(assembly.substances, start=1))
    for (i, first), (j, second) in combinations_with_replacement(types, 2):
        contact = pair_contact(scene, first, second)
        if contact is not None:
            found.append((i, j, *smooth_law(contact, material_of(scene, first), material_of(scene, second))))
    return found


def contact_rows(scene: Scene, assembly: Assembly) -> np.ndarray:
    """(stones, 12) numbers of the engine's SmoothStone, from the radius on."""
    laws = {one: smooth_law(plate_contact(scene, one), material_of(scene, one), scene.plate)
            for one in assembly.substances}
    rows = []
    for surface, stone in zip(assembly.surfaces, assembly.stones, strict=True):
        radius = stone.radius_m
        rows.append([radius, PATCH_RADIUS * radius, *laws[stone.substance], surface.first.normal_m_N,
                     surface.other.normal_m_N, surface.first.tangential_m_N, surface.other.tangential_m_N])
    return np.array(rows, dtype=float)


def write_surfaces(file: Path, scene: Scene, assembly: Assembly) -> None:
    """Write the file that dem/engine/smooth/stone_surface.h describes."""
    start, radius_m = np.cumsum([0, *assembly.sizes]), max(stone.radius_m for stone in assembly.stones)
    with open(file, "w") as out:
        out.write(f"{OUTSIDE * radius_m!r}\n")
        if assembly.is_stream:  # each stone brings its own
            out.write(f"stream {PATCH_RADIUS**2 * radius_m / 2!r}\n")
            return
        for k, (surface, numbers) in enumerate(zip(assembly.surfaces, contact_rows(scene, assembly), strict=True)):
            here = slice(start[k], start[k + 1])
            out.write(" ".join([str(assembly.sizes[k]), *(f"{number:.17g}" for number in numbers)]) + "\n")
            rows = [surface.place_m, assembly.radius_m[here], assembly.mass_kg[here], surface.is_surface]
            np.savetxt(out, np.column_stack(rows), fmt=["%.17g"] * 5 + ["%d"])
