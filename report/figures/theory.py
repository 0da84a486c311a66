"""Pictures of the theory (Figures 7-10) and of the arrangement."""

from __future__ import annotations

import numpy as np
from matplotlib.patches import Circle, Rectangle

from analysis.impact import ForceHistory
from report.figures.style import ACCENT, COAL, GANGUE, PALE, RATIO_LABEL, canvas, styled

STATE_LABELS = {
    "PH": "Hertz, rigid",
    "HN": "Hertz, deflection",
    "PF": "Flores, rigid",
    "FN": "Flores, deflection",
}
STATE_LINES = {"PH": "-", "HN": "--", "PF": "-.", "FN": ":"}
STATE_COLOURS = {"PH": COAL, "HN": PALE, "PF": ACCENT, "FN": GANGUE}


@styled
def arrangement(
    places_m: np.ndarray, radius_m: float, order: list[int], plate_m: tuple[float, float], rods_m
):
    """The ring of particles on the plate, with numbers and the order in which gangue replaces coal (Figures 7, 8)."""
    figure, axes = canvas(1, height_in=4.2)
    axis = axes[0, 0]
    axis.add_patch(
        Rectangle((-plate_m[0] / 2, -plate_m[1] / 2), *plate_m, facecolor="#eef1f3", edgecolor=PALE)
    )
    for x, y in rods_m:
        axis.add_patch(Circle((x, y), 0.01, facecolor=PALE))
    rank = {place: k for k, place in enumerate(order, 1)}
    for number, (x, y) in enumerate(places_m, 1):
        axis.add_patch(Circle((x, y), radius_m, facecolor="#d9b58f", edgecolor=GANGUE))
        axis.text(x, y, f"#{number}\n{rank[number]}.", ha="center", va="center", fontsize=8)
    axis.set_xlim(-0.52 * plate_m[0], 0.52 * plate_m[0])
    axis.set_ylim(-0.52 * plate_m[1], 0.52 * plate_m[1])
    axis.set_aspect("equal")
    axis.set_xlabel("x, m (axis A-B, length L)")
    axis.set_ylabel("y, m")
    axis.grid(False)
    return figure


@styled
def mixing_order(materials: list[list[str]], ratios: np.ndarray):
    """Which place holds gangue at each ratio (Figure 8); materials: one list per ratio."""
    figure, axes = canvas(1, height_in=2.8)
    axis = axes[0, 0]
    for row, names in enumerate(materials):
        for place, name in enumerate(names, 1):
            colour = GANGUE if name == "gangue" else COAL
            axis.plot(place, row, "o", color=colour, markersize=7)
    axis.set_yticks(range(len(ratios)), [f"{100 * r:.0f} %" for r in ratios])
    axis.set_xticks(range(1, len(materials[0]) + 1), [f"#{k}" for k in range(1, len(materials[0]) + 1)])
    axis.invert_yaxis()
    axis.set_title("black: coal, brown: gangue")
    axis.grid(False)
    return figure


@styled
def peak_against_position(x_m: np.ndarray, forces: dict[str, dict[str, np.ndarray]]):
    """Figure 9: largest force of one particle against where it hits, from the centre along A-B."""
    figure, axes = canvas(1, len(forces), height_in=2.7, sharey=True)
    for axis, (rock, states) in zip(axes[0], forces.items(), strict=True):
        for key, force in states.items():
            axis.plot(x_m, 1e-3 * force, STATE_LINES[key], color=STATE_COLOURS[key], label=STATE_LABELS[key])
        axis.set_title(rock)
        axis.set_xlabel("x from the centre, m")
    axes[0, 0].set_ylabel("largest force, kN")
    axes[0, 0].legend(loc="upper left")
    return figure


@styled
def totals(
    ratios: np.ndarray, panels: dict[str, dict[str, np.ndarray]], simulated: tuple[np.ndarray, np.ndarray]
):
    """Figure 10: total force of the four states against the ratio, beside the simulation (ratios, force_N)."""
    figure, axes = canvas(1, len(panels), height_in=3.0, sharey=True)
    for axis, (title, states) in zip(axes[0], panels.items(), strict=True):
        for key, force in states.items():
            axis.plot(
                100 * ratios,
                1e-3 * force,
                STATE_LINES[key],
                color=STATE_COLOURS[key],
                label=STATE_LABELS[key],
            )
        axis.plot(
            100 * simulated[0], 1e-3 * simulated[1], "o", color="black", markersize=3, label="simulated"
        )
        axis.set_title(title)
        axis.set_xlabel(RATIO_LABEL)
    axes[0, 0].set_ylabel("total force, kN")
    axes[0, 0].legend(loc="upper left")
    axes[0, 0].set_ylim(
        0, 1.35e-3 * max(force.max() for states in panels.values() for force in states.values())
    )
    return figure


@styled
def force_histories(histories: dict[str, dict[str, ForceHistory]]):
    """Force of one particle on a rigid plate by each law; histories: {rock: {law: ForceHistory}}."""
    figure, axes = canvas(1, len(histories), height_in=2.6, sharey=True)
    for axis, (rock, laws) in zip(axes[0], histories.items(), strict=True):
        for colour, (law, h) in zip((COAL, GANGUE, ACCENT, PALE), laws.items(), strict=False):
            axis.plot(1e6 * h.t_s, 1e-3 * h.force_N, color=colour, label=law.replace("_", "-"))
        axis.set_title(rock)
        axis.set_xlabel("time, µs")
    axes[0, 0].set_ylabel("force, kN")
    axes[0, 0].legend()
    return figure
