"""The contact of stones with the plate as smooth spheres: its law, and the file that the engine reads it from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.hertz import contact_modulus_Pa
from common.scene import PLATE, Scene, contact_key
from dem.deck.restitution import damping_ratio
from dem.deck.time_step import Body, body_of
from dem.stones.assembly import Assembly
from dem.stones.contact_patch import PATCH_RADIUS
from plate_fem.contact_stress import YIELD_PRESSURE

OUTSIDE = 0.05  # of a stone's radius: more than its smooth surface lies outside its sub-spheres


@dataclass(frozen=True)
class SmoothLaw:
    """Contact of a smooth sphere with the plate (docs/contact.md).

    E* and G* in Pa; the damping ratio of the dashpot that gives the restitution; friction; the pressure in the middle
    of the contact at which stone or plate gives way, Pa, 0 where neither does.
    """

    modulus_Pa: float
    shear_modulus_Pa: float
    damping_ratio: float
    friction: float
    yield_pressure_Pa: float


def smooth_law(scene: Scene, body: Body, mass_kg: float, compliance_m_N: float) -> SmoothLaw:
    """The law of one stone, with the compliance of its patch."""
    material = body.material
    bodies, contact = (scene.materials[material], scene.plate), scene.contacts[contact_key(material, PLATE)]
    shear_compliance = sum(2 * (2 - b.poisson_ratio) * (1 + b.poisson_ratio) / b.youngs_modulus_Pa for b in bodies)
    modulus = contact_modulus_Pa(*bodies)
    damping = damping_ratio(contact.restitution, 4 / 3 * modulus * body.radius_m**0.5, mass_kg, body.speed_m_s,
                            compliance_m_N)
    plate_limit = None if scene.plate.yield_stress_Pa is None else YIELD_PRESSURE * scene.plate.yield_stress_Pa
    limits = [limit for limit in (scene.materials[material].contact_strength_Pa, plate_limit) if limit is not None]
    return SmoothLaw(modulus, 1 / shear_compliance, damping, contact.friction, min(limits, default=0.0))


class _Laws:
    """The laws of the stones of a scene. The damping ratio, which takes a while to find, is the same for stones of one
    material and impact speed whatever their size, and the compliance of a patch hardly changes it: the first stone of a
    material and a speed, to 1 %, serves for all."""

    def __init__(self, scene: Scene, assembly: Assembly):
        self._scene, self._assembly, self._start = scene, assembly, np.cumsum([0, *assembly.sizes])
        self._known: dict[tuple[str, str], SmoothLaw] = {}

    def of(self, index: int) -> SmoothLaw:
        """The law of the stone `index`."""
        body = body_of(self._assembly.stones[index], self._assembly.gravity_m_s2)
        key = (body.material, f"{body.speed_m_s:.2e}")
        if key not in self._known:
            compliance = self._assembly.surfaces[index].first.normal_m_N
            here = slice(self._start[index], self._start[index + 1])
            mass = float(self._assembly.mass_kg[here].sum())
            self._known[key] = smooth_law(self._scene, body, mass, compliance)
        return self._known[key]


def contact_rows(scene: Scene, assembly: Assembly) -> np.ndarray:
    """(stones, 11) numbers of the engine's SmoothStone, from the radius on."""
    laws = _Laws(scene, assembly)
    rows = []
    for k, (surface, stone) in enumerate(zip(assembly.surfaces, assembly.stones, strict=True)):
        law, radius = laws.of(k), stone.radius_m
        rows.append([radius, PATCH_RADIUS * radius, law.modulus_Pa, law.shear_modulus_Pa, law.damping_ratio,
                     law.friction, law.yield_pressure_Pa, surface.first.normal_m_N, surface.other.normal_m_N,
                     surface.first.tangential_m_N, surface.other.tangential_m_N])
    return np.array(rows, dtype=float)


def write_surfaces(file: Path, scene: Scene, assembly: Assembly) -> None:
    """Write the file that dem/engine/stone_surface.h describes."""
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
