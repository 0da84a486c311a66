"""The pictures of a run (view.pvd), read back for the page: sub-spheres and plate at chosen instants."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from report.film.vtu_file import Arrays, read_arrays
from report.missing import MissingResult

PARTICLES = ("points", "radius_m")
PLATE = ("points", "quads", "displacement_m", "von_mises_Pa")


@dataclass(frozen=True)
class Series:
    """A stretch of time that the reader can play. key: in the page. until_s, step_s: wanted instants 0, step_s, ..."""

    key: str
    title: str
    until_s: float
    step_s: float


#: The first collision of stones with the plate is over well before 1.2 ms; recognition reads 40 ms.
SERIES = (
    Series("impact", "impact", 1.2e-3, 2e-5),
    Series("early", "first 40 ms", 0.04, 4e-4),
    Series("whole", "whole run", np.inf, 6e-3),
)


@dataclass(frozen=True)
class Instant:
    """One picture on disk. plate: None for a rigid plate."""

    t_s: float
    particles: Path
    plate: Path | None


@dataclass(frozen=True)
class Film:
    """Pictures of one run: k instants, n sub-spheres, p nodes of the plate (p = 0 for a rigid one).

    t_s (k,). centre_m (k, n, 3). radius_m (n,). deflection_m (k, p): vertical displacement of the plate, upwards.
    stress_Pa (k, p): von Mises stress of bending at its surface. node_m (p, 2). quad (q, 4): numbers of nodes.
    """

    t_s: np.ndarray
    centre_m: np.ndarray
    radius_m: np.ndarray
    deflection_m: np.ndarray
    stress_Pa: np.ndarray
    node_m: np.ndarray
    quad: np.ndarray


def instants(run: Path) -> list[Instant]:
    """Return the pictures of a run in order of time. Raises MissingResult if the run has none."""
    file = run / "view.pvd"
    if not file.is_file():
        raise MissingResult(f"{run.name}: no view.pvd; `output.view_interval_s` in the scene asks for pictures")
    by_time: dict[float, dict[str, Path]] = {}
    for entry in ElementTree.parse(file).iter("DataSet"):
        picture = run / entry.attrib["file"]
        by_time.setdefault(float(entry.attrib["timestep"]), {})[picture.name.split("_")[0]] = picture
    return [
        Instant(t_s, files["particles"], files.get("plate"))
        for t_s, files in sorted(by_time.items())
        if "particles" in files
    ]


def choose(found: list[Instant], series: Series) -> list[Instant]:
    """Return the pictures nearest to the wanted instants of a series, each at most once and none of another stretch."""
    t_s = np.array([instant.t_s for instant in found])
    if t_s.size == 0:
        return []
    wanted_s = np.arange(0.0, min(series.until_s, t_s[-1]) + 0.5 * series.step_s, series.step_s)
    nearest = np.abs(t_s[None, :] - wanted_s[:, None]).argmin(axis=1)
    close = np.abs(t_s[nearest] - wanted_s) < 0.75 * series.step_s
    return [found[k] for k in np.unique(nearest[close])]


def read_film(chosen: list[Instant]) -> Film:
    """Read the pictures at the chosen instants. Raises MissingResult if one cannot be read or has lost sub-spheres."""
    try:
        particles = [read_arrays(instant.particles, PARTICLES) for instant in chosen]
        plates = [read_arrays(instant.plate, PLATE) for instant in chosen if instant.plate is not None]
        return _film_of(np.array([instant.t_s for instant in chosen]), particles, plates)
    except (OSError, ValueError, KeyError) as error:
        raise MissingResult(f"a picture cannot be read: {' '.join(str(error).split())}") from None


def _film_of(t_s: np.ndarray, particles: list[Arrays], plates: list[Arrays]) -> Film:
    if len({len(found["points"]) for found in particles}) != 1 or len(plates) not in (0, len(particles)):
        raise MissingResult("the pictures of the run do not show the same sub-spheres and plate")
    centre_m = np.stack([found["points"] for found in particles]).astype(np.float32)
    radius_m = np.ravel(particles[0]["radius_m"])
    if not plates:
        nothing = np.empty((len(t_s), 0))
        return Film(t_s, centre_m, radius_m, nothing, nothing, np.empty((0, 2)), np.empty((0, 4), dtype=int))
    deflection_m = np.stack([found["displacement_m"][:, 2] for found in plates])
    stress_Pa = np.stack([np.ravel(found["von_mises_Pa"]) for found in plates])
    return Film(t_s, centre_m, radius_m, deflection_m, stress_Pa, plates[0]["points"][:, :2], plates[0]["quads"])
