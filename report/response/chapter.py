"""The chapter of the plate's response: Figures 16 to 21 of the paper."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis import RecordError, Run
from report.drawing.figure_spec import Drawn, FigureSpec
from report.drawing.lines import against_ratio, curves, envelope
from report.drawing.style import COAL, GANGUE, ratio_colours
from report.missing import MissingResult
from report.response import figures
from report.sweep_results import SweepResults

FIRST_COLLISION_S = 1e-3
LATER_POINTS = 3000  # of a curve after the first collision, whose extremes all remain


def motion_and_energy(results: SweepResults) -> Drawn:
    stack = results.sweep.stack
    panels = [
        ("a: displacement, µm", 1e6 * stack("u_m")),
        ("b: velocity, m/s", stack("v_m_s")),
        ("c: acceleration, m/s²", stack("a_m_s2")),
        ("d: kinetic energy, J", stack("kinetic_J")),
        ("e: internal energy, J", stack("internal_J")),
        ("f: total energy, J", stack("total_J")),
    ]
    return curves(results.t_s, panels, results.ratios)


def _finest_stream(run: Run) -> pd.DataFrame:
    """Return the fast stream, or the regular one of a run that kept no fast one."""
    return run.fast if run.fast is not None else run.signals


def _first_ms_and_envelope(run: Run, column: str) -> tuple[np.ndarray, np.ndarray]:
    """Return times and forces in kN: all of the first collision, and of what follows as much as can be seen."""
    table = _finest_stream(run)
    if column not in table:
        raise MissingResult(f"{run.path.name}: no {column}: the force of each stone is not kept where there are many")
    t_s, force_kN = table["t_s"].to_numpy(), 1e-3 * table[column].to_numpy()
    first = int(np.searchsorted(t_s, FIRST_COLLISION_S, side="right"))
    later = envelope(t_s[first:], force_kN[first:], LATER_POINTS)
    return np.concatenate([t_s[:first], later[0]]), np.concatenate([force_kN[:first], later[1]])


def single_force(results: SweepResults) -> Drawn:
    lines: list[figures.ForceLine] = []
    colours = (("coal", COAL), ("gangue", GANGUE))
    for i, (name, colour) in zip(results.indices_coal_gangue_at_3(), colours, strict=True):
        label = f"{name} ({results.ratios[i]:.0%} run)"
        lines.append((label, colour, *_first_ms_and_envelope(results.runs[i], "force_03_N")))
    return figures.contact_forces(lines, "force at place 3, kN")


def total_force(results: SweepResults) -> Drawn:
    lines: list[figures.ForceLine] = []
    for run, colour in zip(results.runs, ratio_colours(results.ratios), strict=True):
        label = f"_{100 * run.gangue_ratio:.0f} %"  # named in the figure's data, not in its legend
        lines.append((label, colour, *_first_ms_and_envelope(run, "force_N")))
    return figures.contact_forces(lines, "total force, kN")


def maxima(results: SweepResults) -> Drawn:
    force = ("total contact force, kN", {"force": 1e-3 * results.sweep.peaks("force_N")})
    if not results.plate_moves:
        return against_ratio(results.ratios, [force])
    extremes, peaks = results.response.extremes, results.response.peaks
    motions = (("displacement, µm", "u_m", 1e6), ("velocity, m/s", "v_m_s", 1), ("acceleration, m/s²", "a_m_s2", 1))
    panels = [
        (label, {"up": unit * extremes[name][:, 0], "down": -unit * extremes[name][:, 1]})
        for label, name, unit in motions
    ]
    energies = ("energy, J", {name: peaks[f"{name}_J"] for name in ("kinetic", "internal", "total")})
    panels = [force, *panels, energies, ("RMS of the acceleration, m/s²", {"rms": results.rms_m_s2})]
    return against_ratio(results.ratios, panels)


def bending_stress(results: SweepResults) -> Drawn:
    modes = results.plate.modes[0]
    x_m, y_m = (np.linspace(lines[0], lines[-1], 101) for lines in (modes.lines_x_m, modes.lines_y_m))
    points_m = np.stack(np.meshgrid(x_m, y_m, indexing="ij"), axis=-1).reshape(-1, 2)
    maps_Pa = list(results.plate.bending_stress_at_Pa(points_m).reshape(-1, x_m.size, y_m.size))
    return figures.stress_maps((x_m, y_m), maps_Pa, results.ratios, results.theory.setup.places_m)


def contact_stress(results: SweepResults) -> Drawn:
    offset_m = np.linspace(-0.006, 0.006, 121)
    place = min(3, len(results.theory.setup.places_m))
    maps_Pa = results.plate.contact_stress_Pa(place, offset_m)
    pressure_Pa = results.mean_by_material(results.plate.contact_pressure_Pa)
    means = ", ".join(
        f"{name} {1e-6 * np.nanmean(p):.0f} MPa" for name, p in pressure_Pa.items() if np.isfinite(p).any()
    )
    figure = figures.stress_maps((offset_m, offset_m), maps_Pa, results.ratios, np.zeros((1, 2)))
    return figure, f"Here place {place}. Largest Hertz pressure of one stone, mean over runs: {means}."


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


def felt(results: SweepResults) -> Drawn:
    run = results.runs[0]
    table, panels = _finest_stream(run), []
    for label, column, unit in (("force on the plate, kN", "force_N", 1e-3),
                                ("acceleration of the plate's centre of mass, m/s²", "a_m_s2", 1.0)):
        if column in table:
            t_s, values = envelope(table["t_s"].to_numpy(), table[column].to_numpy(), LATER_POINTS)
            panels.append((label, t_s, unit * values))
    return figures.felt(panels)


FELT = FigureSpec("fig-felt", "What the plate felt", "The whole run.",
                  felt)
MAXIMA = FigureSpec("fig-19", "Maxima against the ratio", "Largest values of each run.", maxima, ratios=2)

RESPONSE_FIGURES = [
    FigureSpec("fig-16", "Response of the plate", "Centre of mass of the plate.", motion_and_energy),
    FigureSpec("fig-17", "Force of one stone", "", single_force, ratios=2),
    FigureSpec("fig-18", "Total contact force", "", total_force),
    MAXIMA,
    FigureSpec("fig-21", "Stress of the plate",
               "Von Mises stress of bending at the top surface at the instant of the largest total force, without "
               "the contacts' own. Crosses: places of the stones.",
               bending_stress),
    FigureSpec("fig-21-contact", "Stress at a contact",
               "The same instant, 12 mm x 12 mm about a stone: bending plus the Hertz "
               "stress of each stone as one sphere of its radius; the sub-spheres of a bonded stone press on "
               "smaller spots.",
               contact_stress),
    FigureSpec("fig-21-ratio", "Stress against the ratio",
               "High: above 0.8 of the highest bending stress of any run. Hertz pressure: of each stone as a whole "
               "sphere, at its own largest force.",
               stress_against_ratio, ratios=2),
]
