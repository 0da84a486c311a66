"""Arrays of the pictures of a run (dem/record/vtk_file.py), read with little work.

meshio turns arrays that are appended as bytes into text and back, and reads those that nobody asks for: it takes ten
times as long.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Collection
from pathlib import Path

import numpy as np

from common.files.whole import refuse_irregular

APPENDED = b'<AppendedData encoding="raw">\n_'
Arrays = dict[str, np.ndarray]
NUMPY_TYPES = {"Float32": "<f4", "Int32": "<i4", "UInt16": "<u2", "UInt8": "<u1"}


def read_arrays(file: Path, names: Collection[str]) -> Arrays:
    """Return the arrays of these names, as far as the file has them: `points` (n, 3), `quads` (k, 4) as numbers of
    points, and what is at points, (n,) or (n, 3).

    Raises OSError or ValueError where the file cannot be read.
    """
    refuse_irregular(file)
    head, mark, data = file.read_bytes().partition(APPENDED)
    if not mark:
        return _by_meshio(file)
    try:
        return _of_names(ElementTree.fromstring(head + b"</VTKFile>"), data, names)
    except (LookupError, SyntaxError, zlib.error) as error:
        raise ValueError(f"{file}: damaged ({error})") from error


def _of_names(head: ElementTree.Element, data: bytes, names: Collection[str]) -> Arrays:
    found = {}
    for array in head.iter("DataArray"):
        name = array.attrib["Name"].replace("connectivity", "quads")
        if name in names:
            values = np.frombuffer(_unpacked(data, int(array.attrib["offset"])), NUMPY_TYPES[array.attrib["type"]])
            columns = 4 if name == "quads" else int(array.attrib.get("NumberOfComponents", 1))
            found[name] = values if columns == 1 else values.reshape(-1, columns)
    return found


def _unpacked(data: bytes, at: int) -> bytes:
    """An array that begins at a byte: numbers of its blocks, of their bytes and of the last one's, the lengths of the
    compressed blocks, and these."""
    count = int(np.frombuffer(data, "<u4", 1, at)[0])
    ends = at + 4 * (3 + count) + np.cumsum([0, *np.frombuffer(data, "<u4", count, at + 12)])
    return b"".join(zlib.decompress(data[begin:end]) for begin, end in zip(ends, ends[1:], strict=False))


def _by_meshio(file: Path) -> Arrays:
    """Of a file of any other form, as runs of 0.1.0 have them."""
    import meshio  # late: few runs need it

    try:
        mesh = meshio.read(file)
    except (SystemExit, LookupError, meshio.ReadError) as error:
        raise ValueError(f"{file}: {error}") from error
    quads = [block.data for block in mesh.cells if block.type == "quad"]
    return {"points": mesh.points, **mesh.point_data, **({"quads": np.vstack(quads)} if quads else {})}
