"""view.pvd: particles, bonds, plate, rods and side walls for ParaView, on one time axis in seconds.

Its files are of VTK's XML formats (vtu, pvd), written with little work. Arrays are appended as they lie in memory, in
blocks compressed in zlib's format. What pays was measured on pictures of the default scene (docs/runs.md): ISA-L takes
a thirtieth of zlib's time for floating-point numbers and leaves less; lists of points take zlib's search for
repetitions; what is the same in the next picture is compressed once.
"""

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from isal import isal_zlib
from scipy.interpolate import RegularGridInterpolator

from common.files.parquet import Columns
from common.files.whole import named
from common.resources import resource
from common.scene.plate import FlexiblePlate
from common.scene.scene import Scene
from dem.deck.time_step import WeakContact, weak_contact
from dem.run.prepare import PreparedRun
from dem.stones.assembly import Assembly
from dem.stones.bonds import fragments
from plate_fem.elements.mesh import bicubics
from plate_fem.modes import PlateModes
from plate_fem.stress import (
    HertzContact,
    contact_patch,
    contact_surface_stress,
    surface_stress,
    von_mises,
    von_mises_3d,
)

BLOCK_BYTES = 1 << 20
LEAST_FOR_ISAL_BYTES = 4096  # ISA-L packed 96 bytes as 49 in one process and as 51 in another
CELL_TYPES = {1: 1, 2: 3, 4: 9}  # number of points of a cell: VTK's vertex, line, quad
VTK_TYPES = {"f4": "Float32", "i4": "Int32", "u2": "UInt16", "u1": "UInt8"}


@dataclass(frozen=True)
class Mesh:
    """Points (n, 3) in m, cells (k, points of a cell) as indices, and numbers by name at points (n,) or (n, 3) and of
    cells (k,). Floating-point numbers are written in single precision."""

    points: np.ndarray
    cells: np.ndarray
    point_data: dict[str, np.ndarray] = field(default_factory=dict)
    cell_data: dict[str, np.ndarray] = field(default_factory=dict)


class VtuWriter:
    """Writes the meshes of a series under one name."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[bytes, bytes]] = {}  # by name of the array: as it was, and compressed

    def write(self, file: Path, mesh: Mesh) -> None:
        """Write a mesh as a vtu file."""
        n_cells, in_cell = mesh.cells.shape
        cells = {"connectivity": mesh.cells.astype("i4").ravel(),
                 "offsets": np.arange(in_cell, in_cell * n_cells + 1, in_cell, dtype="i4"),
                 "types": np.full(n_cells, CELL_TYPES[in_cell], dtype="u1")}
        sections = {"Points": {"points": mesh.points}, "Cells": cells, "PointData": mesh.point_data,
                    "CellData": mesh.cell_data}
        lines, appended = [], []
        # The array named last lies first: meshio moves the offsets of what it has read, and takes the first array that
        # is named with the offset it looks for.
        at = 0
        for section in reversed(sections):
            lines.append(f"</{section}>")
            for name, values in reversed(sections[section].items()):
                values = _as_written(values)
                columns = "" if values.ndim == 1 else f' NumberOfComponents="{values.shape[1]}"'
                lines.append(f'<DataArray type="{VTK_TYPES[values.dtype.str[1:]]}" Name="{name}"{columns} '
                             f'format="appended" offset="{at}"/>')
                appended.append(self._compressed(f"{section}/{name}", values))
                at += len(appended[-1])
            lines.append(f"<{section}>")
        lines.reverse()
        head = ('<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
                'header_type="UInt32" compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n'
                f'<Piece NumberOfPoints="{len(mesh.points)}" NumberOfCells="{n_cells}">\n')
        tail = '\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding="raw">\n_'
        with named(file), open(file, "wb") as out:
            out.write((head + "\n".join(lines) + tail).encode())
            out.writelines(appended)
            out.write(b"\n</AppendedData>\n</VTKFile>\n")

    def _compressed(self, name: str, values: np.ndarray) -> bytes:
        data = values.tobytes()
        last, compressed = self._last.get(name, (b"", b""))
        if last != data:
            fast = values.dtype.kind == "f" and len(data) >= LEAST_FOR_ISAL_BYTES
            compressed = _blocks(data, isal_zlib.compress if fast else zlib.compress)
            self._last[name] = data, compressed
        return compressed


def _as_written(values: np.ndarray) -> np.ndarray:
    values = np.asarray(values)
    return values.astype("<f4") if values.dtype.kind == "f" else values


def _blocks(data: bytes, compress: Callable[[bytes, int], bytes]) -> bytes:
    """Blocks as VTK expects them: their number, size, size of the last one if smaller, compressed sizes, blocks."""
    blocks = [compress(data[at:at + BLOCK_BYTES], 1) for at in range(0, len(data), BLOCK_BYTES)]
    head = [len(blocks), BLOCK_BYTES, len(data) % BLOCK_BYTES, *map(len, blocks)]
    return struct.pack(f"<{len(head)}I", *head) + b"".join(blocks)


def rounded(values: np.ndarray, bits: int) -> np.ndarray:
    """To whole multiples of 2^-bits, in single precision: digits beyond would not compress."""
    return (np.rint(values * 2.0**bits) * 2.0**-bits).astype("f4", copy=False)


def write_pvd(file: Path, entries: list[tuple[float, int, str]]) -> None:
    """Write a series for ParaView; `entries` are time (s), number of the part, and name of a file beside `file`."""
    rows = "\n".join(f'    <DataSet timestep="{t:.9g}" part="{part}" file="{name}"/>' for t, part, name in entries)
    with named(file):
        file.write_text('<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
                        f"  <Collection>\n{rows}\n  </Collection>\n</VTKFile>\n")


RANGE_OF_CONTACT = 20  # contact radii: beyond, a contact adds less than 4e-4 of its pressure
# Whole multiples of 2^-bits in which pictures give places (1 um), velocities (1 mm/s), strains (1e-6) and the ends of
# bonds (60 um, a hundredth of a bond).
PLACE_BITS, VELOCITY_BITS, STRAIN_BITS, END_BITS = 20, 10, 20, 14

#: What view.pvd shows, by the number of the part there: the name of its files.
PARTS = ("particles", "bonds", "plate", "contacts", "rods", "walls")
WALLS = "view/walls.vtu"  # one for all pictures, since they do not move
MeshesOfPlate = Callable[[int, list[HertzContact]], dict[str, Mesh]]


def write_view(file: Callable[[str], Path], deck: Path, prepared: PreparedRun, events: Columns,
               meshes_of_plate: MeshesOfPlate) -> None:
    """Turn the engine's pictures in `deck` into view/*.vtu, view.pvd and view.py, at the path that `file` gives for
    each name.

    `events` is the table of breakage.parquet. `meshes_of_plate(dem_step, contacts)` gives what a picture shows of the
    plate, by the names of PARTS.
    """
    assembly, dt_s = prepared.assembly, prepared.step.dt_s
    file("view.pvd").with_suffix("").mkdir(exist_ok=True)
    broken_at = np.full(assembly.n_bonds, np.inf)
    broken_at[events["bond"] - 1] = events["t_s"]
    writers = {part: VtuWriter() for part in PARTS}
    stones, walls = StoneMeshes(assembly), wall_mesh(prepared.scene)
    weak = weak_contact(prepared.scene, assembly, prepared.step)
    if walls is not None:
        writers["walls"].write(file(WALLS), walls)
    entries = []
    pictures = read_pictures(deck / "pictures.bin", assembly.sizes)
    for k, (dem_step, near, spheres, pushing) in enumerate(pictures):
        t = dem_step * dt_s
        meshes = stones.meshes(near, spheres, broken_at > t + 0.5 * dt_s)
        meshes |= meshes_of_plate(dem_step, shown_contacts(pushing, assembly, weak))
        for name, mesh in meshes.items():
            picture = f"view/{name}_{k:04d}.vtu"
            writers[name].write(file(picture), mesh)
            entries.append((t, PARTS.index(name), picture))
        if walls is not None:
            entries.append((t, PARTS.index("walls"), WALLS))
    write_pvd(file("view.pvd"), entries)
    for part in {number for _, number, _ in entries}:
        write_pvd(file(f"view/{PARTS[part]}.pvd"),
                  [(t, 0, picture.removeprefix("view/")) for t, number, picture in entries if number == part])
    with named(script := file("view.py")):
        script.write_bytes((resource("templates") / "view.py").read_bytes())


class StoneMeshes:
    """Particles and bonds of the pictures of a run, one after the other."""

    def __init__(self, assembly: Assembly):
        self._assembly = assembly
        self._material = np.unique(assembly.stone_materials, return_inverse=True)[1]
        self._ends = np.column_stack([assembly.bond_first, assembly.bond_second])
        self._length_m = np.linalg.norm(assembly.bond_vector_m, axis=1)
        self._broken: int | None = None  # bonds, when the fragments were found
        self._fragment = np.zeros(0, dtype="i4")

    def meshes(self, near: np.ndarray, spheres: np.ndarray, intact: np.ndarray) -> dict[str, Mesh]:
        """Of the sub-spheres of the stones `near`, 0-based, at `spheres`[:, :3] m with the velocities `spheres`[:, 3:]
        m/s, zeros of one that has left the plate for good; `intact` (bonds,)."""
        assembly = self._assembly
        if np.count_nonzero(~intact) != self._broken:
            self._broken = int(np.count_nonzero(~intact))
            self._fragment = fragments(assembly.n_particles, assembly.bond_first, assembly.bond_second, intact) + 1
        start = np.cumsum([0, *assembly.sizes])
        known = np.concatenate([np.arange(0), *(np.arange(start[a], start[a + 1]) for a in near)])
        there = spheres.any(axis=1)
        shown, spheres = known[there], spheres[there]
        points = rounded(spheres[:, :3], PLACE_BITS)
        particles = Mesh(points, np.arange(len(points)).reshape(-1, 1), {
            "radius_m": assembly.radius_m[shown], "velocity_m_s": rounded(spheres[:, 3:], VELOCITY_BITS),
            "material": (self._material[assembly.agglomerate[shown]] + 1).astype("u1"),
            "agglomerate": (assembly.agglomerate[shown] + 1).astype("u2"),
            "fragment": self._fragment[shown].astype("i4")})
        if not assembly.n_bonds:
            return {"particles": particles}
        index = np.full(assembly.n_particles, -1)
        index[shown] = np.arange(len(shown))
        ends = index[self._ends]
        held = intact & (ends >= 0).all(axis=1)
        ends = ends[held]
        length = np.linalg.norm(spheres[ends[:, 1], :3] - spheres[ends[:, 0], :3], axis=1)
        return {"particles": particles, "bonds": Mesh(rounded(points, END_BITS), ends, cell_data={
            "strain": rounded(length / self._length_m[held] - 1, STRAIN_BITS),
            "agglomerate": (assembly.agglomerate[shown[ends[:, 0]]] + 1).astype("u2")})}


class PlateMeshes:
    """The plate of a run and its rods at the pictures."""

    def __init__(self, modes: PlateModes, plate: FlexiblePlate):
        self._modes, self._plate = modes, plate
        self._nodal = np.ascontiguousarray(modes.nodal.reshape(-1, modes.nodal.shape[2]))

    def meshes(self, amplitude: np.ndarray, contacts: list[HertzContact]) -> dict[str, Mesh]:
        """The plate at the modal amplitudes (modes,), a fine patch about each contact, and the rods."""
        bending = surface_stress(self._modes, amplitude)
        found = {"plate": self._surface(amplitude, bending, contacts)}
        if contacts:
            found["contacts"] = self._patches(amplitude, bending, contacts)
        if self._plate.rods:
            found["rods"] = self._rods(amplitude)
        return found

    def _surface(self, amplitude: np.ndarray, bending: np.ndarray, contacts: list[HertzContact]) -> Mesh:
        modes = self._modes
        w = modes.shape @ amplitude
        total = np.column_stack([bending, np.zeros(len(bending))])
        for contact in contacts:
            reach_m = RANGE_OF_CONTACT * contact.contact_radius_m
            near = np.hypot(*(modes.node_m - (contact.x_m, contact.y_m)).T) < reach_m
            total[near] += contact_surface_stress(contact, modes.node_m[near], self._plate.poisson_ratio)
        return Mesh(np.column_stack([modes.node_m, np.zeros(len(w))]), modes.quad,
                    {"displacement_m": _upwards(w), "von_mises_Pa": von_mises(bending),
                     "von_mises_with_contacts_Pa": von_mises_3d(total)})

    def _patches(self, amplitude: np.ndarray, bending: np.ndarray, contacts: list[HertzContact]) -> Mesh:
        """A patch of the plate's surface about each contact, much finer than the plate's mesh, with bending and contact
        stress."""
        modes = self._modes
        lines = modes.lines_x_m, modes.lines_y_m
        low, high = np.array([[line[0], line[-1]] for line in lines]).T
        place = np.array([[c.x_m, c.y_m] for c in contacts])
        reach = RANGE_OF_CONTACT * np.array([c.contact_radius_m for c in contacts])
        patches = [contact_patch(contact) for contact in contacts]
        size = len(patches[0][0])  # points, the same of each
        points = np.clip(np.vstack([points for points, _ in patches]), low, high)
        nodal = bending.reshape(len(lines[0]), len(lines[1]), 3)
        stress = np.column_stack([RegularGridInterpolator(lines, nodal)(points), np.zeros(len(points))])
        for k in range(len(contacts)):
            here = slice(k * size, (k + 1) * size)
            for near in np.flatnonzero(np.hypot(*(place - place[k]).T) < reach):
                stress[here] += contact_surface_stress(contacts[near], points[here], self._plate.poisson_ratio)
        w = bicubics(*lines).values(points) @ (self._nodal @ amplitude)
        return Mesh(np.column_stack([points, np.zeros(len(points))]),
                    np.vstack([cells + k * size for k, (_, cells) in enumerate(patches)]),
                    {"displacement_m": _upwards(w), "von_mises_with_contacts_Pa": von_mises_3d(stress),
                     "pressure_Pa": -stress[:, 3],
                     "contact": np.repeat(np.arange(1, len(contacts) + 1, dtype="i4"), size)})

    @cached_property
    def _at_rods(self) -> np.ndarray:
        """(rods, modes) deflection of the modes."""
        return self._modes.shape_at([rod.place_m for rod in self._plate.rods])

    def _rods(self, amplitude: np.ndarray) -> Mesh:
        """A line each, from the base, which stands still, to the lower face of the plate."""
        rods, n = self._plate.rods, len(self._plate.rods)
        place = np.array([[*rod.place_m, -self._plate.thickness_m] for rod in rods])
        base = place - [[0.0, 0.0, rod.length_m] for rod in rods]
        return Mesh(np.vstack([base, place]), np.column_stack([np.arange(n), np.arange(n, 2 * n)]),
                    {"displacement_m": _upwards(np.concatenate([np.zeros(n), self._at_rods @ amplitude])),
                     "radius_m": np.tile([rod.diameter_m / 2 for rod in rods], 2)},
                    {"force_N": self._modes.rod_force @ amplitude, "rod": np.arange(1, n + 1, dtype="i4")})


def wall_mesh(scene: Scene) -> Mesh | None:
    """The side walls as rectangles, numbered from 1 in the order of the scene's edges; None without any."""
    boxes_m = scene.plate.wall_boxes_m.values()
    if not boxes_m:
        return None
    corners = []
    for x0, x1, y0, y1, z0, z1 in boxes_m:  # flat along x or along y
        corners += [(x0, y0, z0), (x1, y1, z0), (x1, y1, z1), (x0, y0, z1)]
    number = np.arange(len(boxes_m))
    return Mesh(np.array(corners), 4 * number[:, None] + np.arange(4), cell_data={"wall": (number + 1).astype("i4")})


def shown_contacts(rows: np.ndarray, assembly: Assembly, weak: WeakContact | None) -> list[HertzContact]:
    """The contacts of a picture, given as `read_pictures` does, without those so weak that a stone's own push is a
    thousand times theirs (`weak`): chips that lie on the plate."""
    modulus = [stone.substance.modulus_on_plate_Pa for stone in assembly.stones]
    return [HertzContact(x, y, force, radius, modulus[int(stone) - 1]) for stone, x, y, force, radius in rows
            if weak is None or force > weak.force_N]


def _upwards(w: np.ndarray) -> np.ndarray:
    return np.column_stack([np.zeros((len(w), 2)), w])


def read_pictures(file: Path, sizes: np.ndarray) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield of each picture of the engine (fix_pictures.h) the DEM step; the stones that are near, 0-based; place (m)
    and velocity (m/s) of their sub-spheres, (n, 6); and the contacts with the plate, (k, 5): stone (from 1), x, y (m),
    force (N), radius (m). `sizes` are the stones' numbers of sub-spheres. Raises RuntimeError for a file that is cut
    off or damaged."""
    with open(file, "rb") as pictures:
        while head := pictures.read(24):
            whole = len(head) == 24
            dem_step, n_contacts, n_near = np.frombuffer(head, dtype="<i8") if whole else (-1, 0, 0)
            near = np.fromfile(pictures, dtype="<i8", count=max(0, n_near))
            whole = whole and len(near) == n_near and bool(np.all((near >= 0) & (near < len(sizes))))
            n = int(sizes[near].sum()) if whole else 0
            spheres = np.fromfile(pictures, dtype="<f4", count=6 * n)
            contacts = np.fromfile(pictures, dtype="<f8", count=5 * max(0, n_contacts))
            if not whole or len(spheres) != 6 * n or len(contacts) != 5 * n_contacts or not (
                    np.all(np.isfinite(spheres)) and np.all(np.isfinite(contacts))):
                raise RuntimeError(f"{file}: cut off or damaged")
            yield int(dem_step), near, spheres.reshape(n, 6), contacts.reshape(n_contacts, 5)
