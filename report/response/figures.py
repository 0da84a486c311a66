"""The figures of the plate's response: Figures 16 to 21 of the paper."""

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from analysis import RecordError, Run
from report.drawing.figure_spec import Drawn, figure
from report.drawing.lines import against_ratio, curves, envelope
from report.drawing.style import ACCENT, STRESS_COLOURS, bar_axes, canvas, hide_scales, material_colour, ratio_colours
from report.missing import MissingResult
from report.sweep_results import SweepResults

FIRST_COLLISION_S = 1e-3
LATER_POINTS = 3000  # of a curve after the first collision, whose extremes all remain
MOTIONS = (("displacement, µm", "u_m", 1e6), ("velocity, m/s", "v_m_s", 1.0), ("acceleration, m/s²", "a_m_s2", 1.0))
ENERGIES = ("kinetic", "internal", "total")
#: Name, with "_" before it for none in the legend, colour, t_s, and force in kN.
ForceLine = tuple[str, Any, np.ndarray, np.ndarray]


@figure("fig-felt", "What the plate felt", "The whole run.")
def felt(results: SweepResults) -> Drawn:
    return felt_by_plate(results.runs[0], {}, LATER_POINTS, 1e3)[0]


def felt_by_plate(run: Run, more: dict[str, str], points: int, times: float) -> tuple[Figure, np.ndarray]:
    """Force on the plate, its acceleration where it moves, and `more` columns by their labels, over `times` the time in
    s. Returns the figure and its axes."""
    table = run.finest
    panels = [(label, unit * table[column]) for label, column, unit in (
        ("force on the plate, kN", "force_N", 1e-3),
        ("acceleration of the plate's centre of mass, m/s²", "a_m_s2", 1.0),
        *((label, column, 1.0) for label, column in more.items())) if column in table]
    figure, axes = canvas(len(panels), height_in=0.6 + 1.6 * len(panels), sharex=True)
    for axis, (label, values) in zip(axes[:, 0], panels, strict=True):
        t_s, shown = envelope(table["t_s"].to_numpy(), values.to_numpy(), points)
        axis.plot(times * t_s, shown, color=ACCENT, linewidth=0.6, label="_" + label)
        axis.set_title(label)
    axes[-1, 0].set_xlabel("time, ms" if times > 1 else "time, s")
    return figure, axes


@figure("fig-16", "Response of the plate", "Centre of mass of the plate.")
def motion_and_energy(results: SweepResults) -> Drawn:
    stack = results.sweep.stack
    panels = [*((label, unit * stack(name)) for label, name, unit in MOTIONS),
              *((f"{name} energy, J", stack(f"{name}_J")) for name in ENERGIES)]
    return curves(results.t_s, [(f"{letter}: {label}", values) for letter, (label, values)
                                in zip("abcdef", panels, strict=True)], results.ratios)


@figure("fig-17", "Force of one stone", ratios=2)
def single_force(results: SweepResults) -> Drawn:
    return _contact_forces([(f"{name} ({results.ratios[i]:.0%} run)", material_colour(name),
                             *_first_ms_and_envelope(results.runs[i], "force_03_N"))
                            for i, name in zip(results.indices_coal_gangue_at_3(), ("coal", "gangue"), strict=True)],
                           "force at place 3, kN")


@figure("fig-18", "Total contact force")
def total_force(results: SweepResults) -> Drawn:
    return _contact_forces([(f"_{100 * run.gangue_ratio:.0f} %", colour, *_first_ms_and_envelope(run, "force_N"))
                            for run, colour in zip(results.runs, ratio_colours(results.ratios), strict=True)],
                           "total force, kN")


def _first_ms_and_envelope(run: Run, column: str) -> tuple[np.ndarray, np.ndarray]:
    """Return times and forces in kN: all of the first collision, and of what follows as much as can be seen."""
    table = run.finest
    if column not in table:
        raise MissingResult(f"{run.path.name}: no {column}: the force of each stone is not kept where there are many")
    t_s, force_kN = table["t_s"].to_numpy(), 1e-3 * table[column].to_numpy()
    first = int(np.searchsorted(t_s, FIRST_COLLISION_S, side="right"))
    later = envelope(t_s[first:], force_kN[first:], LATER_POINTS)
    return np.concatenate([t_s[:first], later[0]]), np.concatenate([force_kN[:first], later[1]])


def _contact_forces(lines: list[ForceLine], label: str) -> Figure:
    """Forces over time, the first collision apart from the rest, which is left out where nothing pushes again."""
    first_ms = 1e3 * FIRST_COLLISION_S
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


@figure("fig-19", "Maxima against the ratio", "Largest values of each run.", ratios=2)
def maxima(results: SweepResults) -> Drawn:
    panels = [("total contact force, kN", {"force": 1e-3 * results.sweep.peaks("force_N")})]
    if results.plate_moves:
        panels += [(label, {"up": unit * up, "down": -unit * down}) for label, name, unit in MOTIONS
                   for up, down in [results.extremes(name).T]]
        panels += [("energy, J", {name: results.sweep.peaks(f"{name}_J") for name in ENERGIES}),
                   ("RMS of the acceleration, m/s²", {"rms": results.rms_m_s2})]
    return against_ratio(results.ratios, panels)


@figure("fig-21", "Stress of the plate",
        "Von Mises stress of bending at the top surface at the instant of the largest total force, without the "
        "contacts' own. Crosses: places of the stones.")
def bending_stress(results: SweepResults) -> Drawn:
    modes = results.plate.modes[0]
    x_m, y_m = (np.linspace(lines[0], lines[-1], 101) for lines in (modes.lines_x_m, modes.lines_y_m))
    points_m = np.stack(np.meshgrid(x_m, y_m, indexing="ij"), axis=-1).reshape(-1, 2)
    maps_Pa = list(results.plate.bending_stress_at_Pa(points_m).reshape(-1, x_m.size, y_m.size))
    return stress_maps((x_m, y_m), maps_Pa, results.ratios, results.theory.setup.places_m)


@figure("fig-21-contact", "Stress at a contact",
        "The same instant, 12 mm x 12 mm about a stone: bending plus the Hertz stress of each stone as one sphere of "
        "its radius; the sub-spheres of a bonded stone press on smaller spots.")
def contact_stress(results: SweepResults) -> Drawn:
    offset_m = np.linspace(-0.006, 0.006, 121)
    place = min(3, len(results.theory.setup.places_m))
    maps_Pa = results.plate.contact_stress_Pa(place, offset_m)
    pressure_Pa = results.mean_by_material(results.plate.contact_pressure_Pa)
    means = ", ".join(
        f"{name} {1e-6 * np.nanmean(p):.0f} MPa" for name, p in pressure_Pa.items() if np.isfinite(p).any()
    )
    figure = stress_maps((offset_m, offset_m), maps_Pa, results.ratios, np.zeros((1, 2)))
    return figure, f"Here place {place}. Largest Hertz pressure of one stone, mean over runs: {means}."


def stress_maps(lines_m: tuple[np.ndarray, np.ndarray], maps_Pa: list[np.ndarray], ratios: np.ndarray,
                points_m: np.ndarray) -> Figure:
    """The von Mises stress of the plate's surface for each ratio.

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


@figure("fig-21-ratio", "Stress against the ratio",
        "High: above 0.8 of the highest bending stress of any run. Hertz pressure: of each stone as a whole sphere, "
        "at its own largest force.", ratios=2)
def stress_against_ratio(results: SweepResults) -> Drawn:
    plate, note = results.plate, ""
    pressure_Pa = plate.contact_pressure_Pa
    panels = [
        ("Hertz pressure of one stone, MPa",
         {name: 1e-6 * p for name, p in results.mean_by_material(pressure_Pa).items()}),
        ("mean Hertz pressure, MPa", {"all": 1e-6 * pressure_Pa.mean(axis=1)})]
    try:
        panels += [
            ("bending stress below stones, MPa", {"mean": 1e-6 * plate.mean_stress_below_stones_Pa}),
            ("area of high bending stress, %", {"share": 100 * plate.high_stress_share}),
        ]
    except RecordError as reason:
        note = f"Bending not drawn: {reason}."
    return against_ratio(results.ratios, panels), note


RESPONSE_FIGURES = [motion_and_energy, single_force, total_force, maxima, bending_stress, contact_stress,
                    stress_against_ratio]
