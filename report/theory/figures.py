"""The figures of the theory: Figures 7 to 11 of the paper."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle

from analysis import RecordError
from analysis.theory.contact_states import contact_stiffness, materials_in_order, sphere_mass_kg
from analysis.theory.impact import DAMPING, force_history
from report.drawing.figure_spec import Drawn, figure
from report.drawing.style import ACCENT, COAL, GANGUE, PALE, RATIO_LABEL, canvas, legend_above, material_colour
from report.missing import MissingResult
from report.sweep_results import SweepResults

#: Label, line and colour of each contact state.
STATES = {
    "PH": ("Hertz, rigid", "-", COAL),
    "HN": ("Hertz, deflection", "--", PALE),
    "PF": ("Flores, rigid", "-.", ACCENT),
    "FN": ("Flores, deflection", ":", GANGUE),
}


@figure("fig-7", "Arrangement", "Stones with their number and, given room, when gangue replaces coal; grey: rods.")
def arrangement(results: SweepResults) -> Drawn:
    s, plate = results.theory.setup, results.runs[0].scene.plate
    if plate.rods is None or plate.size_m is None:
        raise MissingResult("the scene in run.json has no plate with its rods and size")
    size_m = plate.size_m
    figure, axes = canvas(1, height_in=4.2)
    axis = axes[0, 0]
    axis.add_patch(Rectangle((-size_m[0] / 2, -size_m[1] / 2), *size_m, facecolor="#eef1f3", edgecolor=PALE))
    for rod in plate.rods:
        axis.add_patch(Circle((rod.place_m[0], rod.place_m[1]), 0.01, facecolor=PALE))
    rank = {place: k for k, place in enumerate(s.gangue_order, 1)}
    roomy = 2 * s.radius_m > 0.08 * max(size_m)  # of two lines of text
    for number, (x, y) in enumerate(s.places_m, 1):
        axis.add_patch(Circle((x, y), s.radius_m, facecolor="#d9b58f", edgecolor=GANGUE))
        label = f"#{number}\n{rank[number]}." if roomy else str(number)
        axis.text(x, y, label, ha="center", va="center", color="#221a10")  # on dark too
    axis.set_xlim(-0.52 * size_m[0], 0.52 * size_m[0])
    axis.set_ylim(-0.52 * size_m[1], 0.52 * size_m[1])
    axis.set_aspect("equal")
    axis.set(xlabel="x, m (axis A-B, length L)", ylabel="y, m")
    axis.grid(False)
    return figure


@figure("fig-8", "Mixing order", "The order of the scene.", ratios=2)
def mixing_order(results: SweepResults) -> Drawn:
    counts, order = results.theory.gangue_counts, results.theory.setup.gangue_order
    figure, axes = canvas(1, height_in=2.8)
    axis = axes[0, 0]
    for row, count in enumerate(counts):
        for place, name in enumerate(materials_in_order(count, order), 1):
            axis.plot(place, row, "o", color=material_colour(name), markersize=7)
    axis.set_yticks(range(len(counts)), [f"{100 * count / counts[-1]:.0f} %" for count in counts])
    places = range(1, counts[-1] + 1)
    axis.set_xticks(places, [f"#{k}" for k in places])
    axis.invert_yaxis()
    axis.set_title("grey: coal, brown: gangue")
    axis.grid(False)
    return figure


def _plot_states(axis: Axes, x: np.ndarray, forces_N: dict[str, np.ndarray]) -> None:
    for key, force_N in forces_N.items():
        label, line, colour = STATES[key]
        axis.plot(x, 1e-3 * force_N, line, color=colour, label=label)


@figure("fig-9", "Largest force against position",
        "Eqs. 8, 9, 19, 20, 26-30 with the scene's values, restitution included.")
def peak_against_position(results: SweepResults) -> Drawn:
    x_m = np.linspace(-0.49, 0.49, 99) * results.theory.setup.support_length_m
    peaks_N = results.theory.single_peaks_N(x_m)
    figure, axes = canvas(1, len(results.kinds), height_in=2.7, sharey=True)
    for axis, kind in zip(axes[0], results.kinds, strict=True):
        _plot_states(axis, x_m, peaks_N[kind])
        axis.set_title(kind)
        axis.set_xlabel("x from the centre, m")
    axes[0, 0].set_ylabel("largest force, kN")
    legend_above(axes[0, 0])
    return figure


@figure("fig-10", "Total force",
        "With the beam formula, and with the static compliance of the real plate on its rods; points: largest "
        "simulated force.", ratios=2)
def totals(results: SweepResults) -> Drawn:
    panels, note = {"plate as a beam": results.theory.beam_totals_N}, ""
    try:
        panels["real plate (modes)"] = results.theory.real_plate_totals_N
    except RecordError as reason:
        note = f"Real plate not drawn: {reason}."
    counts, force_N = results.theory.gangue_counts, results.sweep.peaks("force_N")
    figure, axes = canvas(1, len(panels), height_in=3.0, sharey=True)
    for axis, (title, states) in zip(axes[0], panels.items(), strict=True):
        _plot_states(axis, 100 * (counts / counts[-1]), states)
        axis.plot(100 * results.ratios, 1e-3 * force_N, "o", color="black", markersize=3, label="simulated")
        axis.set_title(title)
        axis.set_xlabel(RATIO_LABEL)
    axes[0, 0].set_ylabel("total force, kN")
    axes[0, 0].set_ylim(bottom=0)
    legend_above(axes[0, 0])
    return figure, note


@figure("fig-laws", "Force histories",
        "One stone on a rigid plate. The damped force peaks before the largest compression and above the force of "
        "Eq. 20.")
def force_histories(results: SweepResults) -> Drawn:
    s = results.theory.setup
    figure, axes = canvas(1, len(results.kinds), height_in=2.6, sharey=True)
    for axis, name in zip(axes[0], results.kinds, strict=True):
        rock, e = s.rocks[name], s.restitution[name]
        stiffness, mass_kg = contact_stiffness(rock, s.radius_m, s.plate), sphere_mass_kg(rock, s.radius_m)
        looks = zip((PALE, GANGUE, ACCENT, COAL), ("-", "-", "--", ":"), (3.2, 2.4, 1.5, 1.5), strict=True)
        for (colour, line, width), law in zip(looks, DAMPING, strict=False):  # some lie together
            found = force_history(law, stiffness, mass_kg, s.speed_m_s, e)
            axis.plot(1e6 * found.t_s, 1e-3 * found.force_N, line, color=colour, linewidth=width,
                      label=law.replace("_", "-").title())
        axis.set_title(f"{name}, e = {e:g}")
        axis.set_xlabel("time, µs")
    axes[0, 0].set_ylabel("force, kN")
    legend_above(axes[0, 0])
    return figure


THEORY_FIGURES = [arrangement, mixing_order, peak_against_position, totals, force_histories]
