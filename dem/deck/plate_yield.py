"""Does the plate yield? Asked before the run, to choose the contact law, and after it, to report.

A contact yields below the surface when its peak pressure passes 1.6 yield stresses (Johnson 1985, 6.1), a plate in
bending when the von Mises stress at its surface passes one. The pressure under a sub-sphere is that of a stone as rough
as its packing; finer sub-spheres press harder. The pressure under a smooth stone is reported beside it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from common import hertz
from common.files.parquet import Columns
from common.scene.scene import Scene
from dem.stones.assembly import Assembly
from dem.stones.stone import Stone
from dem.stones.substance import material_of
from plate_fem.contact_stress import YIELD_PRESSURE, HertzContact


def modulus_on_plate_Pa(scene: Scene, stone: Stone) -> float:
    """E* of a stone on the plate."""
    return hertz.contact_modulus_Pa(material_of(scene, stone.substance), scene.plate)


def pressure_bound_Pa(scene: Scene, assembly: Assembly) -> float:
    """Largest peak pressure that an elastic contact could reach: all the energy of a stone in the normal contact of its
    smallest sub-sphere, 8/15 E* sqrt(r) d^(5/2)."""
    pressure, mass, start = 0.0, assembly.stone_mass_kg, np.cumsum([0, *assembly.sizes])
    for k, stone in enumerate(assembly.stones):
        modulus = modulus_on_plate_Pa(scene, stone)
        radius = assembly.radius_m[start[k]:start[k + 1]].min()
        speed2 = stone.speed_m_s**2 - 2 * assembly.gravity_m_s2[2] * stone.gap_m
        energy = 0.5 * mass[k] * speed2
        depth = (energy / (8 / 15 * modulus * np.sqrt(radius))) ** 0.4
        pressure = max(pressure, float(hertz.peak_pressure_Pa(modulus, depth / radius)))
    return pressure


def yield_pressure_Pa(scene: Scene, assembly: Assembly) -> float | None:
    """Pressure at which the wall gives way, or None where the scene gives no yield stress or cannot reach it."""
    if scene.plate.yield_stress_Pa is None:
        return None
    pressure = YIELD_PRESSURE * scene.plate.yield_stress_Pa
    return pressure if pressure_bound_Pa(scene, assembly) > pressure else None


def yield_report(scene: Scene, assembly: Assembly, peak_force_N: np.ndarray, deepest: np.ndarray,
                 bending: dict[str, dict[str, float]]) -> dict[str, Any]:
    """What run.json says of yield.

    peak_force_N (stones,): of each alone. deepest (stones,): largest depth of a contact over the radius of its
    sub-sphere. bending: "bending" and "bending_at_rods" of plate_fem.stress.StressPeak, empty for a rigid plate.
    """

    modulus = np.array([modulus_on_plate_Pa(scene, stone) for stone in assembly.stones])
    pressure = hertz.peak_pressure_Pa(modulus, deepest)
    limit = yield_pressure_Pa(scene, assembly)
    if limit is not None:
        pressure = np.minimum(pressure, limit)
    smooth = [HertzContact(0.0, 0.0, float(force), stone.radius_m, float(e)).peak_pressure_Pa
              for force, stone, e in zip(peak_force_N, assembly.stones, modulus)]
    report: dict[str, Any] = {"yield_stress_Pa": scene.plate.yield_stress_Pa,
              "contact_law": "Hertz" if limit is None else "elastic, perfectly plastic (Thornton 1997)",
              "contact_pressure_Pa": pressure.tolist(), "smooth_stone_pressure_Pa": smooth}
    report |= bending
    return report | {"verdict": _verdict(report)}


def _verdict(report: dict[str, Any]) -> str:
    contact = max(report["contact_pressure_Pa"]) / YIELD_PRESSURE
    bending = report["bending"]["von_mises_Pa"] if "bending" in report else 0.0
    limit = report["yield_stress_Pa"]
    if limit is None:
        return (f"no yield stress given; the contacts stay elastic from {contact / 1e6:.0f} MPa, "
                f"bending from {bending / 1e6:.0f} MPa")
    share = 1 - 1e-9  # a pressure held at the limit is yield
    stones = [k + 1 for k, p in enumerate(report["contact_pressure_Pa"]) if p >= share * YIELD_PRESSURE * limit]
    contacts = f"contacts yield under stones {stones}" if stones else "contacts stay elastic"
    return f"{contacts}; bending {'yields' if bending >= limit else 'stays elastic'}"


def read_contacts(file: Path, dt_s: float) -> Columns:
    """Read the contacts with the plate at each sample: t_s, stone (agglomerate, 1-based), place, elastic normal force,
    radius of the sphere that presses (that of the flattened contact where the plate has yielded)."""
    data, rows, at = np.fromfile(file, dtype="<f8"), [], 0
    heads = data.view("<i8")
    while at < len(data):
        step, n = heads[at:at + 2]
        block = data[at + 2:at + 2 + 5 * n].reshape(n, 5)
        rows.append(np.column_stack([np.full(n, step * dt_s), block]))
        at += 2 + 5 * n
    table = np.vstack(rows) if rows else np.zeros((0, 6))
    names = ["t_s", "agglomerate", "x_m", "y_m", "force_N", "radius_m"]
    columns = dict(zip(names, table.T, strict=True))
    return columns | {"agglomerate": columns["agglomerate"].astype(int)}
