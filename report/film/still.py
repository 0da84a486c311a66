"""The picture that stands where the page's view will be: seen by the same camera, drawn without a graphics card."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.collections import EllipseCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from report.drawing.style import STRESS_COLOURS

SIZE_IN = (9.0, 5.6)
#: As in templates/film_scene.js (film.VIEW, and the opening angle of its camera).
AZIMUTH, HEIGHT, DISTANCE_M, TARGET_M, OPENING_DEG = -0.98, 0.42, 0.92, np.array([0.0, 0.0, -0.006]), 30.0
#: Coal and gangue, as in templates/film.js.
ROCK_COLOURS = np.array([[66, 66, 70], [214, 160, 96]]) / 255


@dataclass(frozen=True)
class StillScene:
    """What the picture shows, at one instant.

    centre_m (n, 3), radius_m (n,), is_gangue (n,): the sub-spheres. corner_m (q, 4, 3): the plate's quads, with its
    motion as much enlarged as it shall be seen; stress_Pa (q,): von Mises stress of each. stress_shown_Pa: the end of
    the colour scale.
    """

    centre_m: np.ndarray
    radius_m: np.ndarray
    is_gangue: np.ndarray
    corner_m: np.ndarray
    stress_Pa: np.ndarray
    stress_shown_Pa: float


def still(scene: StillScene) -> Figure:
    """Draw one instant in perspective."""
    figure = Figure(figsize=SIZE_IN, facecolor="#f4f5f6")
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    half = np.tan(np.radians(OPENING_DEG / 2))
    axis.set_xlim(-half * SIZE_IN[0] / SIZE_IN[1], half * SIZE_IN[0] / SIZE_IN[1])
    axis.set_ylim(-half, half)
    axis.set_axis_off()
    if len(scene.corner_m):
        plane, _ = _project(scene.corner_m)
        axis.add_collection(PolyCollection(list(plane), array=scene.stress_Pa, cmap=STRESS_COLOURS, linewidth=0.3,
                                           edgecolor="face",
                                           norm=Normalize(0, scene.stress_shown_Pa)))  # fmt: skip
    plane, depth = _project(scene.centre_m)
    order = np.argsort(-depth)
    diameter = 2 * scene.radius_m[order] / depth[order]
    axis.add_collection(EllipseCollection(
        diameter, diameter, np.zeros_like(diameter), units="xy", offsets=plane[order], transOffset=axis.transData,
        facecolor=ROCK_COLOURS[scene.is_gangue[order].astype(int)], edgecolor=(0, 0, 0, 0.35),
        linewidth=0.3))  # fmt: skip
    return figure


def _project(points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where points (..., 3) are seen, over their distance (..., 2), and that distance in m (...)."""
    toward = np.array([np.cos(HEIGHT) * np.cos(AZIMUTH), np.cos(HEIGHT) * np.sin(AZIMUTH), np.sin(HEIGHT)])
    right = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
    upward = np.cross(toward, right)
    from_camera = points_m - (TARGET_M + DISTANCE_M * toward)
    depth = -from_camera @ toward
    return np.stack([from_camera @ right, from_camera @ upward], axis=-1) / depth[..., None], depth
