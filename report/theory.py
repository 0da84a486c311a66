"""The chapter of theory (Figures 7 to 11): numbers, pictures, captions and statements."""

from functools import cached_property

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle

from analysis import RecordError
from analysis.theory.contact_states import (
    STATES,
    State,
    beam_compliance,
    contact_stiffness,
    materials_in_order,
    peak_force_N,
    sphere_mass_kg,
)
from analysis.theory.impact import DAMPING, force_history
from analysis.theory.real_plate import static_compliance_m_N
from report.drawing.figure_spec import Drawn, figure
from report.drawing.style import ACCENT, COAL, GANGUE, PALE, RATIO_LABEL, canvas, legend_above, material_colour, single
from report.missing import MissingResult
from report.response import Stress
from report.sweep_results import SweepResults
from report.verdicts import Finding, Statement, graded, held_if, listed

#: Label, line and colour of each contact state.
LOOKS = {"PH": ("Hertz, rigid", "-", COAL), "HN": ("Hertz, deflection", "--", PALE),
         "PF": ("Flores, rigid", "-.", ACCENT), "FN": ("Flores, deflection", ":", GANGUE)}
RIGID, DEFLECTING = ("PH", "PF"), ("HN", "FN")
MIDDLE = 20  # of the 41 places of a statement


class Theory:
    """Peak forces by theory, with the values of the sweep's first scene."""

    def __init__(self, results: SweepResults):
        self._results, self.setup = results, results.setup

    def beam_compliance_m_N(self, x_m: np.ndarray) -> np.ndarray:
        """Return the compliance of the paper's beam at distances from the plate's centre along the axis A-B."""
        s = self.setup
        return beam_compliance(np.asarray(x_m) + s.support_length_m / 2, s.support_length_m, s.support_width_m,
                               s.thickness_m, s.plate)

    def single_peaks_N(self, x_m: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
        """Return the peak force of one sphere at each x_m (Figure 9): {material: {state: shape of x_m}}."""
        compliance = self.beam_compliance_m_N(x_m)
        return {kind: {key: np.array([self._peak_N(state, kind, one) for one in compliance])
                       for key, state in STATES.items()} for kind in self.setup.rocks}

    def _peak_N(self, state: State, kind: str, compliance_m_N: float) -> float:
        s = self.setup
        return peak_force_N(state, s.rocks[kind], radius_m=s.radius_m, speed_m_s=s.speed_m_s, plate=s.plate,
                            restitution=s.restitution[kind], compliance_m_N=compliance_m_N)

    @cached_property
    def gangue_counts(self) -> np.ndarray:
        """Numbers of gangue spheres, from none to all, shape (stones + 1,)."""
        return np.arange(len(self.setup.places_m) + 1)

    def _totals_N(self, compliance_m_N: np.ndarray) -> dict[str, np.ndarray]:
        """Total force (37) in each state (Figure 10) for each of `gangue_counts`, in the scene's order, with the
        compliance of the plate at each place, (stones,): the sum of the single peaks, which are microseconds apart."""

        def total_N(state: State, gangue_count: int) -> float:
            kinds = materials_in_order(gangue_count, self.setup.gangue_order)
            return sum(self._peak_N(state, kind, float(c)) for kind, c in zip(kinds, compliance_m_N, strict=True))

        return {key: np.array([total_N(state, count) for count in self.gangue_counts]) for key, state in STATES.items()}

    @cached_property
    def beam_totals_N(self) -> dict[str, np.ndarray]:
        """Total force in each state on the paper's beam, shape (stones + 1,) each."""
        return self._totals_N(self.beam_compliance_m_N(self.setup.places_m[:, 0]))

    @cached_property
    def real_plate_totals_N(self) -> dict[str, np.ndarray]:
        """The same with the static compliance of the real plate. Raises RecordError if the plate is rigid or free."""
        return self._totals_N(static_compliance_m_N(self._results.of(Stress).modes[0], self.setup.places_m))


@figure("fig-7", "Arrangement", "Stones with their number and, given room, when gangue replaces coal; grey: rods.")
def arrangement(results: SweepResults) -> Drawn:
    s, plate = results.setup, results.runs[0].scene.plate
    if plate.rods is None or plate.size_m is None:
        raise MissingResult("the scene in run.json has no plate with its rods and size")
    size_m = plate.size_m
    figure, axis = single(4.2)
    axis.add_patch(Rectangle((-size_m[0] / 2, -size_m[1] / 2), *size_m, facecolor="#eef1f3", edgecolor=PALE))
    for rod in plate.rods:
        axis.add_patch(Circle((rod.place_m[0], rod.place_m[1]), 0.01, facecolor=PALE))
    rank = {place: k for k, place in enumerate(s.gangue_order, 1)}
    roomy = 2 * s.radius_m > 0.08 * max(size_m)  # of two lines of text
    for number, (x, y) in enumerate(s.places_m, 1):
        axis.add_patch(Circle((x, y), s.radius_m, facecolor="#d9b58f", edgecolor=GANGUE))
        label = f"#{number}\n{rank[number]}." if roomy else str(number)
        axis.text(x, y, label, ha="center", va="center", color="#221a10")  # on dark too
    axis.set(xlim=(-0.52 * size_m[0], 0.52 * size_m[0]), ylim=(-0.52 * size_m[1], 0.52 * size_m[1]), aspect="equal",
             xlabel="x, m (axis A-B, length L)", ylabel="y, m")
    axis.grid(False)
    return figure


@figure("fig-8", "Mixing order", "The order of the scene.", ratios=2)
def mixing_order(results: SweepResults) -> Drawn:
    counts, order = results.of(Theory).gangue_counts, results.setup.gangue_order
    figure, axis = single(2.8)
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
        label, line, colour = LOOKS[key]
        axis.plot(x, 1e-3 * force_N, line, color=colour, label=label)


@figure("fig-9", "Largest force against position",
        "Eqs. 8, 9, 19, 20, 26-30 with the scene's values, restitution included.")
def peak_against_position(results: SweepResults) -> Drawn:
    x_m = np.linspace(-0.49, 0.49, 99) * results.setup.support_length_m
    peaks_N = results.of(Theory).single_peaks_N(x_m)
    figure, axes = canvas(1, len(results.kinds), height_in=2.7, sharey=True)
    for axis, kind in zip(axes[0], results.kinds, strict=True):
        _plot_states(axis, x_m, peaks_N[kind])
        axis.set(title=kind, xlabel="x from the centre, m")
    axes[0, 0].set_ylabel("largest force, kN")
    legend_above(axes[0, 0])
    return figure


@figure("fig-10", "Total force",
        "With the beam formula, and with the static compliance of the real plate on its rods; points: largest "
        "simulated force.", ratios=2)
def totals(results: SweepResults) -> Drawn:
    theory, note = results.of(Theory), ""
    panels, counts = {"plate as a beam": theory.beam_totals_N}, theory.gangue_counts
    try:
        panels["real plate (modes)"] = theory.real_plate_totals_N
    except RecordError as reason:
        note = f"Real plate not drawn: {reason}."
    figure, axes = canvas(1, len(panels), height_in=3.0, sharey=True)
    for axis, (title, states) in zip(axes[0], panels.items(), strict=True):
        _plot_states(axis, 100 * (counts / counts[-1]), states)
        axis.plot(100 * results.ratios, 1e-3 * results.sweep.peaks("force_N"), "o", color="black", markersize=3,
                  label="simulated")
        axis.set(title=title, xlabel=RATIO_LABEL)
    axes[0, 0].set_ylabel("total force, kN")
    axes[0, 0].set_ylim(bottom=0)
    legend_above(axes[0, 0])
    return figure, note


@figure("fig-laws", "Force histories",
        "One stone on a rigid plate. The damped force peaks before the largest compression and above the force of "
        "Eq. 20.")
def force_histories(results: SweepResults) -> Drawn:
    s = results.setup
    figure, axes = canvas(1, len(results.kinds), height_in=2.6, sharey=True)
    for axis, name in zip(axes[0], results.kinds, strict=True):
        rock, e = s.rocks[name], s.restitution[name]
        stiffness, mass_kg = contact_stiffness(rock, s.radius_m, s.plate), sphere_mass_kg(rock, s.radius_m)
        looks = zip((PALE, GANGUE, ACCENT, COAL), ("-", "-", "--", ":"), (3.2, 2.4, 1.5, 1.5), strict=True)
        for (colour, line, width), law in zip(looks, DAMPING, strict=False):  # some lie together
            found = force_history(law, stiffness, mass_kg, s.speed_m_s, e)
            axis.plot(1e6 * found.t_s, 1e-3 * found.force_N, line, color=colour, linewidth=width,
                      label=law.replace("_", "-").title())
        axis.set(title=f"{name}, e = {e:g}", xlabel="time, µs")
    axes[0, 0].set_ylabel("force, kN")
    legend_above(axes[0, 0])
    return figure


THEORY_FIGURES = [arrangement, mixing_order, peak_against_position, totals, force_histories]


def _along(results: SweepResults) -> dict[str, dict[str, np.ndarray]]:
    """Return peak forces in N at 41 places between the supports: {material: {state: shape (41,)}}."""
    half_m = 0.48 * results.setup.support_length_m
    return results.of(Theory).single_peaks_N(np.linspace(-half_m, half_m, 2 * MIDDLE + 1))


def position_does_not_matter(results: SweepResults) -> Finding:
    spread = max(np.ptp(f[key]) / f[key].mean() for f in _along(results).values() for key in RIGID)
    return held_if(spread < 1e-9), f"spread {spread:.1e} of the mean"


def weakest_in_the_middle(results: SweepResults) -> Finding:
    forces = [f[key] for f in _along(results).values() for key in DEFLECTING]
    least_in_middle = all(np.argmin(f) == MIDDLE and np.all(np.diff(f[MIDDLE:]) > 0)
                          and np.all(np.diff(f[:MIDDLE + 1]) < 0) for f in forces)
    depth = max(1 - f.min() / f.max() for f in forces)
    return held_if(least_in_middle), f"up to {100 * depth:.1f} % lower in the middle"


def damping_lowers(results: SweepResults) -> Finding:
    pairs = [(f["PF"] / f["PH"], f["FN"] / f["HN"]) for f in _along(results).values()]
    worst = max(np.max(ratio) for pair in pairs for ratio in pair)
    return held_if(worst < 1), f"Flores over Hertz at most {worst:.3f}"


def deflection_lowers_much(results: SweepResults) -> Finding:
    forces = _along(results).values()
    pairs = list(zip(DEFLECTING, RIGID, strict=True))
    ratio = max(f[deflecting][MIDDLE] / f[rigid][MIDDLE] for f in forces for deflecting, rigid in pairs)
    return graded(ratio, 0.7, 0.95), f"in the middle of the plate up to {ratio:.3f} of the rigid state's force"


def gangue_is_harder(results: SweepResults) -> Finding:
    forces = _along(results)
    least = min(np.min(forces["gangue"][key] / forces["coal"][key]) for key in STATES)
    return held_if(least > 1), f"gangue over coal at least {least:.3f}"


def totals_rise(results: SweepResults) -> Finding:
    least_N = min(np.min(np.diff(total)) for total in results.of(Theory).beam_totals_N.values())
    return held_if(least_N > 0), f"smallest step {1e-3 * least_N:.2f} kN"


def _unevenness(total_N: np.ndarray) -> float:
    """Return the spread of the steps from count to count over their mean."""
    return np.ptp(np.diff(total_N)) / np.diff(total_N).mean()


def rigid_totals_are_straight(results: SweepResults) -> Finding:
    worst = max(_unevenness(results.of(Theory).beam_totals_N[key]) for key in RIGID)
    return held_if(worst < 1e-9), f"steps differ by {worst:.1e}"


def deflecting_totals_fluctuate(results: SweepResults) -> Finding:
    spread = [_unevenness(results.of(Theory).beam_totals_N[key]) for key in DEFLECTING]
    value = f"steps differ by {100 * min(spread):.1f} to {100 * max(spread):.1f} %"
    return graded(min(spread), 0.05, 0.005), value


def _theory_over_simulation(results: SweepResults) -> dict[str, float]:
    """Return the total force by theory over the simulated one, mean over the ratios, of each state."""
    theory, force_N = results.of(Theory), results.sweep.peaks("force_N")
    counts = np.rint(results.ratios * theory.gangue_counts[-1]).astype(int)
    return {key: float(np.mean(total[counts] / force_N)) for key, total in theory.beam_totals_N.items()}


def theory_is_much_larger(results: SweepResults) -> Finding:
    over = _theory_over_simulation(results)
    return graded(min(over.values()), 1.5, 1.05), f"theory over simulation, mean over the ratios: {listed(over, '.2f')}"


def fn_is_nearest(results: SweepResults) -> Finding:
    over = _theory_over_simulation(results)
    nearest = min(over, key=lambda key: abs(np.log(over[key])))
    return held_if(nearest == "FN"), f"nearest is {nearest}, {over[nearest]:.2f} of the simulated force"


THEORY_STATEMENTS = [
    Statement("Without deflection the peak force of a sphere does not depend on where it hits", "Fig. 9", "fig-9",
              "no spread", position_does_not_matter),
    Statement("With deflection the peak force is smallest in the middle and grows to both ends", "Fig. 9", "fig-9",
              "minimum in the middle, monotone to the ends", weakest_in_the_middle),
    Statement("Damping lowers the peak force in either state", "Fig. 9", "fig-9", "< 1", damping_lowers),
    Statement("With deflection the force is much less than without", "Fig. 9", "fig-9",
              "'much': at most 0.7 in the middle; partly below 0.95", deflection_lowers_much),
    Statement("Gangue pushes harder than coal at the same place in all four states", "Fig. 9", "fig-9", "> 1",
              gangue_is_harder),
    Statement("The total force of all four states rises with the ratio", "Fig. 10", "fig-10", "every step > 0",
              totals_rise),
    Statement("The totals without deflection rise in a straight line", "Fig. 10", "fig-10", "equal steps",
              rigid_totals_are_straight),
    Statement("The totals with deflection rise in uneven steps", "Fig. 10", "fig-10",
              "steps differ by 5 % or more; partly from 0.5 %", deflecting_totals_fluctuate),
    Statement("The total force of all four theories is much larger than the simulated one", "Fig. 10, 19", "fig-19",
              "'much': 1.5 or more; partly from 1.05", theory_is_much_larger),
    Statement("Flores with deflection is the theory nearest to the simulation", "Fig. 10, 19", "fig-19", "FN nearest",
              fn_is_nearest),
]  # fmt: skip
