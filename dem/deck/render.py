"""Render the LIGGGHTS deck and the data files it reads, holding only what the scene needs; of a stream also the file
from which the engine reads each stone when it enters (dem/engine/stones/stone_file.h).
"""

import hashlib
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from common.files.rows import write_rows
from common.files.whole import named
from common.resources import resource
from common.scene.plate import FlexiblePlate
from common.scene.scene import PLATE, ContactTable, Scene
from dem.deck.contact import (
    NUMBERS as FACE_NUMBERS,
    contact_rows,
    face_rows,
    pair_laws,
    write_faces,
    write_surfaces,
    yield_pressure_Pa,
)
from dem.deck.pictures import picture_schedule
from dem.deck.time_step import TimeStep, weak_contact
from dem.stones.assembly import CONTACT_RADIUS_RATIO, Assembly
from dem.stones.stone import Entry, Substance
from plate_fem.elements.mesh import nodes
from plate_fem.modes import PlateModes

INDEX_NUMBERS = 6 + 3  # of a stone: whole numbers, spin


def write_stones(file: Path, assembly: Assembly, step: TimeStep) -> None:
    """Write all stones, each as it is at its step of entry."""
    atoms, bonds = np.hstack([atom_rows(assembly), assembly.start_motion()[0]]), bond_rows(assembly)
    atom_start = np.cumsum([0, *assembly.sizes])
    bond_start = np.searchsorted(assembly.bond_first, atom_start)
    contact = contact_rows(assembly) if assembly.surfaces else None
    index, parts = [], []
    at = 8 * (3 + len(assembly.substances) + INDEX_NUMBERS * len(assembly.stones))
    for k, (stone, entry) in enumerate(zip(assembly.stones, assembly.entries, strict=True)):
        here, held = slice(atom_start[k], atom_start[k + 1]), slice(bond_start[k], bond_start[k + 1])
        entry_step, ahead_m, faster_m_s = at_step(entry, assembly.gravity_m_s2, step.dt_s)
        own = atoms[here].copy()
        own[:, 3:6] += ahead_m
        own[:, 6:] += faster_m_s
        part = [own, bonds[held]]
        if contact is not None:
            surface = assembly.surfaces[k]
            part += [contact[k], np.column_stack([surface.place_m, assembly.radius_m[here], assembly.mass_kg[here],
                                                  surface.is_surface])]
        faces = face_rows(assembly, k, atom_start[k]) if assembly.faces else np.zeros((0, FACE_NUMBERS))
        part.append(faces)
        parts += part
        index.append(np.concatenate([np.array([entry_step, at, len(own), held.stop - held.start, contact is not None,
                                               len(faces)], dtype="<i8").view("<f8"), stone.spin_rad_s]))
        at += 8 * sum(values.size for values in part)
    greatest = [assembly.radius_m[assembly.substance == m].max() for m in range(len(assembly.substances))]
    with open(file, "wb") as out:
        np.array([len(index), len(greatest)], dtype="<i8").tofile(out)
        for values in ([assembly.radius_m.min(), *greatest], *index, *parts):
            np.ascontiguousarray(values, dtype="<f8").tofile(out)


def at_step(entry: Entry, gravity_m_s2: tuple[float, float, float], dt_s: float) -> tuple[int, np.ndarray, np.ndarray]:
    """The DEM step at which a stone enters, the last one not after its entry; how far it is from its place of entry
    then, (3,) m; and how much faster, (3,) m/s."""
    dem_step = math.floor(entry.entry_s / dt_s * (1 + 1e-12))
    ahead_s = dem_step * dt_s - entry.entry_s
    v, g = np.array(entry.velocity_m_s), np.array(gravity_m_s2)
    return dem_step, ahead_s * v + 0.5 * ahead_s**2 * g, ahead_s * g


def atom_rows(assembly: Assembly) -> np.ndarray:
    """(n, 6) of each sub-sphere: type, diameter, density, place."""
    density = assembly.mass_kg / (4 / 3 * np.pi * assembly.radius_m**3)
    return np.column_stack([assembly.substance + 1, 2 * assembly.radius_m, density, assembly.center_m])


def bond_rows(assembly: Assembly) -> np.ndarray:
    """(m, 8) of each bond: its two sub-spheres, type, vector, radius, factor on its strengths."""
    return np.column_stack([assembly.bond_first + 1, assembly.bond_second + 1, assembly.bond_substance + 1,
                            assembly.bond_vector_m, assembly.bond_radius_m, assembly.bond_strength_factor])


TEMPLATES = resource("templates")
DECK = "deck.liggghts.j2"
SHAPE_GRID = 0.6  # of the largest mesh cell: about 12 points in the shortest wave, cubic between them
UNBREAKABLE_Pa = 1e30
CHECKPOINT_SAMPLES = 5  # between two steps that allow a checkpoint; each costs a build of lists (docs/runs.md)
BOX_MARGIN_M = 0.005
MOST_LEDGER_ROWS = 2_000_000  # of a stone at a time
FREE_FLIGHT_EVERY = 48  # DEM steps between two looks at what flies freely: one costs as much as a tenth of a step


def write_deck(directory: Path, scene: Scene, assembly: Assembly, step: TimeStep, modes: PlateModes | None) -> str:
    """Write the deck into `directory` and return the hash of its files."""
    directory.mkdir(parents=True)
    writers: dict[str, Callable[[Path], object]] = {
        "deck.liggghts": lambda file: file.write_text(render(scene, assembly, step)),
        "agglomerates.txt": lambda file: np.savetxt(file, assembly.sizes, fmt="%d")}
    if assembly.is_stream:
        writers["stones.bin"] = lambda file: write_stones(file, assembly, step)
    else:
        writers["atoms.data"] = lambda file: _write_atoms(file, scene, assembly)
        if assembly.n_bonds:
            writers["bonds.txt"] = lambda file: _write_bonds(file, assembly)
    if assembly.surfaces:
        writers["surface.txt"] = lambda file: write_surfaces(file, assembly)
    if assembly.faces:
        writers["faces.txt"] = lambda file: write_faces(file, assembly)
    if modes is not None:
        drags = any(one.plate_contact.friction for one in assembly.substances)
        writers["shapes.bin"] = lambda file: _write_shapes(file, modes, drags)
    for name, write in writers.items():
        with named(directory / name):
            write(directory / name)
    digest = hashlib.sha256()
    for file in sorted(file for file in directory.iterdir() if file.is_file()):
        with open(file, "rb") as opened:
            digest.update(file.name.encode())
            while block := opened.read(1 << 22):
                digest.update(block)
    return digest.hexdigest()[:16]


@cache
def template(name: str) -> jinja2.Template:
    return jinja2.Environment(loader=jinja2.FileSystemLoader(TEMPLATES), undefined=jinja2.StrictUndefined,
                              keep_trailing_newline=True).get_template(name)


def render(scene: Scene, assembly: Assembly, step: TimeStep) -> str:
    types: list[Substance | str] = [*assembly.substances, PLATE]
    stones_meet = _stones_meet(scene, assembly)
    contacts = [_contact(a, b, stones_meet) for a in types for b in types]
    friction = [c.friction if c else 0.0 for c in contacts]
    tangential = " tangential history" if any(friction) else ""
    half = [side / 2 for side in scene.plate.size_m]
    free_flight = _free_flight(scene, assembly, step)
    skin = skin_m(assembly, knows_bodies=free_flight is not None)
    return template(DECK).render(
        name=scene.name,
        stones=_describe(scene, assembly),
        yield_pressure_Pa=yield_pressure_Pa(scene.plate, assembly),
        coupling=isinstance(scene.plate, FlexiblePlate),
        materials=[{"name": one.name, **one.material.model_dump()} for one in assembly.substances],
        plate_material=scene.plate.model_dump(),
        walls=deck_walls(scene),
        # A pair that cannot meet in this scene still needs a number; elastic is what does least.
        restitution=[c.restitution if c else 1.0 for c in contacts],
        friction=friction if any(friction) else None,
        tangential=tangential,
        gravity_m_s2=scene.time.gravity_m_s2,
        bonds=_bonds(scene, assembly, step) if assembly.n_bonds else None,
        skin_m=skin,
        # Bins as large as the range of a contact: a rebuild clears few and looks through 27.
        bin_m=float(f"{1.002 * (2 * assembly.radius_m.max() + skin):.4g}"),
        dt_s=repr(step.dt_s),
        sample_steps=step.sample_steps,
        fast_steps=step.fast_steps,
        record_steps=record_steps(assembly, step),
        stream=assembly.is_stream,
        box_m=" ".join(" ".join(ends) for ends in _box_m(assembly)),
        up=" ".join(f"{c:.17g}" for c in assembly.up),
        down=" ".join("0" if c == 0 else f"{-c:.17g}" for c in assembly.up),
        co_step=step.co_step,
        weak_contact=weak_contact(scene, assembly, step),
        steps=step.steps,
        surface=bool(assembly.surfaces),
        faces=bool(assembly.faces),
        pair_laws=pair_laws(assembly),
        extent_m=[-half[0], half[0], -half[1], half[1]],
        velocity_m_s=_common_velocity(assembly),
        impact_J=0.0 if assembly.is_stream else _impact_J(assembly),  # those of a stream bring theirs
        mass_height_kg_m=0.0 if assembly.is_stream else float(
            assembly.mass_kg @ (assembly.center_m @ np.array(assembly.up))),
        pictures=picture_schedule(scene, assembly, step),
        free_flight=free_flight,
        integrated="unheld" if free_flight else "all",
        checkpoint_steps=CHECKPOINT_SAMPLES * step.sample_steps,
        streams=streams(scene, assembly),
    )


def streams(scene: Scene, assembly: Assembly) -> list[str]:
    """Files in the deck's directory that the engine appends to."""
    return ["ledger.bin", "forces.bin", "contacts.bin", *(["events.csv"] if assembly.n_bonds else []),
            *(["left.csv"] if assembly.is_stream else []), *(wall["file"] for wall in deck_walls(scene)),
            *(["pictures.bin"] if scene.time.view_interval_s is not None else [])]


def record_steps(assembly: Assembly, step: TimeStep) -> int:
    """DEM steps between two records of energies and contacts: a sample, or more where all stones at all samples would
    be too many to keep."""
    rows = step.steps // step.sample_steps * len(assembly.stones)
    return step.sample_steps * math.ceil(rows / MOST_LEDGER_ROWS)


def _common_velocity(assembly: Assembly) -> str | None:
    """Of all stones when they enter, or None where they differ or spin, and atoms.data says each."""
    velocities = {entry.velocity_m_s for entry in assembly.entries}
    if len(velocities) > 1 or assembly.spins:
        return None
    return " ".join("0" if v == 0 else repr(v) for v in velocities.pop())


def _impact_J(assembly: Assembly) -> float:
    """Kinetic energy of all stones when they enter."""
    if _common_velocity(assembly) is not None:
        return float(0.5 * assembly.mass_kg.sum() * math.hypot(*assembly.entries[0].velocity_m_s) ** 2)
    return float(assembly.kinetic_start_J.sum())


def _contact(first: Substance | str, second: Substance | str, stones_meet: bool) -> ContactTable | None:
    """The contact of two types of the deck, which are substances and the plate; None where they cannot meet."""
    stones = [one for one in (first, second) if isinstance(one, Substance)]
    if len(stones) == 2:
        return stones[0].contact_with(stones[1]) if stones_meet else None
    return stones[0].plate_contact if stones else None


def _stones_meet(scene: Scene, assembly: Assembly) -> bool:
    """Can a sub-sphere touch another one? Not where there is one stone that holds together."""
    table = scene.stones.agglomerate
    return len(assembly.sizes) > 1 or (table is not None and not table.unbreakable)


def _free_flight(scene: Scene, assembly: Assembly, step: TimeStep) -> dict[str, float | None] | None:
    """Arguments of fix free_flight (docs/free_flight.md); None where the scene wants brute force or several ranks."""
    if scene.time.free_flight_tolerance == 0 or scene.ranks > 1:  # the fix knows one rank only
        return None
    every = step.co_step * max(1, round(FREE_FLIGHT_EVERY / step.co_step))
    return {"speed_m_s": assembly.impact_speed_m_s, "tolerance": scene.time.free_flight_tolerance, "every": every,
            "body_skin_m": body_skin_m(assembly),
            "least_fragment": scene.stones.drawn.least_fragment if scene.stones.drawn else None}


def skin_m(assembly: Assembly, knows_bodies: bool = False) -> float:
    """Neighbour skin. Fix free_flight gives pairs within a body a skin of their own."""
    if assembly.n_bonds and not knows_bodies:
        return body_skin_m(assembly)
    return float(f"{0.25 * assembly.radius_m.min():.3g}")


def body_skin_m(assembly: Assembly) -> float:
    """Neighbour skin within a body, smaller than the gap of bonded pairs, so that lists stay empty where bonds hold."""
    return float(f"{0.9 * 2 * (1 / CONTACT_RADIUS_RATIO - 1) * assembly.radius_m.min():.3g}")


def _describe(scene: Scene, assembly: Assembly) -> str:
    kind = f"agglomerates of {scene.agglomerate.subspheres} sub-spheres" if assembly.n_bonds else "spheres"
    return f"{len(assembly.sizes)} {kind}"


def _bonds(scene: Scene, assembly: Assembly, step: TimeStep) -> dict[str, Any]:
    table = scene.agglomerate
    materials = []
    for substance in assembly.substances:
        bond = substance.bond
        values = bond.model_dump()
        if table.unbreakable:
            values |= {"tensile_strength_Pa": UNBREAKABLE_Pa, "shear_strength_Pa": UNBREAKABLE_Pa,
                       "pressure_strengthening": 0.0, "fracture_energy_J_m2": None}
        angle = 0.0 if table.unbreakable else bond.friction_angle_deg
        values["volumetric_modulus_Pa"] = bond.volumetric_ratio * bond.youngs_modulus_Pa
        values["tan_friction"] = float(np.tan(np.radians(angle)))
        materials.append(values)
    # Viscous damping proportional to stiffness, c = tau k, with c = 2 zeta sqrt(k m) in the stiffest bond.
    assert step.bond_time_s is not None
    return {"damping_time_s": 2 * table.damping_ratio * step.bond_time_s, "materials": materials,
            "feel_dilatation": any(m["volumetric_modulus_Pa"] or m["pressure_strengthening"] for m in materials)}


def _box_m(assembly: Assembly) -> list[tuple[str, str]]:
    """From and to of the simulation box along each axis. Boundaries of style m grow with the stones and never shrink
    below this: a small box means few neighbour bins."""
    low = (assembly.center_m - assembly.radius_m[:, None]).min(axis=0) - BOX_MARGIN_M
    high = (assembly.center_m + assembly.radius_m[:, None]).max(axis=0) + BOX_MARGIN_M
    return [(f"{a:.9g}", f"{b:.9g}") for a, b in zip(low, high)]


def _write_atoms(file: Path, scene: Scene, assembly: Assembly) -> None:
    number = np.arange(1, assembly.n_particles + 1)
    box = "".join(f"{a} {b} {axis}lo {axis}hi\n" for axis, (a, b) in zip("xyz", _box_m(assembly)))
    head = (f"{scene.name}\n\n{assembly.n_particles} atoms\n{len(assembly.substances) + 1} atom types\n\n{box}\n"
            "Atoms\n\n")
    with open(file, "wb") as out:
        write_rows(out, np.column_stack([number, atom_rows(assembly)]), head)
        if _common_velocity(assembly) is None:  # velocity and spin of every sub-sphere when its stone enters
            write_rows(out, np.column_stack([number, *assembly.start_motion()]), "\nVelocities\n\n")


def _write_bonds(file: Path, assembly: Assembly) -> None:
    with open(file, "wb") as out:
        write_rows(out, bond_rows(assembly))


def _write_shapes(file: Path, modes: PlateModes, with_lateral: bool) -> None:
    """Write the file that dem/engine/coupling/plate_shapes.h describes."""
    cell = max(np.diff(modes.lines_x_m).max(), np.diff(modes.lines_y_m).max())
    x, y = modes.grid(SHAPE_GRID * cell)
    directions = 3 if with_lateral and len(modes.lateral) else 1
    with open(file, "wb") as out:
        out.write(b"shapes 3")
        np.array([len(x), len(y), directions, len(modes.frequency_Hz)], dtype="<i8").tofile(out)
        np.array([x[0], y[0], x[1] - x[0], y[1] - y[0]], dtype="<f8").tofile(out)
        for upwards in modes.shapes_at(nodes(x, y)):
            np.ascontiguousarray(upwards.T, "<f8").tofile(out)
        for axis in range(directions - 1):
            for some in modes.parts():
                np.ascontiguousarray(some.lateral_grid(x, y, axis).transpose(2, 0, 1), "<f4").tofile(out)


def deck_walls(scene: Scene) -> list[dict[str, Any]]:
    """Name, file of forces and box of each wall on an edge of the plate."""
    return [{"name": f"wall_{edge}", "file": wall_file(edge), "box_m": box}
            for edge, box in scene.plate.wall_boxes_m.items()]


def wall_file(edge: str) -> str:
    """File in the deck's directory with the forces on a wall."""
    return f"wall_{edge}.bin"
