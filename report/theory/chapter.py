"""The chapter of the theory: Figures 7 to 11 of the paper."""

from __future__ import annotations

import numpy as np

from analysis import RecordError
from analysis.theory.contact_states import contact_stiffness, materials_in_order, sphere_mass_kg
from analysis.theory.impact import DAMPING, force_history
from report.drawing.figure_spec import Drawn, FigureSpec
from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.theory import figures


def arrangement(results: SweepResults) -> Drawn:
    s, plate = results.theory.setup, results.runs[0].scene.plate
    if plate.rods is None or plate.length_m is None or plate.width_m is None:
        raise MissingResult("the scene in run.json has no plate with its rods and size")
    rods_m = [(rod.x_m, rod.y_m) for rod in plate.rods]
    size_m = (plate.length_m, plate.width_m)
    return figures.arrangement(s.places_m, s.radius_m, s.gangue_order, size_m, rods_m)


def mixing_order(results: SweepResults) -> Drawn:
    counts = results.theory.gangue_counts
    materials = [materials_in_order(count, results.theory.setup.gangue_order) for count in counts]
    return figures.mixing_order(materials, counts / counts[-1])


def peak_against_position(results: SweepResults) -> Drawn:
    x_m = np.linspace(-0.49, 0.49, 99) * results.theory.setup.support_length_m
    peaks_N = results.theory.single_peaks_N(x_m)
    return figures.peak_against_position(x_m, {kind: peaks_N[kind] for kind in results.kinds})


def totals(results: SweepResults) -> Drawn:
    panels, note = {"plate as a beam": results.theory.beam_totals_N}, ""
    try:
        panels["real plate (modes)"] = results.theory.real_plate_totals_N
    except RecordError as reason:
        note = f"Real plate not drawn: {reason}."
    counts = results.theory.gangue_counts
    simulated = (results.ratios, results.response.peaks["force_N"])
    return figures.totals(counts / counts[-1], panels, simulated), note


def force_histories(results: SweepResults) -> Drawn:
    s, histories = results.theory.setup, {}
    for name in results.kinds:
        rock = s.rocks[name]
        stiffness, mass_kg = contact_stiffness(rock, s.radius_m, s.plate), sphere_mass_kg(rock, s.radius_m)
        e = s.restitution[name]
        by_law = {law: force_history(law, stiffness, mass_kg, s.speed_m_s, e) for law in DAMPING}
        histories[f"{name}, e = {e:g}"] = {law: (h.t_s, h.force_N) for law, h in by_law.items()}
    return figures.force_histories(histories)


THEORY_FIGURES = [
    FigureSpec("fig-7", "Arrangement",
               "Stones with their number and, given room, when gangue replaces coal; grey: rods.", arrangement),
    FigureSpec("fig-8", "Mixing order", "The order of the scene.", mixing_order, ratios=2),
    FigureSpec("fig-9", "Largest force against position",
               "Eqs. 8, 9, 19, 20, 26-30 with the scene's values, restitution included.", peak_against_position),
    FigureSpec("fig-10", "Total force",
               "With the beam formula, and with the static compliance of the real plate on its rods; points: "
               "largest simulated force.",
               totals, ratios=2),
    FigureSpec("fig-laws", "Force histories",
               "One stone on a rigid plate. The damped force peaks before the largest compression and above the "
               "force of Eq. 20.",
               force_histories),
]
