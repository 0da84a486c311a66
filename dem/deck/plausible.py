"""What a scene asks for that no stone or plate can be, or that the model's laws do not hold for, as warnings.

What is refused outright stands with the keys in common/scene/scene.py and common/scene/plate.py.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from common.scene.plate import FlexiblePlate
from common.scene.scene import Scene
from common.scene.stones import KINDS
from dem.stones.assembly import CONTACT_RADIUS_RATIO, Assembly
from dem.stones.bonds import CRACK_AREA
from dem.stones.stone import Body, Stone, substances_of

GRAVITY_m_s2, JUPITER_m_s2 = 9.81, 25.0
DIAMOND_Pa, CORK_kg_m3, RUBBER = 1.22e12, 120.0, 2.0
LEAST_RESOLUTION = 2.3  # fragment size over sub-sphere: down to it, areas are within 10 % of those of finer stones
CRITICAL_SPEED = 0.84  # the laboratory's case `critical_speed`
LARGEST_STRAIN = 0.02  # up to which bonds of small strains are taken to hold
LARGEST_APPROACH = 0.1  # over the radius: up to which Hertz' half-space is taken to hold
IDEAL_STRENGTH = 0.2  # of Young's modulus: of whiskers and of glass fresh from the melt
UNFINISHED, CARRIED = 0.05, 10.0  # of a stone's peak force, and of its weight: more is an impact that goes on
MOST_MISSING = 0.01  # of the impulse


def warnings_of(scene: Scene, falling: Sequence[Stone]) -> list[str]:
    """One line each, which names key, value, limit and the limit's reason. The fastest and the largest stone count,
    whichever they are made of: the ratios of a sweep have one answer."""
    stones, lines = scene.stones, [*_unlikely(scene), *_too_late(scene, falling)]
    fastest = max(stone.speed_m_s for stone in falling)
    speed = max(float(np.hypot(stone.speed_m_s, np.sqrt(2 * scene.time.gravity_m_s2 * stone.gap_m)))
                for stone in falling)
    radius, side_m = max(stone.radius_m for stone in falling), min(scene.plate.size_m)
    if 2 * radius > side_m:
        lines.append(f"stones: a radius of {radius:g} m; the plate's shorter side is {side_m:g} m")
    lines += [f"materials.{name}: no stone is of it; only stones.each names other materials than coal and gangue"
              for name in sorted(set(scene.materials) - set(scene.falling_materials) - set(KINDS))]
    for name, substance in substances_of(scene).items():
        material, table = substance.material, f"materials.{name}"
        strain = speed / float(np.sqrt(material.youngs_modulus_Pa / material.density_kg_m3))
        if stones.agglomerate is not None and strain > LARGEST_STRAIN:
            lines.append(f"stones.speed_m_s = {fastest:g}: strains {name} by about {strain:.2g}, the speed "
                         f"over that of sound in it; the bonds' law is for small strains, to {LARGEST_STRAIN:g}")
        mass = material.density_kg_m3 * 4 / 3 * np.pi * radius**3
        approach = Body(substance.modulus_on_plate_Pa, 1.0, mass, radius, speed).depth_m / radius
        if approach > LARGEST_APPROACH:
            lines.append(f"stones.speed_m_s = {fastest:g}: presses a stone of {name} by {approach:.2g} of "
                         f"its radius; Hertz' contact is for little, to {LARGEST_APPROACH:g}")
        if material.contact_strength_Pa is not None and not scene.has_smooth_contact:
            lines.append(f"{table}.contact_strength_Pa = {material.contact_strength_Pa:g}: counts for agglomerates of "
                         "contact = 'smooth' alone; these stones stay elastic")
        weight_Pa = 2 * material.density_kg_m3 * GRAVITY_m_s2 * radius
        if stones.agglomerate is not None and not stones.agglomerate.unbreakable:
            strength = substance.bond.tensile_strength_Pa
            if strength > IDEAL_STRENGTH * substance.bond.youngs_modulus_Pa:
                lines.append(f"{table}.bond.tensile_strength_Pa = {strength:g}: above {IDEAL_STRENGTH:g} of the bonds' "
                             "Young's modulus, more than a solid without flaws has")
            if strength < weight_Pa:
                lines.append(f"{table}.bond.tensile_strength_Pa = {strength:g}: below {weight_Pa:.3g}, the stress of "
                             "a stone's own weight on earth")
    return lines


def unfinished_warnings(scene: Scene, end_N: np.ndarray, peak_N: np.ndarray, mass_kg: np.ndarray) -> list[str]:
    """Of stones (n,) that the plate pushes away when the run ends, harder than it carries what lies on it."""
    carried_N = CARRIED * scene.time.gravity_m_s2 * mass_kg
    hit = np.flatnonzero(abs(end_N) > np.maximum(UNFINISHED * peak_N, carried_N))
    return [f"time.duration_s = {scene.time.duration_s:g}: ends while stone {hit[0] + 1} hits the plate, one of "
            f"{len(hit)} such; their impulse and rebound are not complete"] if len(hit) else []


def momentum_warnings(missing: float | None) -> list[str]:
    """Of the share of the impulse on the plate that a run misses."""
    if missing is None or missing <= MOST_MISSING:
        return []
    return [f"momentum_missing = {missing:.2g}: this share of the stones' impulse is not in the record of rods, plate "
            f"and damping, at most {MOST_MISSING:g} is right; short contacts need a smaller time.sample_interval_s"]


def breakage_scales(scene: Scene, assembly: Assembly) -> dict[str, list[float | None]]:
    """By their keys in run.json, of each stone, None where bonds snap or never break:

    The size of fragments over the diameter of its sub-spheres, both means. The size is Grady's (1982, J. Appl. Phys.
    53:322), (24 G/(rho rate^2))^(1/3), with the energy G of a crack's area and the rate of strain v/R.
    Its speed across the plate over that at which its largest fragment falls below 0.7 of its mass on a rigid plate,
    CRITICAL_SPEED sqrt(sigma/rho) (G/(sigma R))^0.2 with the bonds' tensile strength sigma: measured on rocks, sizes.
    """
    mean_m = np.bincount(assembly.agglomerate, assembly.radius_m) / assembly.sizes / CONTACT_RADIUS_RATIO
    sizes, speeds = list[float | None](), list[float | None]()
    for stone, radius_m in zip(assembly.stones, mean_m, strict=True):
        bond, table = stone.substance.material.bond, scene.stones.agglomerate
        if table is None or table.unbreakable or bond is None or bond.fracture_energy_J_m2 is None:
            sizes.append(None)
            speeds.append(None)
            continue
        crack = CRACK_AREA * bond.fracture_energy_J_m2 * stone.strength_factor**2
        strength, density = bond.tensile_strength_Pa * stone.strength_factor, stone.density_kg_m3
        speed = max(-stone.velocity_m_s[2], np.sqrt(2 * -assembly.gravity_m_s2[2] * stone.gap_m), 1e-3)
        size_m = (24 * crack / (density * (speed / stone.radius_m) ** 2)) ** (1 / 3)
        critical = CRITICAL_SPEED * np.sqrt(strength / density) * (crack / (strength * stone.radius_m)) ** 0.2
        sizes.append(float(size_m / (2 * radius_m)))
        speeds.append(float(speed / critical))
    return {"fragment_size_over_subsphere": sizes, "speed_over_critical": speeds}


def warnings_of_fragments(scene: Scene, assembly: Assembly) -> list[str]:
    """A line where fragments would be too small for the sub-spheres of their stone."""
    resolved = [(ratio, k) for k, ratio in enumerate(breakage_scales(scene, assembly)["fragment_size_over_subsphere"])
                if ratio is not None]
    ratio, k = min(resolved, default=(np.inf, 0))
    if ratio >= LEAST_RESOLUTION:
        return []
    count = assembly.sizes[k] * (LEAST_RESOLUTION / ratio) ** 3
    return [f"stones.agglomerate.subspheres = {assembly.sizes[k]}: where stone {k + 1} breaks, fragments are of "
            f"{ratio:.2g} sub-spheres; what breaks depends on their number below {LEAST_RESOLUTION:g}, which takes "
            f"{math.ceil(count / 100) * 100}"]


def _too_late(scene: Scene, falling: Sequence[Stone]) -> list[str]:
    pull, end_s = -scene.gravity_vector_m_s2[2], scene.time.duration_s
    late = [k for k, one in enumerate(falling, 1) if (one.arrival_s or 2 * one.gap_m / max(
        -one.velocity_m_s[2] + math.sqrt(one.velocity_m_s[2]**2 + 2 * pull * one.gap_m), 1e-9)) > end_s]
    return [f"time.duration_s = {end_s:g}: ends before stone {late[0]} touches the plate, one of {len(late)} such; the "
            "mixing ratio counts them"] if late else []


def _unlikely(scene: Scene) -> list[str]:
    """Of stiffness, density and friction that no solid of such scenes has."""
    solids: dict[str, Any] = {"plate": scene.plate}
    if isinstance(scene.plate, FlexiblePlate):
        solids |= {f"plate.rods.{number}": rod for number, rod in enumerate(scene.plate.rods)}
    materials = {f"materials.{name}": scene.materials[name] for name in scene.falling_materials}
    solids |= materials
    moduli_Pa = {table: one.youngs_modulus_Pa for table, one in solids.items()}
    if scene.stones.agglomerate is not None:
        moduli_Pa |= {f"{table}.bond": one.bond.youngs_modulus_Pa for table, one in materials.items() if one.bond}
    above = [("time.gravity_m_s2", scene.time.gravity_m_s2, JUPITER_m_s2, "that of Jupiter"),
             *((f"{table}.youngs_modulus_Pa", modulus_Pa, DIAMOND_Pa, "that of diamond, the stiffest material")
               for table, modulus_Pa in moduli_Pa.items()),
             *((f"contacts.{pair}.friction", one.friction, RUBBER, "that of rubber on rough ground")
               for pair, one in scene.contacts.items())]
    return [
        *(f"{key} = {value:g}: above {most:g}, {what}" for key, value, most, what in above if value > most),
        *(f"{table}.density_kg_m3 = {one.density_kg_m3:g}: below {CORK_kg_m3:g}, that of cork"
          for table, one in solids.items() if one.density_kg_m3 < CORK_kg_m3)]
