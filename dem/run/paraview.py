"""view.pvd: particles, bonds and the plate for ParaView, on one time axis in seconds."""

from __future__ import annotations

import io
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import meshio
import numpy as np
import pandas as pd

from common.scene import Scene
from dem.deck.plate_yield import modulus_on_plate_Pa
from dem.run.prepare import PreparedRun
from dem.stones.assembly import Assembly
from dem.stones.bonds import fragments
from plate_fem.contact_stress import HertzContact, contact_patch, total_stress, von_mises_3d
from plate_fem.modes import PlateModes
from plate_fem.stress import surface_stress, von_mises

RANGE_OF_CONTACT = 20  # contact radii: beyond, a contact adds less than 4e-4 of its pressure


PlateMesh = tuple[int, str, meshio.Mesh]  # number of the part in view.pvd, name of its files, what it shows


def write_view(directory: Path, prepared: PreparedRun, events: pd.DataFrame,
               meshes_of_plate: Callable[[int, list[HertzContact]], list[PlateMesh]]) -> None:
    """Turn the engine's pictures in `directory`/deck into view/*.vtu and view.pvd in `directory`.

    `events` is the table of breakage.parquet. `meshes_of_plate(dem_step, contacts)` gives what a picture shows of the
    plate.
    """
    assembly, dt_s = prepared.assembly, prepared.step.dt_s
    pictures = directory / "view"
    pictures.mkdir()
    broken_at = np.full(assembly.n_bonds, np.inf)
    broken_at[events["bond"].to_numpy(dtype=int) - 1] = events["t_s"]
    entries = []
    for k, (dem_step, particles, pushing) in enumerate(read_pictures(directory / "deck" / "pictures.bin",
                                                                     assembly.n_particles)):
        t = dem_step * dt_s
        intact = broken_at > t + 0.5 * dt_s
        meshes = [(0, "particles", _particles(particles, assembly, intact))]
        if assembly.n_bonds:
            meshes.append((1, "bonds", _bonds(particles, assembly, intact)))
        meshes += meshes_of_plate(dem_step, hertz_contacts(pushing, prepared.scene, assembly))
        entries += [(t, part, _write(pictures / f"{name}_{k:04d}.vtu", mesh)) for part, name, mesh in meshes]
    _write_pvd(directory / "view.pvd", entries)


def plate_meshes(modes: PlateModes, amplitude: np.ndarray, contacts: list[HertzContact],
                 poisson_ratio: float) -> list[PlateMesh]:
    """The plate at the modal amplitudes (modes,), and a fine patch about each contact if there are any."""
    meshes = [(2, "plate", _plate(modes, amplitude, contacts, poisson_ratio))]
    if contacts:
        meshes.append((3, "contacts", _contacts(modes, amplitude, contacts, poisson_ratio)))
    return meshes


def read_pictures(file: Path, n_particles: int) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield of each picture of the engine (fix_pictures.h) the DEM step; place (m) and velocity (m/s) of the
    sub-spheres, (n_particles, 6); and the contacts with the plate, (k, 5): stone (from 1), x, y (m), force (N), radius
    (m). Raises RuntimeError for a file that is cut off or damaged."""
    with open(file, "rb") as pictures:
        while head := pictures.read(16):
            spheres = np.fromfile(pictures, dtype="<f4", count=6 * n_particles)
            dem_step, n_contacts = np.frombuffer(head, dtype="<i8") if len(head) == 16 else (-1, 0)
            contacts = np.fromfile(pictures, dtype="<f8", count=5 * max(0, n_contacts))
            if len(spheres) != 6 * n_particles or len(contacts) != 5 * n_contacts or not (
                    np.all(np.isfinite(spheres)) and np.all(np.isfinite(contacts))):
                raise RuntimeError(f"{file}: cut off or damaged")
            yield int(dem_step), spheres.reshape(n_particles, 6), contacts.reshape(n_contacts, 5)


def read_dump(file: Path) -> Iterator[tuple[int, np.ndarray]]:
    """Yield DEM step and array (n, columns), sorted by id, of each frame of `dump custom id x y z ...`. Raises
    RuntimeError for a file that is cut off, damaged or something else."""
    with open(file) as lines:
        for line in lines:
            if not line.startswith("ITEM: TIMESTEP"):
                raise RuntimeError(f"{file}: not a dump of the engine")
            dem_step = int(next(lines))
            next(lines)
            count = int(next(lines))
            *_, names = itertools.islice(lines, 5)  # the last is ITEM: ATOMS id x y ...
            columns = range(len(names.split()) - 2)
            text = io.StringIO("".join(itertools.islice(lines, count)))
            frame = pd.read_csv(text, sep=" ", header=None, usecols=columns).to_numpy(dtype=float)
            if len(frame) != count or not np.all(np.isfinite(frame)):
                raise RuntimeError(f"{file}: the frame of step {dem_step} is cut off or damaged")
            yield dem_step, frame[np.argsort(frame[:, 0])]


def _particles(frame: np.ndarray, assembly: Assembly, intact: np.ndarray) -> meshio.Mesh:
    n = len(frame)
    label = fragments(assembly.n_particles, assembly.bond_first, assembly.bond_second, intact)
    return meshio.Mesh(
        frame[:, :3], [("vertex", np.arange(n).reshape(-1, 1))],
        point_data={"radius_m": assembly.radius_m, "velocity_m_s": frame[:, 3:], "material": assembly.material + 1.0,
                    "agglomerate": assembly.agglomerate + 1.0, "fragment": label + 1.0})


def _bonds(frame: np.ndarray, assembly: Assembly, intact: np.ndarray) -> meshio.Mesh:
    ends = np.column_stack([assembly.bond_first, assembly.bond_second])[intact]
    length = np.linalg.norm(frame[ends[:, 1], :3] - frame[ends[:, 0], :3], axis=1)
    strain = length / np.linalg.norm(assembly.bond_vector_m[intact], axis=1) - 1
    return meshio.Mesh(frame[:, :3], [("line", ends)],
                       cell_data={"strain": [strain], "radius_m": [assembly.bond_radius_m[intact]],
                                  "agglomerate": [assembly.agglomerate[ends[:, 0]] + 1.0]})


def hertz_contacts(rows: np.ndarray, scene: Scene, assembly: Assembly) -> list[HertzContact]:
    """The contacts of one picture, given as `read_pictures` does."""
    modulus = [modulus_on_plate_Pa(scene, name) for name in assembly.stone_materials]
    return [HertzContact(x, y, force, radius, modulus[int(stone) - 1]) for stone, x, y, force, radius in rows]


def _plate(modes: PlateModes, amplitude: np.ndarray, contacts: list[HertzContact], poisson_ratio: float) -> meshio.Mesh:
    w = modes.shape @ amplitude
    points = np.column_stack([modes.node_m, np.zeros(len(w))])
    total = total_stress(modes, amplitude, contacts, modes.node_m, poisson_ratio)
    return meshio.Mesh(points, [("quad", modes.quad)],
                       point_data={"displacement_m": _upwards(w),
                                   "von_mises_Pa": von_mises(surface_stress(modes, amplitude)),
                                   "von_mises_with_contacts_Pa": von_mises_3d(total)})


def _contacts(modes: PlateModes, amplitude: np.ndarray, contacts: list[HertzContact],
              poisson_ratio: float) -> meshio.Mesh:
    """A patch of the plate's surface about each contact, much finer than the plate's mesh, with bending and contact
    stress."""
    low, high = np.array([[lines[0], lines[-1]] for lines in (modes.lines_x_m, modes.lines_y_m)]).T
    place = np.array([[c.x_m, c.y_m] for c in contacts])
    points, cells, stress, number, count = [], [], [], [], 0
    for k, contact in enumerate(contacts):
        near = np.hypot(*(place - place[k]).T) < RANGE_OF_CONTACT * np.array([c.contact_radius_m for c in contacts])
        here, quads = contact_patch(contact)
        here = np.clip(here, low, high)
        points.append(here)
        cells.append(quads + count)
        stress.append(total_stress(modes, amplitude, [contacts[n] for n in np.flatnonzero(near)], here, poisson_ratio))
        number.append(np.full(len(here), k + 1.0))
        count += len(here)
    surface, whole = np.vstack(points), np.vstack(stress)
    return meshio.Mesh(np.column_stack([surface, np.zeros(len(surface))]), [("quad", np.vstack(cells))],
                       point_data={"displacement_m": _upwards(modes.shape_at(surface) @ amplitude),
                                   "von_mises_with_contacts_Pa": von_mises_3d(whole), "pressure_Pa": -whole[:, 3],
                                   "contact": np.concatenate(number)})


def _upwards(w: np.ndarray) -> np.ndarray:
    return np.column_stack([np.zeros((len(w), 2)), w])


def _write(file: Path, mesh: meshio.Mesh) -> str:
    """Write values in single precision, which is what a picture needs: smaller files, and less time to compress
    them."""
    def single(values: np.ndarray) -> np.ndarray:
        return np.asarray(values, dtype=np.int32 if np.asarray(values).dtype.kind in "iu" else np.float32)

    meshio.Mesh(mesh.points, [(block.type, single(block.data)) for block in mesh.cells],
                point_data={name: single(values) for name, values in mesh.point_data.items()},
                cell_data={name: [single(values) for values in blocks] for name, blocks in mesh.cell_data.items()},
                ).write(file, file_format="vtu")
    return f"view/{file.name}"


def _write_pvd(file: Path, entries: list[tuple[float, int, str]]) -> None:
    rows = "\n".join(f'    <DataSet timestep="{t:.9g}" part="{part}" file="{name}"/>' for t, part, name in entries)
    file.write_text('<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
                    f"  <Collection>\n{rows}\n  </Collection>\n</VTKFile>\n")
