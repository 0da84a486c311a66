"""The picture that stands where the page's view will be: seen by the same camera, drawn without a graphics card."""

from collections.abc import Callable

import numpy as np
from matplotlib.collections import EllipseCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from analysis import Run
from analysis.sweep.breakage import Network
from common.run_summary import RecordedPlate
from report.drawing.style import STRESS_COLOURS
from report.film.pictures import Film, instants, read_film

SIZE_IN = (9.0, 5.6)
#: As in templates/film_scene.js (film.VIEW, film.OPENING).
AZIMUTH, HEIGHT, OPENING_DEG = -0.98, 0.42, 30.0
#: Coal and gangue, as in templates/film.js.
ROCK_COLOURS = np.array([[66, 66, 70], [214, 160, 96]]) / 255
#: To which the plate's motion is enlarged, as in templates/film.js.
GREATEST_DEFLECTION_M = 0.01


def still(run: Run, network: Network) -> Figure:
    """Draw in perspective the picture of a run that is nearest to its largest force, with the plate's motion enlarged.
    Raises MissingResult if there is none."""
    peak_s, plate = largest_force_s(run), run.scene.plate
    film = read_film([min(instants(run.path), key=lambda instant: abs(instant.t_s - peak_s))], network)
    figure = Figure(figsize=SIZE_IN, facecolor="none")
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    half = np.tan(np.radians(OPENING_DEG / 2))
    aspect = SIZE_IN[0] / SIZE_IN[1]
    axis.set_xlim(-half * aspect, half * aspect)
    axis.set_ylim(-half, half)
    axis.set_axis_off()
    project = camera(plate, aspect)
    quads_m, stress_Pa = _quads(film) if film.quad.size else (corners_m(plate)[None, 4:] * [1, 1, 0], np.zeros(1))
    axis.add_collection(PolyCollection(
        list(project(quads_m)[0]), array=stress_Pa, cmap=STRESS_COLOURS, linewidth=0.3, edgecolor="face",
        norm=Normalize(0, max(float(stress_Pa.max()), 1.0))))
    plane, depth = project(film.centre_m[0])
    there = np.flatnonzero(np.isfinite(depth))
    order = there[np.argsort(-depth[there])]
    diameter = 2 * network.radius_m[order] / depth[order]
    is_gangue = np.array([name == "gangue" for name in run.materials])[network.agglomerate - 1]
    axis.add_collection(EllipseCollection(
        diameter, diameter, np.zeros_like(diameter), units="xy", offsets=plane[order], transOffset=axis.transData,
        facecolor=ROCK_COLOURS[is_gangue[order].astype(int)], edgecolor=(0, 0, 0, 0.35), linewidth=0.3))
    return figure


def _quads(film: Film) -> tuple[np.ndarray, np.ndarray]:
    """Corners (q, 4, 3) of the plate's quads, enlarged, and von Mises stress (q,) of each."""
    w_m = film.deflection_m[0]
    enlarged = GREATEST_DEFLECTION_M / max(float(np.abs(w_m).max()), 1e-12)
    nodes_m = np.column_stack([film.node_m, w_m * min(enlarged, 1e4)])
    return nodes_m[film.quad], film.stress_Pa[0][film.quad].mean(axis=1)


def corners_m(plate: RecordedPlate) -> np.ndarray:
    """What the view has to show whole (8, 3): the plate on its rods, and as much above it as stones rise."""
    x, y = (side / 2 for side in plate.size_m or (0.5, 0.5))
    rods_m = max((float(rod.as_json().get("length_m", 0.1)) for rod in plate.rods or []), default=0.0)
    heights_m = (-(plate.thickness_m or 0.01) - rods_m, 0.3 * max(x, y))
    return np.array([(*corner, z) for z in heights_m for corner in ((-x, -y), (x, -y), (x, y), (-x, y))])


def camera(plate: RecordedPlate, aspect: float) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Return what projects points (..., 3) of the plate's coordinates: to where they are seen, over their distance
    (..., 2), and that distance in m (...). It stands upright, and as near as shows all corners."""
    lean = np.radians(plate.tilt_deg)
    turn = np.array([[np.cos(lean), 0, -np.sin(lean)], [0, 1, 0], [np.sin(lean), 0, np.cos(lean)]])
    toward = turn @ (np.cos(HEIGHT) * np.cos(AZIMUTH), np.cos(HEIGHT) * np.sin(AZIMUTH), np.sin(HEIGHT))
    right = turn @ (-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0)
    axes, corners = np.stack([right, np.cross(toward, right), toward]), corners_m(plate)
    middle = corners.mean(axis=0)
    seen = (corners - middle) @ axes.T
    reach = np.maximum(np.abs(seen[:, 1]), np.abs(seen[:, 0]) / aspect)
    distance = np.max(seen[:, 2] + reach / (0.96 * np.tan(np.radians(OPENING_DEG / 2))))

    def project(points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at = (points_m - middle) @ axes.T
        depth = distance - at[..., 2]
        return at[..., :2] / depth[..., None], depth

    return project


def largest_force_s(run: Run) -> float:
    return float(run.finest["t_s"].iloc[int(np.argmax(run.finest["force_N"].to_numpy()))])
