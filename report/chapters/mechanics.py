"""Pictures of theory, breakage and response: Figures 7-21 of the paper."""

from __future__ import annotations

import numpy as np

from analysis import RecordError, breakage
from analysis.impact import DAMPING, force_history
from analysis.theory import contact_stiffness, materials_in_order, sphere_mass_kg
from report.chapters.picture import Plan
from report.figures import breakage as figures_breakage
from report.figures import style as figures
from report.figures import theory as figures_theory


def arrangement(study):
    s, plate = study.setup, study.runs[0].info["scene"]["plate"]
    rods = [(rod["x_m"], rod["y_m"]) for rod in plate["rods"]]
    size = (plate["length_m"], plate["width_m"])
    return figures_theory.arrangement(s.places_m, s.radius_m, s.gangue_order, size, rods)


def mixing_order(study):
    counts = study.theory_counts
    names = [materials_in_order(t, study.setup.gangue_order) for t in counts]
    return figures_theory.mixing_order(names, counts / counts[-1])


def peak_against_position(study):
    x = np.linspace(-0.49, 0.49, 99) * study.setup.support_length_m
    return figures_theory.peak_against_position(x, study.single_peaks_N(x))


def totals(study):
    panels, words = {"plate as the paper's beam": study.beam_totals_N}, ""
    try:
        panels["real plate (modes)"] = study.real_plate_totals_N
    except RecordError as reason:
        words = f"Real plate not drawn: {reason}."
    ratios = study.theory_counts / study.theory_counts[-1]
    return figures_theory.totals(ratios, panels, (study.ratios, study.peaks["force_N"])), words


def force_histories(study):
    s, histories = study.setup, {}
    for name, rock in s.rocks.items():
        stiffness, mass = contact_stiffness(rock, s.radius_m, s.plate), sphere_mass_kg(rock, s.radius_m)
        e = s.restitution[name]
        histories[f"{name}, e = {e:g}"] = {
            law: force_history(law, stiffness, mass, s.speed_m_s, e) for law in DAMPING
        }
    return figures_theory.force_histories(histories)


# ------------------------------------------------------------------- breakage


def _sections(study, index, until_s):
    network = study.networks[index]
    damaged = breakage.damage(network, breakage.broken_bonds(study.runs[index], network, until_s))
    return [breakage.section(network, damaged, k) for k in range(1, network.agglomerate.max() + 1)]


def stages(study):
    index = study.runs.index(study.nearest(0.5))
    run, ends = study.runs[index], study.first_collision_end_s[index]
    times = {"first\ncollision": ends, "20 ms": 0.02, "end": np.inf}
    rows = [(label, _sections(study, index, t), run.materials) for label, t in times.items()]
    words = f"Run of {run.gangue_ratio:.0%}; black frames: coal, brown: gangue."
    return figures_breakage.sections(rows, study.setup.radius_m), words


def sections(study):
    rows = [
        (f"{100 * ratio:.0f} %", _sections(study, i, study.first_collision_end_s[i]), study.runs[i].materials)
        for i, ratio in enumerate(study.ratios)
    ]
    return figures_breakage.sections(rows, study.setup.radius_m)


def broken_areas(study):
    first, end = study.area_first_m2, study.area_end_m2
    seen = np.array([
        sum(piece.broken_area_m2 for piece in _sections(study, i, study.first_collision_end_s[i]))
        for i in range(len(study.runs))
    ])  # fmt: skip
    volume = np.stack([
        breakage.damaged_volume_share(n, breakage.broken_bonds(run, n))
        for run, n in zip(study.runs, study.networks, strict=True)
    ])  # fmt: skip
    cm2 = {name: 1e4 * values for name, values in study.per_stone(first).items()}
    panels = [
        ("cracks of one, cm²", cm2),
        ("cracks of all, cm²",
         {"first collision": 1e4 * first.sum(axis=1), "end": 1e4 * end.sum(axis=1)}),
        ("broken in sections, cm²", {"first collision": 1e4 * seen}),
        ("damaged volume of one, %", {k: 100 * v for k, v in study.per_stone(volume).items()}),
    ]  # fmt: skip
    return figures.against_ratio(study.ratios, panels)


def area_over_time(study):
    index = study.runs.index(study.nearest(0.5))
    run = study.runs[index]
    last_s = run.breakage["t_s"].max() if len(run.breakage) else 0.0  # of the whole run, not of the paper's window
    t_s = np.linspace(0, max(run.t_s[-1], last_s), 300)
    return figures_breakage.area_over_time(
        t_s, breakage.broken_area_over_time(run, t_s), study.is_gangue[index]
    )


def fragments(study):
    index = study.runs.index(study.nearest(0.5))
    network = study.networks[index]
    shares = breakage.fragment_shares(network, breakage.broken_bonds(study.runs[index], network))
    gangue = study.is_gangue[index]
    sizes = {
        name: np.concatenate(
            [s for s, g in zip(shares, gangue, strict=True) if g == (name == "gangue")] or [np.empty(0)]
        )
        for name in ("coal", "gangue")
    }
    return figures_breakage.fragment_sizes(sizes), f"Run of {study.ratios[index]:.0%} at its end."


def cracks(study):
    found = [breakage.crack_counts(run) for run in study.runs]
    counts = {
        rock: {mode: np.array([f[rock][mode] for f in found]) for mode in ("tension", "shear")}
        for rock in ("coal", "gangue")
    }
    return figures_breakage.cracks(study.ratios, counts)


# ------------------------------------------------------------------- response


def motion_and_energy(study):
    stack = study.sweep.stack
    panels = [("a: displacement, µm", 1e6 * stack("u_m")), ("b: velocity, m/s", stack("v_m_s"))]
    panels.append(("c: acceleration, m/s²", stack("a_m_s2")))
    panels += [(f"{key}: {name} energy, J", stack(f"{name}_J"))
               for key, name in (("d", "kinetic"), ("e", "internal"), ("f", "total"))]  # fmt: skip
    return figures.curves(study.t_s, panels, study.ratios)


def _stream(run):
    """The fast stream, or the slow one of a run that kept no fast one."""
    return run.fast if run.fast is not None else run.signals


def single_force(study):
    """Force at place 3, coal and gangue, of the ratios nearest to each other."""
    lines = []
    looks = (("coal", figures.COAL), ("gangue", figures.GANGUE))
    for i, (name, colour) in zip(study.place_3(), looks, strict=True):
        table = _stream(study.runs[i])
        label = f"{name} ({study.ratios[i]:.0%} run)"
        lines.append((label, colour, table["t_s"].to_numpy(), 1e-3 * table["force_03_N"].to_numpy()))
    return figures.contact_forces(lines, "force at place 3, kN")


def total_force(study):
    lines = []
    for run, ratio in zip(study.runs, study.ratios, strict=True):
        table = _stream(run)
        colour = figures.ratio_colour(ratio)
        lines.append(("", colour, table["t_s"].to_numpy(), 1e-3 * table["force_N"].to_numpy()))
    return figures.contact_forces(lines, "total force, kN")


def maxima(study):
    two = study.two_way
    panels = [
        ("displacement, µm", {"up": 1e6 * two["u_m"][:, 0], "down": -1e6 * two["u_m"][:, 1]}),
        ("velocity, m/s", {"up": two["v_m_s"][:, 0], "down": -two["v_m_s"][:, 1]}),
        ("acceleration, m/s²", {"up": two["a_m_s2"][:, 0], "down": -two["a_m_s2"][:, 1]}),
        ("total contact force, kN", {"force": 1e-3 * study.peaks["force_N"]}),
        ("energy, J", {name: study.peaks[f"{name}_J"] for name in ("kinetic", "internal", "total")}),
    ]
    return figures.against_ratio(study.ratios, panels)


def stress(study):
    modes = study.plate_modes
    x_m, y_m = (np.linspace(lines[0], lines[-1], 101) for lines in (modes.lines_x_m, modes.lines_y_m))
    points_m = np.stack(np.meshgrid(x_m, y_m, indexing="ij"), axis=-1).reshape(-1, 2)
    maps = list(study.stress_at_Pa(points_m).reshape(-1, x_m.size, y_m.size))
    return figures_breakage.stress_maps((x_m, y_m), maps, study.ratios, study.setup.places_m)


def contact_stress(study):
    offset_m = np.linspace(-0.006, 0.006, 121)
    if len(study.setup.places_m) < 3:
        raise RecordError(f"{len(study.setup.places_m)} particles; the paper shows the third")
    maps = study.contact_stress_Pa(3, offset_m)
    largest = study.per_stone(study.contact_pressure_Pa)
    words = ", ".join(
        f"{name} {1e-6 * np.nanmean(p):.0f} MPa" for name, p in largest.items() if np.isfinite(p).any()
    )
    figure = figures_breakage.stress_maps((offset_m, offset_m), maps, study.ratios, np.zeros((1, 2)))
    return figure, f"Largest Hertz pressure of one, mean over runs: {words}."


def stress_against_ratio(study):
    pressure = {name: 1e-6 * p for name, p in study.per_stone(study.contact_pressure_Pa).items()}
    panels, words = [
        ("largest Hertz pressure of one, MPa", pressure),
        ("the same, mean of all, MPa", {"all": 1e-6 * study.contact_pressure_Pa.mean(axis=1)}),
    ], ""  # fmt: skip
    try:
        panels += [
            ("bending below the particles, MPa", {"mean": 1e-6 * study.stress_mean_Pa}),
            ("area of high bending stress, %", {"share": 100 * study.high_stress_share}),
        ]
    except RecordError as reason:
        words = f"Bending not drawn: {reason}."
    return figures.against_ratio(study.ratios, panels), words


THEORY = [
    Plan("fig-7", "Arrangement (Figure 7, 11)", "Ten particles at equal angles on a circle; two of them, A and B, on"
         " the axis along the length L.", "Particles with their number and the turn in which gangue replaces coal;"
         " grey: rods.", arrangement),
    Plan("fig-8", "Mixing order (Figure 8)", "Gangue replaces coal in ten steps.", "The order of the scene; the"
         " paper's own is read back from Table 2.", mixing_order),
    Plan("fig-9", "Largest force against position (Figure 9)", "Constant without deflection; with it smallest in the"
         " middle of the length, growing to the ends, and much less. Flores below Hertz, gangue above coal.",
         "Eqs. 8, 9, 19, 20, 26-30 with the scene's values, restitution included.", peak_against_position),
    Plan("fig-10", "Total force (Figure 10)", "All four states rise with the ratio; the two without deflection in"
         " straight lines, the others in uneven steps.", "Left with the paper's beam, right with the static"
         " compliance of the real plate on its rods; points: largest simulated force.", totals),
    Plan("fig-laws", "Force histories (Eqs. 5, 14)", "The paper integrates energies only.", "One particle on a rigid"
         " plate. The damped force peaks before the largest compression and above the force of Eq. 20.",
         force_histories),
]  # fmt: skip
BREAKAGE = [
    Plan("fig-13", "Breakage at stages of the impact (Figure 13)", "After the first collision coal is broken much more"
         " than gangue; gangue does not change after it, coal goes on breaking.", "Vertical sections of the ten"
         " agglomerates in their undeformed shape.", stages, pixels=True),
    Plan("fig-14", "Sections after the first collision (Figures 14, 15)", "The broken area of single particles does"
         " not change with the ratio.", "One row per ratio.", sections, pixels=True),
    Plan("fig-15", "Broken area against the ratio (Figure 15)", "Of one coal or gangue: constant. Of all ten: rising"
         " as the ratio falls.", "Crack area of broken bonds after the first collision; area of the sub-spheres in"
         " the sections that lost half of their bonds; damaged volume at the end.", broken_areas),
    Plan("fig-area-time", "Crack area over time", "Coal breaks on in later collisions.", "Each agglomerate of the run"
         " nearest to 50 %.", area_over_time),
    Plan("fig-cracks", "Cracks by mode", "Not in the paper.", "Bonds broken in tension and in shear.", cracks),
    Plan("fig-fragments", "Fragments", "Not in the paper, which shows the pieces only.", "What intact bonds still hold"
         " together.", fragments),
]  # fmt: skip
RESPONSE = [
    Plan("fig-16", "Response of the plate (Figure 16)", "Amplitudes of displacement, velocity and acceleration and all"
         " energies rise with the ratio.", "Centre of mass of the plate.", motion_and_energy),
    Plan("fig-17", "Force of one particle (Figure 17)", "At place 3 gangue pushes harder than coal and hits again"
         " later.", "Fast stream: first collision, and all after it.", single_force),
    Plan("fig-18", "Total contact force (Figure 18)", "Rises with the ratio; from the second collision on the particles"
         " do not hit together.", "Fast stream, each ratio one curve (dark: coal): first collision, and all after it.", total_force),
    Plan("fig-19", "Maxima against the ratio (Figure 19)", "All rise, in both directions.", "Largest values of"
         " the run, fast stream.", maxima),
    Plan("fig-21", "Stress of the plate (Figures 20, 21)", "The stress rises above 20 %; a region of high stress crosses"
         " the contact area above 70 %.", "Von Mises stress of bending at the top surface at the instant of the largest"
         " total force, without the contacts' own. Crosses: places of the particles.", stress, pixels=True),
    Plan("fig-21-contact", "Stress at a contact (Figures 20, 21)", "The stresses are taken where the particles touch.",
         "The same instant, 12 mm x 12 mm about place 3 (coal until gangue takes it): bending plus the Hertz"
         " stress of each particle as one sphere of its radius; the sub-spheres of a bonded one press on smaller spots.",
         contact_stress, pixels=True),
    Plan("fig-21-ratio", "Stress against the ratio (Figure 21)", "Rises above 20 %; high stress from 70 %.", "High: above"
         " 0.8 of the highest bending stress of any run. Hertz pressure: of each particle as a whole sphere, at its"
         " own largest force.", stress_against_ratio),
]  # fmt: skip
