"""Figures of the plate's response: contact forces (Figures 17, 18) and stress (Figures 20, 21)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from report.drawing.style import STRESS_COLOURS, canvas, hide_scales, styled

ForceLine = tuple[str, Any, np.ndarray, np.ndarray]


@styled
def contact_forces(lines: list[ForceLine], label: str, first_ms: float = 1.0) -> Figure:
    """Draw forces over time, the first collision apart from the rest.

    lines: (name, with "_" before it for none in the legend, colour, t_s, force in the unit of the label). first_ms: the
    time that parts the two panels.
    """
    figure, axes = canvas(2, height_in=3.8)
    upper, lower = axes[:, 0]
    for name, colour, t_s, values in lines:
        early = 1e3 * t_s <= first_ms
        upper.plot(1e3 * t_s[early], values[early], color=colour, label=name)
        lower.plot(1e3 * t_s[~early], values[~early], color=colour, linewidth=0.8, label=name)
    upper.set_title(label + ": first collision")
    lower.set_title("after it")
    lower.set_xlabel("time, ms")
    if any(not name.startswith("_") for name, *_ in lines):
        upper.legend()
    return figure


@styled
def stress_maps(
    lines_m: tuple[np.ndarray, np.ndarray], maps_Pa: list[np.ndarray], ratios: np.ndarray, points_m: np.ndarray
) -> Figure:
    """Draw the von Mises stress of the plate's surface for each ratio (Figure 21).

    lines_m: x (nx,) and y (ny,). maps_Pa: shape (nx, ny) each. points_m: crosses to draw, shape (k, 2).
    """
    columns = 3
    rows = -(-len(ratios) // columns)
    figure, axes = canvas(rows, columns, height_in=1.75 * rows + 0.5)
    top_MPa = 1e-6 * max(field.max() for field in maps_Pa)
    x_m, y_m = lines_m
    extent_m = tuple(line[end] + half * (line[1] - line[0]) for line in lines_m for end, half in ((0, -0.5), (-1, 0.5)))
    for axis, field, ratio in zip(axes.ravel(), maps_Pa, ratios, strict=False):
        # A map shaded as triangles looks the same and takes three times as long to draw.
        axis.imshow(1e-6 * field.T, STRESS_COLOURS, vmin=0, vmax=top_MPa, origin="lower", interpolation="bilinear",
                    extent=extent_m)
        axis.set(xlim=x_m[[0, -1]], ylim=y_m[[0, -1]])
        axis.plot(*points_m.T, "w+", markersize=3)
        axis.set_title(f"{100 * ratio:.0f} %")
        hide_scales(axis)
    for axis in axes.ravel()[len(ratios) :]:
        axis.set_visible(False)
    figure.colorbar(ScalarMappable(Normalize(0, top_MPa), STRESS_COLOURS), ax=axes[-1], orientation="horizontal",
                    fraction=0.03 * rows, aspect=40, pad=0.02 * rows, label="von Mises stress, MPa")  # fmt: skip
    return figure
