"""The chapter of the plate's response (Figures 16 to 21): numbers, pictures, captions and statements."""

from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from analysis import RecordError, Run
from analysis.sweep import breakage
from analysis.theory.real_plate import (
    amplitude_at_peak,
    contact_stress_map_Pa,
    hertz_contacts,
    modes_of,
    nodal_at,
    particle_forces_N,
)
from plate_fem.modes import PlateModes
from plate_fem.stress import surface_stress, von_mises
from report.drawing.figure_spec import Drawn, figure
from report.drawing.lines import against_ratio, curves, envelope
from report.drawing.style import ACCENT, STRESS_COLOURS, bar_axes, canvas, hide_scales, material_colour, ratio_colours
from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.verdicts import (
    HELD,
    NOT_HELD,
    PARTLY,
    Finding,
    Statement,
    all_rise,
    falling_steps,
    graded,
    held_if,
    spearman,
    trend,
)

HIGH_STRESS_SHARE = 0.8  # of the highest bending stress in any run, above which stress counts as high
POINT_DISTANCE_M = 0.0025  # of the points below the stones at which the bending stress is taken
FIRST_COLLISION_S = 1e-3
LATER_POINTS = 3000  # of a curve after the first collision, whose extremes all remain
MOTIONS = (("displacement, µm", "u_m", 1e6), ("velocity, m/s", "v_m_s", 1.0), ("acceleration, m/s²", "a_m_s2", 1.0))
ENERGIES = ("kinetic", "internal", "total")
#: Name, with "_" before it for none in the legend, colour, t_s, and force in kN.
ForceLine = tuple[str, Any, np.ndarray, np.ndarray]


class Stress:
    """Stress of the plate in each run, at the instant of the largest total force unless said otherwise.

    Raises RecordError for a rigid plate, which has no modes, and for runs that kept no fast stream.
    """

    def __init__(self, results: SweepResults):
        self._results, self._runs = results, results.runs

    @cached_property
    def modes(self) -> list[PlateModes]:
        """Modes of each run's plate, whose number may follow from the duration of the contact."""
        plates = [repr((run.scene.plate, run.summary.n_modes)) for run in self._runs]
        found = {plate: modes_of(self._runs[plates.index(plate)]) for plate in dict.fromkeys(plates)}
        return [found[plate] for plate in plates]

    @cached_property
    def amplitudes(self) -> list[np.ndarray]:
        """Modal amplitudes of each run, shape (modes,) each."""
        return [amplitude_at_peak(modes, run) for modes, run in zip(self.modes, self._runs, strict=True)]

    @cached_property
    def _nodal_stress_Pa(self) -> list[np.ndarray]:
        """Von Mises stress of bending at the top surface, at the nodes of each run's modes."""
        pairs = zip(self.modes, self.amplitudes, strict=True)
        return [von_mises(surface_stress(modes, amplitude)) for modes, amplitude in pairs]

    def bending_stress_at_Pa(self, points_m: np.ndarray) -> np.ndarray:
        """Von Mises stress of bending at points (k, 2) of the top surface, shape (runs, k). Shares of an area are
        counted over such points, not over nodes, so that they do not depend on the mesh."""
        pairs = zip(self.modes, self._nodal_stress_Pa, strict=True)
        return np.stack([nodal_at(modes, field, points_m) for modes, field in pairs])

    def contact_stress_Pa(self, number: int, offset_m: np.ndarray) -> list[np.ndarray]:
        """Von Mises stress (k, k) of each run about the place of a stone, by its number from 1, Hertz' field of each
        contact included, at offset_m (k,) along x and along y."""
        maps, poisson_ratio = [], self._results.setup.plate.poisson_ratio
        for run, modes, amplitude in zip(self._runs, self.modes, self.amplitudes, strict=True):
            force_N = particle_forces_N(run)[1]
            contacts = hertz_contacts(run, force_N[np.argmax(force_N.sum(axis=1))])
            maps.append(contact_stress_map_Pa(modes, amplitude, contacts, number, poisson_ratio, offset_m))
        return maps

    @cached_property
    def contact_pressure_Pa(self) -> np.ndarray:
        """Largest Hertz pressure of the run under each stone, taken as one whole sphere, shape (runs, stones)."""
        rows = [hertz_contacts(run, particle_forces_N(run)[1].max(axis=0)) for run in self._runs]
        return np.array([[contact.peak_pressure_Pa for contact in row] for row in rows])

    @cached_property
    def _stress_below_stones_Pa(self) -> np.ndarray:
        """Bending stress at points on discs of the stones' radius about their places, shape (runs, points)."""
        s = self._results.setup
        offsets = np.arange(-s.radius_m, s.radius_m + POINT_DISTANCE_M / 2, POINT_DISTANCE_M)
        disc = np.array([(x, y) for x in offsets for y in offsets if np.hypot(x, y) <= s.radius_m])
        return self.bending_stress_at_Pa((s.places_m[:, None] + disc).reshape(-1, 2))

    @property
    def mean_stress_below_stones_Pa(self) -> np.ndarray:
        """Mean bending stress below the stones, shape (runs,)."""
        return self._stress_below_stones_Pa.mean(axis=1)

    @property
    def high_stress_share(self) -> np.ndarray:
        """Share of the area below the stones with a high bending stress, shape (runs,), 0..1."""
        stress_Pa = self._stress_below_stones_Pa
        return (stress_Pa > HIGH_STRESS_SHARE * stress_Pa.max()).mean(axis=1)


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
        axis.set(title=title, xlabel="time, ms")
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
    stress = results.of(Stress)
    modes = stress.modes[0]
    x_m, y_m = (np.linspace(lines[0], lines[-1], 101) for lines in (modes.lines_x_m, modes.lines_y_m))
    points_m = np.stack(np.meshgrid(x_m, y_m, indexing="ij"), axis=-1).reshape(-1, 2)
    maps_Pa = list(stress.bending_stress_at_Pa(points_m).reshape(-1, x_m.size, y_m.size))
    return stress_maps((x_m, y_m), maps_Pa, results.ratios, results.setup.places_m)


@figure("fig-21-contact", "Stress at a contact",
        "The same instant, 12 mm x 12 mm about a stone: bending plus the Hertz stress of each stone as one sphere of "
        "its radius; the sub-spheres of a bonded stone press on smaller spots.")
def contact_stress(results: SweepResults) -> Drawn:
    offset_m = np.linspace(-0.006, 0.006, 121)
    stress, place = results.of(Stress), min(3, len(results.setup.places_m))
    maps_Pa = stress.contact_stress_Pa(place, offset_m)
    pressure_MPa = results.mean_by_material(1e-6 * stress.contact_pressure_Pa)
    means = ", ".join(f"{kind} {np.nanmean(pressure_MPa[kind]):.0f} MPa" for kind in results.kinds)
    figure = stress_maps((offset_m, offset_m), maps_Pa, results.ratios, np.zeros((1, 2)))
    return figure, f"Here place {place}. Largest Hertz pressure of one stone, mean over runs: {means}."


def stress_maps(lines_m: tuple[np.ndarray, np.ndarray], maps_Pa: list[np.ndarray], ratios: np.ndarray,
                points_m: np.ndarray) -> Figure:
    """The von Mises stress of the plate's surface for each ratio. lines_m: x (nx,) and y (ny,). maps_Pa: (nx, ny) each.
    points_m: crosses to draw (k, 2)."""
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
        axis.set(xlim=x_m[[0, -1]], ylim=y_m[[0, -1]], title=f"{100 * ratio:.0f} %")
        axis.plot(*points_m.T, "w+", markersize=3)
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
    stress, note = results.of(Stress), ""
    pressure_MPa = 1e-6 * stress.contact_pressure_Pa
    panels = [("Hertz pressure of one stone, MPa", results.mean_by_material(pressure_MPa)),
              ("mean Hertz pressure, MPa", {"all": pressure_MPa.mean(axis=1)})]
    try:
        panels += [("bending stress below stones, MPa", {"mean": 1e-6 * stress.mean_stress_below_stones_Pa}),
                   ("area of high bending stress, %", {"share": 100 * stress.high_stress_share})]
    except RecordError as reason:
        note = f"Bending not drawn: {reason}."
    return against_ratio(results.ratios, panels), note


RESPONSE_FIGURES = [motion_and_energy, single_force, total_force, maxima, bending_stress, contact_stress,
                    stress_against_ratio]


def gangue_pushes_harder_at_3(results: SweepResults) -> Finding:
    coal_N, gangue_N = (results.runs[i].peak("force_03_N") for i in results.indices_coal_gangue_at_3())
    return graded(gangue_N / coal_N, 1.1, 1.0), f"gangue {gangue_N:.0f} N, coal {coal_N:.0f} N at place 3"


def gangue_comes_back_later(results: SweepResults) -> Finding:
    times_s = []
    for i, name in zip(results.indices_coal_gangue_at_3(), ("coal", "gangue"), strict=True):
        found = breakage.collisions(results.runs[i], 3)
        if len(found) < 2:
            raise MissingResult(f"{name} at place 3 touches the plate once only")
        times_s.append(found[1][0])
    coal_s, gangue_s = times_s
    value = f"second collision: coal at {1e3 * coal_s:.2f} ms, gangue at {1e3 * gangue_s:.2f} ms"
    return held_if(gangue_s > coal_s), value


def second_collisions_spread(results: SweepResults) -> Finding:
    run = results.runs[results.index_nearest(0.5)]
    found = [breakage.collisions(run, k) for k in range(1, len(run.materials) + 1)]
    second_s = [collisions[1][0] for collisions in found if len(collisions) > 1]
    if len(second_s) < 2:
        raise MissingResult(f"{len(second_s)} agglomerates touch the plate a second time")
    first_s = np.ptp([collisions[0][0] for collisions in found if collisions])
    spread_s = np.ptp(second_s)
    value = f"first within {1e6 * first_s:.0f} µs, second within {1e3 * spread_s:.2f} ms"
    return held_if(spread_s > max(10 * first_s, 1e-3)), f"{value} ({len(second_s)} of {len(found)})"


def maxima_both_ways(results: SweepResults) -> dict[str, np.ndarray]:
    return {f"{name[0]}{side}": values for name in ("u_m", "v_m_s", "a_m_s2")
            for side, values in zip("+-", results.extremes(name).T * [[1], [-1]], strict=True)}


def high_stress_appears(results: SweepResults) -> Finding:
    share, ratios = results.of(Stress).high_stress_share, results.ratios
    there = ratios[share > 0]
    first = f"first at {100 * there[0]:.0f} %" if there.size else "nowhere"
    rho, grows = spearman(ratios, share), there.size and there[0] >= 0.6 and not falling_steps(ratios, share)
    verdict = NOT_HELD if rho < 0.5 else HELD if grows else PARTLY
    return verdict, f"{first}, Spearman of its area {rho:.3f}"


RISES = "Spearman >= 0.9"

RESPONSE_STATEMENTS = [
    Statement("Displacement, velocity and acceleration of the plate rise in both directions", "Fig. 16 a-c, 19",
              "fig-19", "Spearman >= 0.9 for each", all_rise(maxima_both_ways)),
    Statement("Kinetic, internal and total energy of the plate rise with the ratio", "Fig. 16 d-f", "fig-16",
              "Spearman >= 0.9 for each",
              all_rise(lambda of: {name: of.sweep.peaks(f"{name}_J") for name in ENERGIES})),
    Statement("A gangue at place 3 pushes harder than a coal", "Fig. 17", "fig-17", "1.1 or more; partly above 1",
              gangue_pushes_harder_at_3),
    Statement("Gangue hits the plate again later than coal does", "Fig. 17", "fig-17", "gangue later",
              gangue_comes_back_later),
    Statement("From the second collision on the particles do not hit at the same time", "Fig. 18", "fig-18",
              "spread above 1 ms and ten times the first's", second_collisions_spread),
    Statement("The largest total contact force rises with the ratio", "Fig. 18, 19", "fig-19", RISES,
              trend(lambda results: results.sweep.peaks("force_N"), 1, 1e-3, "kN")),
    Statement("The overall stress under the particles rises with the ratio", "Fig. 21", "fig-21", RISES,
              trend(lambda results: results.of(Stress).mean_stress_below_stones_Pa, 1, 1e-6, "MPa")),
    Statement("The stress at the contact points rises with the ratio", "Fig. 21", "fig-21-ratio", RISES,
              trend(lambda results: results.of(Stress).contact_pressure_Pa.mean(axis=1), 1, 1e-6,
                    "MPa, largest Hertz pressure")),
    Statement("A region of high stress appears above 70 % and grows with the ratio", "Fig. 21", "fig-21",
              "first at 60-80 %, growing; high: above 0.8 of the highest", high_stress_appears),
]  # fmt: skip
