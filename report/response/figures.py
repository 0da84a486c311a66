"""Figures of the plate's response: contact forces (Figures 17, 18) and stress (Figures 20, 21)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from report.drawing.style import ACCENT, STRESS_COLOURS, bar_axes, canvas, hide_scales, styled

ForceLine = tuple[str, Any, np.ndarray, np.ndarray]


@styled
def contact_forces(lines: list[ForceLine], label: str, first_ms: float = 1.0) -> Figure:
    """Draw forces over time, the first collision apart from the rest, which is left out where nothing pushes again.

    lines: (name, with "_" before it for none in the legend, colour, t_s, force in the unit of the label). first_ms: the
    time that parts the two panels.
    """
    parts = [[(name, colour, 1e3 * t_s[here], values[here]) for name, colour, t_s, values in lines
              for here in [(1e3 * t_s <= first_ms) == early]] for early in (True, False)]
    again = any(np.any(values != 0) for *_, values in parts[1])
    figure, axes = canvas(1 + again, height_in=3.8 if again else 2.4)
    for axis, part, title in zip(axes[:, 0], parts, (f"{label}: first collision", "after it"), strict=False):
        for name, colour, t_ms, values in part:
            axis.plot(t_ms, values, color=colour, linewidth=1.0, label=name)
        axis.set(xlabel="time, ms")
        axis.set_title(title)
    pushes = [t_ms[values != 0].max() for *_, t_ms, values in parts[0] if np.any(values != 0)]
    axes[0, 0].set_xlim(0, min(first_ms, 1.15 * max(pushes, default=first_ms)))
    if any(not name.startswith("_") for name, *_ in lines):
        axes[0, 0].legend()
    return figure


@styled
def felt(panels: list[tuple[str, np.ndarray, np.ndarray]]) -> Figure:
    """Draw signals over time, one below the other. panels: (label, t_s, values)."""
    figure, axes = canvas(len(panels), height_in=0.5 + 1.7 * len(panels), sharex=True)
    for axis, (label, t_s, values) in zip(axes[:, 0], panels, strict=True):
        axis.plot(1e3 * t_s, values, color=ACCENT, linewidth=0.8, label="_" + label)
        axis.set_title(label)
    axes[-1, 0].set_xlabel("time, ms")
    return figure


@styled
def stress_maps(
    lines_m: tuple[np.ndarray, np.ndarray], maps_Pa: list[np.ndarray], ratios: np.ndarray, points_m: np.ndarray
) -> Figure:
    """Draw the von Mises stress of the plate's surface for each ratio (Figure 21).

    lines_m: x (nx,) and y (ny,). maps_Pa: shape (nx, ny) each. points_m: crosses to draw, shape (k, 2).
    """
    columns = min(3, len(ratios))
    rows = -(-len(ratios) // columns)
    aspect = (lines_m[1][-1] - lines_m[1][0]) / (lines_m[0][-1] - lines_m[0][0])
    figure, axes = canvas(rows, columns, height_in=(1.5 * aspect + 0.25) * rows + 0.55, bar="bottom")
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
    figure.colorbar(ScalarMappable(Normalize(0, top_MPa), STRESS_COLOURS), cax=bar_axes(figure),
                    orientation="horizontal", label="von Mises stress, MPa")
    return figure
