"""Files of VTK's XML formats (vtu, pvd), which ParaView reads, written with little work.

Arrays are appended as they lie in memory, in blocks compressed in zlib's format. What pays was measured on pictures of
the default scene (docs/runs.md): ISA-L takes a thirtieth of zlib's time for floating-point numbers and leaves less;
lists of points take zlib's search for repetitions; what is the same in the next picture is compressed once.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from isal import isal_zlib

from common.files.whole import named

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
    return (np.rint(np.asarray(values, dtype=float) * 2.0**bits) * 2.0**-bits).astype("f4")


def write_pvd(file: Path, entries: list[tuple[float, int, str]]) -> None:
    """Write a series for ParaView; `entries` are time (s), number of the part, and name of a file beside `file`."""
    rows = "\n".join(f'    <DataSet timestep="{t:.9g}" part="{part}" file="{name}"/>' for t, part, name in entries)
    with named(file):
        file.write_text('<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
                        f"  <Collection>\n{rows}\n  </Collection>\n</VTKFile>\n")
