"""Figures of the theory (Figures 7 to 10) and of the arrangement."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from report.drawing.style import ACCENT, COAL, GANGUE, PALE, RATIO_LABEL, canvas, legend_above, material_colour, styled

STATE_LABELS = {
    "PH": "Hertz, rigid",
    "HN": "Hertz, deflection",
    "PF": "Flores, rigid",
    "FN": "Flores, deflection",
}
STATE_LINES = {"PH": "-", "HN": "--", "PF": "-.", "FN": ":"}
STATE_COLOURS = {"PH": COAL, "HN": PALE, "PF": ACCENT, "FN": GANGUE}


@styled
def arrangement(places_m: np.ndarray, radius_m: float, order: list[int], plate_m: tuple[float, float],
                rods_m: list[tuple[float, float]]) -> Figure:
    """Draw the ring of stones on the plate, with numbers and the order in which gangue replaces coal (Figures 7, 8).

    places_m: shape (stones, 2). order: numbers of the places, from 1. plate_m: length and width. rods_m: (x, y) each.
    """
    figure, axes = canvas(1, height_in=4.2)
    axis = axes[0, 0]
    corner = (-plate_m[0] / 2, -plate_m[1] / 2)
    axis.add_patch(Rectangle(corner, *plate_m, facecolor="#eef1f3", edgecolor=PALE))
    for x, y in rods_m:
        axis.add_patch(Circle((x, y), 0.01, facecolor=PALE))
    rank = {place: k for k, place in enumerate(order, 1)}
    roomy = 2 * radius_m > 0.08 * max(plate_m)  # of two lines of text
    for number, (x, y) in enumerate(places_m, 1):
        axis.add_patch(Circle((x, y), radius_m, facecolor="#d9b58f", edgecolor=GANGUE))
        label = f"#{number}\n{rank[number]}." if roomy else str(number)
        axis.text(x, y, label, ha="center", va="center", color="#221a10")  # on dark too
    axis.set_xlim(-0.52 * plate_m[0], 0.52 * plate_m[0])
    axis.set_ylim(-0.52 * plate_m[1], 0.52 * plate_m[1])
    axis.set_aspect("equal")
    axis.set_xlabel("x, m (axis A-B, length L)")
    axis.set_ylabel("y, m")
    axis.grid(False)
    return figure


@styled
def mixing_order(materials: list[list[str]], ratios: np.ndarray) -> Figure:
    """Draw which places hold gangue at each ratio (Figure 8). materials: one list a ratio."""
    figure, axes = canvas(1, height_in=2.8)
    axis = axes[0, 0]
    for row, names in enumerate(materials):
        for place, name in enumerate(names, 1):
            axis.plot(place, row, "o", color=material_colour(name), markersize=7)
    axis.set_yticks(range(len(ratios)), [f"{100 * r:.0f} %" for r in ratios])
    places = range(1, len(materials[0]) + 1)
    axis.set_xticks(places, [f"#{k}" for k in places])
    axis.invert_yaxis()
    axis.set_title("grey: coal, brown: gangue")
    axis.grid(False)
    return figure


@styled
def peak_against_position(x_m: np.ndarray, forces_N: dict[str, dict[str, np.ndarray]]) -> Figure:
    """Draw the largest force of one stone against its place along A-B (Figure 9).

    x_m: from the plate's centre, shape (k,). forces_N: {material: {state: shape (k,)}}.
    """
    figure, axes = canvas(1, len(forces_N), height_in=2.7, sharey=True)
    for axis, (material, states) in zip(axes[0], forces_N.items(), strict=True):
        _plot_states(axis, x_m, states)
        axis.set_title(material)
        axis.set_xlabel("x from the centre, m")
    axes[0, 0].set_ylabel("largest force, kN")
    legend_above(axes[0, 0])
    return figure


def _plot_states(axis: Axes, x: np.ndarray, forces_N: dict[str, np.ndarray]) -> None:
    for key, force_N in forces_N.items():
        axis.plot(x, 1e-3 * force_N, STATE_LINES[key], color=STATE_COLOURS[key], label=STATE_LABELS[key])


@styled
def totals(
    ratios: np.ndarray, panels: dict[str, dict[str, np.ndarray]], simulated: tuple[np.ndarray, np.ndarray]
) -> Figure:
    """Draw the total force of the four states against the ratio, beside the simulation (Figure 10).

    panels: {title: {state: force in N, shape of ratios}}. simulated: ratios and forces in N, shape (runs,) each.
    """
    figure, axes = canvas(1, len(panels), height_in=3.0, sharey=True)
    for axis, (title, states) in zip(axes[0], panels.items(), strict=True):
        _plot_states(axis, 100 * ratios, states)
        axis.plot(100 * simulated[0], 1e-3 * simulated[1], "o", color="black", markersize=3, label="simulated")
        axis.set_title(title)
        axis.set_xlabel(RATIO_LABEL)
    axes[0, 0].set_ylabel("total force, kN")
    axes[0, 0].set_ylim(bottom=0)
    legend_above(axes[0, 0])
    return figure


@styled
def force_histories(histories: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]) -> Figure:
    """Draw the force of one stone on a rigid plate by each law. histories: {title: {law: (t_s, force_N)}}."""
    figure, axes = canvas(1, len(histories), height_in=2.6, sharey=True)
    for axis, (title, laws) in zip(axes[0], histories.items(), strict=True):
        looks = zip((PALE, GANGUE, ACCENT, COAL), ("-", "-", "--", ":"), (3.2, 2.4, 1.5, 1.5), strict=True)
        for (colour, line, width), (law, (t_s, force_N)) in zip(looks, laws.items(), strict=False):  # some lie together
            axis.plot(1e6 * t_s, 1e-3 * force_N, line, color=colour, linewidth=width,
                      label=law.replace("_", "-").title())
        axis.set_title(title)
        axis.set_xlabel("time, µs")
    axes[0, 0].set_ylabel("force, kN")
    legend_above(axes[0, 0])
    return figure
