"""The picture that stands where the page's view will be: seen by the same camera, drawn without a graphics card."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.collections import EllipseCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from analysis import Run
from analysis.sweep.breakage import Network
from common.run_summary import RecordedPlate
from report.drawing.style import STRESS_COLOURS
from report.film.pictures import instants, read_film

SIZE_IN = (9.0, 5.6)
#: As in templates/film_scene.js (film.VIEW, film.OPENING).
AZIMUTH, HEIGHT, OPENING_DEG = -0.98, 0.42, 30.0
#: Coal and gangue, as in templates/film.js.
ROCK_COLOURS = np.array([[66, 66, 70], [214, 160, 96]]) / 255
#: To which the plate's motion is enlarged, as in templates/film.js.
GREATEST_DEFLECTION_M = 0.01


@dataclass(frozen=True)
class StillScene:
    """What the picture shows, at one instant.

    centre_m (n, 3), radius_m (n,), is_gangue (n,): the sub-spheres. corner_m (q, 4, 3): the plate's quads, with its
    motion as much enlarged as it shall be seen; stress_Pa (q,): von Mises stress of each. stress_shown_Pa: the end of
    the colour scale. plate: its size, rods and tilt, which the camera follows.
    """

    centre_m: np.ndarray
    radius_m: np.ndarray
    is_gangue: np.ndarray
    corner_m: np.ndarray
    stress_Pa: np.ndarray
    stress_shown_Pa: float
    plate: RecordedPlate


def still(scene: StillScene) -> Figure:
    """Draw one instant in perspective."""
    figure = Figure(figsize=SIZE_IN, facecolor="none")
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    half = np.tan(np.radians(OPENING_DEG / 2))
    aspect = SIZE_IN[0] / SIZE_IN[1]
    axis.set_xlim(-half * aspect, half * aspect)
    axis.set_ylim(-half, half)
    axis.set_axis_off()
    project = camera(scene.plate, aspect)
    quads_m = scene.corner_m if len(scene.corner_m) else corners_m(scene.plate)[None, 4:] * [1, 1, 0]
    axis.add_collection(PolyCollection(
        list(project(quads_m)[0]), array=scene.stress_Pa if len(scene.corner_m) else np.zeros(1), cmap=STRESS_COLOURS,
        linewidth=0.3, edgecolor="face", norm=Normalize(0, scene.stress_shown_Pa)))
    plane, depth = project(scene.centre_m)
    there = np.flatnonzero(np.isfinite(depth))
    order = there[np.argsort(-depth[there])]
    diameter = 2 * scene.radius_m[order] / depth[order]
    axis.add_collection(EllipseCollection(
        diameter, diameter, np.zeros_like(diameter), units="xy", offsets=plane[order], transOffset=axis.transData,
        facecolor=ROCK_COLOURS[scene.is_gangue[order].astype(int)], edgecolor=(0, 0, 0, 0.35), linewidth=0.3))
    return figure


def corners_m(plate: RecordedPlate) -> np.ndarray:
    """What the view has to show whole (8, 3): the plate on its rods, and as much above it as stones rise."""
    x, y = ((side or 0.5) / 2 for side in (plate.length_m, plate.width_m))
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
    """When the force on the plate is largest."""
    return float(run.finest["t_s"].iloc[int(np.argmax(run.finest["force_N"].to_numpy()))])


def still_scene(run: Run, network: Network) -> StillScene:
    """Return the picture of a run that is nearest to its largest force. Raises MissingResult if there is none."""
    peak_s = largest_force_s(run)
    film = read_film([min(instants(run.path), key=lambda instant: abs(instant.t_s - peak_s))], network)
    is_gangue = np.array([name == "gangue" for name in run.materials])[network.agglomerate - 1]
    if not film.quad.size:
        return StillScene(film.centre_m[0], network.radius_m, is_gangue, np.empty((0, 4, 3)), np.empty(0), 1.0,
                          run.scene.plate)
    w_m = film.deflection_m[0]
    enlarged = GREATEST_DEFLECTION_M / max(float(np.abs(w_m).max()), 1e-12)
    nodes_m = np.column_stack([film.node_m, w_m * min(enlarged, 1e4)])
    stress_Pa = film.stress_Pa[0][film.quad].mean(axis=1)
    return StillScene(film.centre_m[0], network.radius_m, is_gangue, nodes_m[film.quad], stress_Pa,
                      max(float(stress_Pa.max()), 1.0), run.scene.plate)
