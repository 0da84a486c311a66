"""The file of a stream, from which the engine reads each stone when it enters (dem/engine/stones/stone_file.h)."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from common.scene.scene import Scene
from dem.deck.contact import NUMBERS as FACE_NUMBERS, contact_rows, face_rows
from dem.deck.time_step import TimeStep
from dem.stones.assembly import Assembly
from dem.stones.stone import Entry

INDEX_NUMBERS = 6 + 3  # of a stone: whole numbers, spin


def write_stones(file: Path, scene: Scene, assembly: Assembly, step: TimeStep) -> None:
    """Write all stones, each as it is at its step of entry."""
    atoms, bonds = np.hstack([atom_rows(assembly), assembly.start_motion()[0]]), bond_rows(assembly)
    atom_start = np.cumsum([0, *assembly.sizes])
    bond_start = np.searchsorted(assembly.bond_first, atom_start)
    contact = contact_rows(scene, assembly) if assembly.surfaces else None
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
        faces = face_rows(scene, assembly, k, atom_start[k]) if assembly.faces else np.zeros((0, FACE_NUMBERS))
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
