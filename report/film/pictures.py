"""The pictures of a run (view.pvd), read back for the page: sub-spheres and plate at chosen instants.

meshio turns arrays that are appended as bytes into text and back, and reads those that nobody asks for: it takes ten
times as long as what reads the arrays here.
"""

import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analysis.sweep.breakage import Network
from common.files.whole import refuse_irregular
from report.missing import MissingResult

PARTICLES = ("points", "radius_m", "agglomerate")
PLATE = ("points", "quads", "displacement_m", "von_mises_Pa")
APPENDED = b'<AppendedData encoding="raw">\n_'
Arrays = dict[str, np.ndarray]
NUMPY_TYPES = {"Float32": "<f4", "Int32": "<i4", "UInt16": "<u2", "UInt8": "<u1"}


@dataclass(frozen=True)
class Series:
    """A stretch of time that the reader can play. key: in the page. most: pictures of it, evenly chosen."""

    key: str
    title: str
    until_s: float
    most: int


#: The first collision of stones with the plate is over well before 1.2 ms; recognition reads 40 ms.
IMPACT, EARLY, WHOLE = (Series("impact", "impact", 1.2e-3, 61), Series("early", "first 40 ms", 0.04, 100),
                        Series("whole", "whole run", np.inf, 100))


@dataclass(frozen=True)
class Instant:
    """One picture on disk. plate: None for a rigid plate."""

    t_s: float
    particles: Path
    plate: Path | None


@dataclass(frozen=True)
class Film:
    """Pictures of one run: k instants, n sub-spheres, p nodes of the plate (p = 0 for a rigid one).

    t_s (k,). centre_m (k, n, 3), not a number of what is not there. deflection_m (k, p): of the plate, upwards.
    stress_Pa (k, p): von Mises stress of bending at its surface. node_m (p, 2). quad (q, 4): numbers of nodes.
    """

    t_s: np.ndarray
    centre_m: np.ndarray
    deflection_m: np.ndarray
    stress_Pa: np.ndarray
    node_m: np.ndarray
    quad: np.ndarray

    def at(self, instants: list[int]) -> "Film":
        """Of these instants alone."""
        return replace(self, **{name: getattr(self, name)[instants]
                                for name in ("t_s", "centre_m", "deflection_m", "stress_Pa")})


def instants(run: Path) -> list[Instant]:
    """Return the pictures of a run in order of time. Raises MissingResult if the run has none."""
    file = run / "view.pvd"
    if not file.is_file():
        raise MissingResult(f"{run.name}: no view.pvd; `time.view_interval_s` in the scene asks for pictures")
    by_time: dict[float, dict[str, Path]] = {}
    for entry in ElementTree.parse(file).iter("DataSet"):
        picture = run / entry.attrib["file"]
        by_time.setdefault(float(entry.attrib["timestep"]), {})[picture.name.split("_")[0]] = picture
    return [Instant(t_s, files["particles"], files.get("plate")) for t_s, files in sorted(by_time.items())
            if "particles" in files]


def choose(found: list[Instant], series: Series) -> list[Instant]:
    """Return the pictures nearest to evenly spaced instants of a series, each at most once."""
    t_s = np.array([instant.t_s for instant in found if instant.t_s <= series.until_s])
    if not t_s.size:
        return []
    wanted_s = np.linspace(0.0, t_s[-1], series.most)
    return [found[k] for k in np.unique(np.abs(t_s[None, :] - wanted_s[:, None]).argmin(axis=1))]


def read_film(chosen: list[Instant], network: Network) -> Film:
    """Read the pictures at the chosen instants. Raises MissingResult if one cannot be read or is not of the stones."""
    try:
        particles = [read_arrays(instant.particles, PARTICLES) for instant in chosen]
        plates = [read_arrays(instant.plate, PLATE) for instant in chosen if instant.plate is not None]
    except (OSError, ValueError, KeyError) as error:
        raise MissingResult(f"a picture cannot be read: {' '.join(str(error).split())}") from None
    if len(plates) not in (0, len(particles)):
        raise MissingResult("the plate is not in all pictures of the run")
    t_s = np.array([instant.t_s for instant in chosen])
    centre_m = np.stack([_placed(found, network) for found in particles])
    if not plates:
        nothing = np.empty((len(t_s), 0))
        return Film(t_s, centre_m, nothing, nothing, np.empty((0, 2)), np.empty((0, 4), dtype=int))
    deflection_m = np.stack([found["displacement_m"][:, 2] for found in plates])
    stress_Pa = np.stack([found["von_mises_Pa"] for found in plates])
    return Film(t_s, centre_m, deflection_m, stress_Pa, plates[0]["points"][:, :2], plates[0]["quads"])


def _placed(found: Arrays, network: Network) -> np.ndarray:
    """Centres of all sub-spheres (n, 3), from a picture of those that are there: stone by stone in the order of their
    numbers. In a stone that lost some, the radii tell which are left."""
    shown = found["agglomerate"]
    radius_m = found["radius_m"]
    centre_m = np.full((network.radius_m.size, 3), np.nan, dtype=np.float32)
    if len(shown) != len(radius_m) or shown.max(initial=0) > network.agglomerate.max():
        raise MissingResult(f"the pictures show {len(radius_m)} sub-spheres, the deck {network.radius_m.size}")
    begins = np.searchsorted(network.agglomerate, shown)  # of its stone, for each one shown
    here, whole = np.bincount(shown, minlength=2), np.bincount(network.agglomerate)
    number = np.arange(len(shown)) - np.searchsorted(shown, shown) + begins
    for stone in np.flatnonzero((here > 0) & (here < whole[: here.size])):
        rows, k = np.flatnonzero(shown == stone), np.searchsorted(network.agglomerate, stone)
        for row in rows:
            while k < len(centre_m) and not np.isclose(network.radius_m[k], radius_m[row], rtol=1e-5):
                k += 1
            number[row], k = k, k + 1
    if (number >= len(centre_m)).any() or not np.allclose(network.radius_m[number], radius_m, rtol=1e-5):
        raise MissingResult("the pictures do not show the sub-spheres of the deck")
    centre_m[number] = found["points"]
    return centre_m


def read_arrays(file: Path, names: Collection[str]) -> Arrays:
    """The arrays of these names: `points` (n, 3), `quads` (k, 4) as numbers of points, and what is at points, (n,) or
    (n, 3). Raises OSError or ValueError where the file cannot be read or lacks one."""
    refuse_irregular(file)
    head, mark, data = file.read_bytes().partition(APPENDED)
    if not mark:
        raise ValueError(f"{file}: has no appended arrays")
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
    if missing := set(names) - set(found):
        raise LookupError(f"no {', '.join(sorted(missing))}")
    return found


def _unpacked(data: bytes, at: int) -> bytes:
    """An array that begins at a byte: numbers of its blocks, of their bytes and of the last one's, the lengths of the
    compressed blocks, and these."""
    count = int(np.frombuffer(data, "<u4", 1, at)[0])
    ends = at + 4 * (3 + count) + np.cumsum([0, *np.frombuffer(data, "<u4", count, at + 12)])
    return b"".join(zlib.decompress(data[begin:end]) for begin, end in zip(ends, ends[1:], strict=False))
