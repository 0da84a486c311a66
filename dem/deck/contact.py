"""The contact of stones, with the plate and with each other: its laws, damping ratios, and the files for the engine
(docs/contact.md).

Stones touch as smooth spheres or by flat faces. A column of height h behind an area A of a face has the stiffness E A/h
of a bar. The plate's half-space gives way under the whole face, of radius a, as under a flat punch, by F/(2 E_p* a).
Under an even pressure an area A has the share A/(pi a^2) of F, so that its part of the plate has the stiffness
2 E_p* A/(pi a).

Does the plate yield? That is asked before the run, to choose the contact law, and after it, to report. A contact
yields below the surface when its peak pressure passes 1.6 yield stresses (Johnson 1985, 6.1), a plate in bending when
the von Mises stress at its surface passes one. The pressure under a sub-sphere is that of a stone as rough as its
packing; finer sub-spheres press harder. The pressure under a smooth stone is reported beside it.
"""

from functools import lru_cache
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from common import hertz
from common.files.parquet import Columns
from common.files.rows import write_rows
from common.scene.plate import Plate
from common.scene.scene import ContactTable, MaterialTable
from dem.stones.assembly import Assembly
from dem.stones.contact_patch import PATCH_RADIUS, FaceColumns, StoneSurface
from plate_fem.stress import YIELD_PRESSURE, HertzContact

OUTSIDE = 0.05  # of a stone's radius: more than its smooth surface lies outside its sub-spheres
NUMBERS = 7  # of a column of a face in its file
MOST_DAMPING = 50.0  # a damping ratio that leaves a restitution below any that a scene may have
PRECISION = 1e-12


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
    return SmoothLaw(hertz.contact_modulus_Pa(first, second), 1 / shear_compliance, damping_ratio(contact.restitution),
                     elastic_damping_ratio(contact.restitution), contact.friction, min(limits, default=0.0))


def _strength_Pa(body: MaterialTable | Plate) -> float | None:
    if isinstance(body, MaterialTable):
        return body.contact_strength_Pa
    return None if body.yield_stress_Pa is None else YIELD_PRESSURE * body.yield_stress_Pa


def pair_laws(assembly: Assembly) -> list[tuple[int | float, ...]]:
    """Of each pair of types of stones in the deck the types and the numbers of SmoothLaw; none where no two stones can
    touch as smooth ones."""
    if not assembly.surfaces or len(assembly.sizes) < 2:
        return []
    found: list[tuple[int | float, ...]] = []
    types = list(enumerate(assembly.substances, start=1))
    for (i, first), (j, second) in combinations_with_replacement(types, 2):
        contact = first.contact_with(second)
        if contact is not None:
            found.append((i, j, *smooth_law(contact, first.material, second.material)))
    return found


def contact_rows(assembly: Assembly) -> np.ndarray:
    """(stones, 12) numbers of the engine's SmoothStone, from the radius on."""
    laws = {one: smooth_law(one.plate_contact, one.material, one.plate) for one in assembly.substances}
    rows = []
    for surface, stone in zip(assembly.surfaces, assembly.stones, strict=True):
        radius = stone.radius_m
        rows.append([radius, PATCH_RADIUS * radius, *laws[stone.substance], *surface.compliance_m_N.T.ravel()])
    return np.array(rows, dtype=float)


def write_surfaces(file: Path, assembly: Assembly) -> None:
    """Write the file that dem/engine/smooth/stone_surface.h describes."""
    start, radius_m = np.cumsum([0, *assembly.sizes]), max(stone.radius_m for stone in assembly.stones)
    with open(file, "wb") as out:
        heights = (patch_height_m(surface, assembly.radius_m[start[k]:start[k + 1]], stone.radius_m)
                   for k, (surface, stone) in enumerate(zip(assembly.surfaces, assembly.stones, strict=True)))
        out.write(f"{OUTSIDE * radius_m!r} {max(heights)!r}\n".encode())
        if assembly.is_stream:  # each stone brings its own
            out.write(b"stream\n")
            return
        for k, (surface, numbers) in enumerate(zip(assembly.surfaces, contact_rows(assembly), strict=True)):
            here = slice(start[k], start[k + 1])
            rows = [surface.place_m, assembly.radius_m[here], assembly.mass_kg[here], surface.is_surface]
            write_rows(out, np.column_stack(rows),
                       " ".join([str(assembly.sizes[k]), *(f"{number:.17g}" for number in numbers)]) + "\n")


def patch_height_m(surface: StoneSurface, radius_m: np.ndarray, stone_radius_m: float) -> float:
    """How far the lowest point of a sub-sphere in a patch, whatever its axis, may be above the plate at first touch."""
    out = np.linalg.norm(surface.place_m[surface.is_surface], axis=1)
    across = np.minimum(out, PATCH_RADIUS * stone_radius_m)
    return float((stone_radius_m - np.sqrt(out**2 - across**2) - radius_m[surface.is_surface]).max())


def column_stiffness_N_m(columns: FaceColumns, stone_modulus_Pa: float, plate_modulus_Pa: float) -> np.ndarray:
    """(k,) of columns in series with their share of the plate; E of the stone, E/(1 - nu^2) of the plate."""
    stone = columns.height_m / stone_modulus_Pa
    plate = np.pi * columns.face_radius_m / (2 * plate_modulus_Pa)
    return np.asarray(columns.area_m2 / (stone + plate))


def stone_columns_N_m(assembly: Assembly, stone: int) -> np.ndarray:
    """(k,) stiffness of the columns of one stone; none where it has no faces."""
    columns = assembly.faces[stone] if assembly.faces else None
    if columns is None:
        return np.zeros(0)
    substance = assembly.stones[stone].substance
    plate_modulus = substance.plate.youngs_modulus_Pa / (1 - substance.plate.poisson_ratio**2)
    return column_stiffness_N_m(columns, substance.material.youngs_modulus_Pa, plate_modulus)


def stiffest_face_N_m(assembly: Assembly) -> float:
    """All columns of one face together, the stiffest of all stones; 0 where there are no faces."""
    stiffest = 0.0
    for k, columns in enumerate(assembly.faces):
        if columns is not None and len(columns.sub_sphere):
            _, face = np.unique(np.round(columns.normal, 6), axis=0, return_inverse=True)
            stiffest = max(stiffest, float(np.bincount(face.ravel(), stone_columns_N_m(assembly, k)).max()))
    return stiffest


def face_rows(assembly: Assembly, stone: int, first: int) -> np.ndarray:
    """(k, 7) rows of dem/engine/contact/face_columns.h; `first`: number, from 0, of the stone's first sub-sphere."""
    columns = assembly.faces[stone]
    if columns is None:
        return np.zeros((0, NUMBERS))
    return np.column_stack([first + columns.sub_sphere + 1, columns.normal, columns.height_m,
                            stone_columns_N_m(assembly, stone), columns.area_m2])


def write_faces(file: Path, assembly: Assembly) -> None:
    """Write the file that dem/engine/contact/face_columns.h describes."""
    start = np.cumsum([0, *assembly.sizes])
    outside = max(float((c.height_m - assembly.radius_m[start[k] + c.sub_sphere]).max(initial=0.0))
                  for k, c in enumerate(assembly.faces) if c is not None)
    with open(file, "wb") as out:
        out.write(f"{outside!r}\n".encode())
        if assembly.is_stream:  # each stone brings its own
            out.write(b"stream\n")
            return
        for k in range(len(assembly.faces)):
            write_rows(out, face_rows(assembly, k, start[k]))


def elastic_damping_ratio(restitution: float) -> float:
    """-ln e / sqrt(ln^2 e + pi^2): of LIGGGHTS' Hertz contact, which ends when the overlap is zero, so that the dashpot
    pulls at last (D. Antypov and J. A. Elliott, EPL 94 (2011) 50004)."""
    log_e = float(np.log(restitution))
    return -log_e / float(np.hypot(log_e, np.pi))


def restitution_of(damping_ratio: float) -> float:
    """Rebound over impact speed of a mass on Hertz' spring with the dashpot 2 sqrt(5/6) zeta sqrt(S m), S = dF/dd,
    whose contact ends when the force is zero (`damping_ratio` zeta >= 0).

    With u = sqrt(2 U/m), U the energy of the spring, and a time in which u' = v, the motion is that of the linear
    oscillator, v' = -u - 2 zeta v, whatever mass, stiffness and speed. The force is zero at v' = 0, where
    e = exp(-2 a/tan a), cos a = zeta; the linear case is Schwager and Poeschel's (2007, Granular Matter 9:465).
    """
    a = np.arccos(complex(damping_ratio))  # imaginary where overdamped
    return float(np.exp(-2 * damping_ratio * (a / np.sin(a)).real)) if a != 0 else float(np.exp(-2))


@lru_cache(maxsize=64)
def damping_ratio(restitution: float) -> float:
    """The zeta of `restitution_of` for a restitution above 0, up to 1."""
    if restitution == 1:
        return 0.0
    return float(brentq(lambda ratio: restitution_of(ratio) - restitution, 0, MOST_DAMPING, xtol=PRECISION))


def pressure_bound_Pa(assembly: Assembly) -> float:
    """Largest peak pressure that an elastic contact could reach: all the energy of a stone in the normal contact of its
    smallest sub-sphere, 8/15 E* sqrt(r) d^(5/2)."""
    pressure, mass, start = 0.0, assembly.stone_mass_kg, np.cumsum([0, *assembly.sizes])
    for k, stone in enumerate(assembly.stones):
        modulus = stone.substance.modulus_on_plate_Pa
        radius = assembly.radius_m[start[k]:start[k + 1]].min()
        speed2 = stone.speed_m_s**2 - 2 * assembly.gravity_m_s2[2] * stone.gap_m
        energy = 0.5 * mass[k] * speed2
        depth = (energy / (8 / 15 * modulus * np.sqrt(radius))) ** 0.4
        pressure = max(pressure, float(hertz.peak_pressure_Pa(modulus, depth / radius)))
    return pressure


def yield_pressure_Pa(plate: Plate, assembly: Assembly) -> float | None:
    """Pressure at which the wall gives way, or None where the scene gives no yield stress or cannot reach it."""
    if plate.yield_stress_Pa is None:
        return None
    pressure = YIELD_PRESSURE * plate.yield_stress_Pa
    return pressure if pressure_bound_Pa(assembly) > pressure else None


def yield_report(plate: Plate, assembly: Assembly, peak_force_N: np.ndarray, deepest: np.ndarray,
                 bending: dict[str, dict[str, float]]) -> dict[str, Any]:
    """What run.json says of yield.

    peak_force_N (stones,): of each alone. deepest (stones,): largest depth of a contact over the radius of its
    sub-sphere. bending: "bending" and "bending_at_rods" of plate_fem.stress.StressPeak, empty for a rigid plate.
    """
    modulus = np.array([stone.substance.modulus_on_plate_Pa for stone in assembly.stones])
    pressure = hertz.peak_pressure_Pa(modulus, deepest)
    limit = yield_pressure_Pa(plate, assembly)
    if limit is not None:
        pressure = np.minimum(pressure, limit)
    smooth = [HertzContact(0.0, 0.0, float(force), stone.radius_m, float(e)).peak_pressure_Pa
              for force, stone, e in zip(peak_force_N, assembly.stones, modulus)]
    report: dict[str, Any] = {"yield_stress_Pa": plate.yield_stress_Pa,
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
