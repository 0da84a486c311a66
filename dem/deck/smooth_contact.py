"""The contact of stones with the plate as smooth spheres: its law, and the file that the engine reads it from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.hertz import contact_modulus_Pa
from common.scene.scene import Scene
from dem.deck.restitution import damping_ratio, elastic_damping_ratio
from dem.stones.assembly import Assembly
from dem.stones.contact_patch import PATCH_RADIUS
from dem.stones.substance import Substance, material_of, plate_contact
from plate_fem.contact_stress import YIELD_PRESSURE

OUTSIDE = 0.05  # of a stone's radius: more than its smooth surface lies outside its sub-spheres


@dataclass(frozen=True)
class SmoothLaw:
    """Contact of a smooth sphere with the plate (docs/contact.md).

    E* and G* in Pa; the damping ratio of the dashpot that gives the restitution, and that of the one across, which is
    LIGGGHTS' own; friction; the pressure in the middle
    of the contact at which stone or plate gives way, Pa, 0 where neither does.
    """

    modulus_Pa: float
    shear_modulus_Pa: float
    damping_ratio: float
    damping_ratio_across: float
    friction: float
    yield_pressure_Pa: float


def smooth_law(scene: Scene, substance: Substance) -> SmoothLaw:
    """The law of a stone of one substance."""
    material, contact = material_of(scene, substance), plate_contact(scene, substance)
    bodies = (material, scene.plate)
    shear_compliance = sum(2 * (2 - b.poisson_ratio) * (1 + b.poisson_ratio) / b.youngs_modulus_Pa for b in bodies)
    modulus = contact_modulus_Pa(*bodies)
    plate_limit = None if scene.plate.yield_stress_Pa is None else YIELD_PRESSURE * scene.plate.yield_stress_Pa
    limits = [limit for limit in (material.contact_strength_Pa, plate_limit) if limit is not None]
    return SmoothLaw(modulus, 1 / shear_compliance, damping_ratio(contact.restitution),
                     elastic_damping_ratio(contact.restitution), contact.friction, min(limits, default=0.0))


def contact_rows(scene: Scene, assembly: Assembly) -> np.ndarray:
    """(stones, 12) numbers of the engine's SmoothStone, from the radius on."""
    laws = {substance: smooth_law(scene, substance) for substance in assembly.substances}
    rows = []
    for surface, stone in zip(assembly.surfaces, assembly.stones, strict=True):
        law, radius = laws[stone.substance], stone.radius_m
        rows.append([radius, PATCH_RADIUS * radius, law.modulus_Pa, law.shear_modulus_Pa, law.damping_ratio,
                     law.damping_ratio_across, law.friction, law.yield_pressure_Pa, surface.first.normal_m_N,
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
