"""The chapter of breakage (Figures 13 to 15): numbers, pictures, captions and statements."""

from functools import cached_property

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from analysis.sweep import breakage
from analysis.sweep.breakage import Section
from common.scene.stones import KINDS
from report.drawing.figure_spec import Drawn, figure
from report.drawing.lines import against_ratio, make_logarithmic, with_spread
from report.drawing.style import (
    ACCENT,
    DAMAGE_COLOURS,
    GANGUE,
    RATIO_LABEL,
    WIDTH_IN,
    bar_axes,
    canvas,
    hide_scales,
    material_colour,
    single,
)
from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.verdicts import HELD, NOT_HELD, Finding, Statement, Test, graded, held_if, trend

MOST_SECTIONS = 10  # of the stones of a run
COLUMNS = 5  # of sections
#: Label of a row, its sections, and the materials of their stones.
Row = tuple[str, list[Section], list[str]]


class Breakage:
    """Breakage of every stone of every run. Raises RecordError for runs without bonds."""

    def __init__(self, results: SweepResults):
        self._runs = results.runs

    @cached_property
    def draws_in_words(self) -> str:
        """How many runs of other packings, by seed or number of sub-spheres, each ratio has: without some a figure of
        breakage has no spread."""
        packings: dict[float, set[object]] = {}
        for run in self._runs:
            seeds = tuple(run.summary.seeds or ())
            packings.setdefault(run.gangue_ratio, set()).add((seeds, run.summary.n_particles))
        draws = min(map(len, packings.values()))
        return f"{draws} draws a ratio" if draws > 1 else "one draw: no spread known"

    @cached_property
    def networks(self) -> list[breakage.Network]:
        """Sub-spheres and bonds of each run before the impact."""
        return [breakage.read_network(run) for run in self._runs]

    @cached_property
    def first_collision_end_s(self) -> np.ndarray:
        """Time at which each stone's first collision ends, shape (runs, stones)."""
        return np.stack([breakage.first_collision_end_s(run) for run in self._runs])

    @cached_property
    def area_first_m2(self) -> np.ndarray:
        """Crack area of each stone after its first collision, shape (runs, stones)."""
        ends = self.first_collision_end_s
        return np.stack([breakage.broken_area_m2(run, end) for run, end in zip(self._runs, ends, strict=True)])

    @cached_property
    def area_end_m2(self) -> np.ndarray:
        """Crack area of each stone at the end of the run, shape (runs, stones)."""
        return np.stack([breakage.broken_area_m2(run) for run in self._runs])

    @property
    def damaged_volume_share(self) -> np.ndarray:
        """Damaged share of the volume of each stone at the end of the run, shape (runs, stones), 0..1."""
        pairs = zip(self._runs, self.networks, strict=True)
        return np.stack([breakage.damaged_volume_share(n, breakage.broken_bonds(run, n)) for run, n in pairs])

    def sections(self, index: int, until_s: float | np.ndarray) -> list[breakage.Section]:
        """Return the vertical section of each stone of run `index`, damaged as at a time (one, or one a stone)."""
        network = self.networks[index]
        damaged = breakage.damage(network, breakage.broken_bonds(self._runs[index], network, until_s))
        return [breakage.section(network, damaged, k) for k in range(1, network.agglomerate.max() + 1)]

    def fragment_shares(self, index: int) -> list[np.ndarray]:
        """Volumes of the fragments of each stone of run `index` at its end, shares of the stone, the largest first."""
        network = self.networks[index]
        return breakage.fragment_shares(network, breakage.broken_bonds(self._runs[index], network))

    @cached_property
    def largest_share(self) -> np.ndarray:
        """The largest of these of each stone, shape (runs, stones)."""
        return np.array([[shares[0] for shares in self.fragment_shares(k)] for k in range(len(self._runs))])


def _draws(results: SweepResults) -> str:
    """The end of a note: how many draws a figure shows."""
    words = results.of(Breakage).draws_in_words
    return f"{words[0].upper()}{words[1:]}."


@figure("fig-13", "Breakage at stages of the impact",
        "Vertical sections of stones in their undeformed shape; grey frames: coal, brown: gangue.")
def stages(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    run, found = results.runs[index], results.of(Breakage)
    times_s = {"after its first collision": found.first_collision_end_s[index], "end": np.inf}
    shown = sorted(np.argsort(-found.area_end_m2[index], kind="stable")[:MOST_SECTIONS])
    materials = [run.materials[k] for k in shown]
    rows = [(label, [one for k, one in enumerate(found.sections(index, t)) if k in shown], materials)
            for label, t in times_s.items()]
    few = f", the {MOST_SECTIONS} that broke most" if len(run.materials) > MOST_SECTIONS else ""
    return _rows_of_sections(rows), f"Run of {100 * run.gangue_ratio:.0f} %{few}. {_draws(results)}"


@figure("fig-14", "Sections after the first collision",
        "Of each ratio the coal and the gangue stone of middling damage; grey frames: coal, brown: gangue.", ratios=2)
def sections(results: SweepResults) -> Drawn:
    rows, found = [], results.of(Breakage)
    for kind in results.kinds:
        shown, names = [], []
        for i, own in enumerate(map(np.flatnonzero, results.is_of(kind))):
            if own.size:
                middling = own[np.argsort(found.area_first_m2[i][own], kind="stable")[own.size // 2]]
                shown.append(found.sections(i, found.first_collision_end_s[i])[middling])
                names.append(f"{100 * results.ratios[i]:.0f}")
        rows.append((f"{kind} of the runs of {', '.join(names)} %", shown, [kind] * len(shown)))
    return _rows_of_sections(rows), _draws(results)


def _rows_of_sections(rows: list[Row]) -> Figure:
    """Sections coloured by damage, each row in as many lines of COLUMNS as it needs, below its label."""
    radius_m = max(float(np.max(np.abs(one.centre_m) + one.radius_m[:, None], initial=1e-6))
                   for _, found, _ in rows for one in found)
    cell_m, placed, top = 2.3 * radius_m, [], 0.0
    figure, axis = single(1.0, bar="bottom")
    for label, found, materials in rows:
        axis.text(-0.5, top - 0.12, label, va="center")
        for k, one in enumerate(zip(found, materials, strict=True)):
            placed.append((*one, cell_m * np.array([k % COLUMNS, top - 0.75 - k // COLUMNS])))
        top -= -(-len(found) // COLUMNS) + 0.3
    for _, material, place in placed:
        left, bottom = place - 1.08 * radius_m
        axis.add_patch(Rectangle((left, bottom), 2.16 * radius_m, 2.16 * radius_m, fill=False, linewidth=1.1,
                                 edgecolor=material_colour(material)))  # fmt: skip
    for text in axis.texts:
        text.set_position((cell_m * text.get_position()[0], cell_m * text.get_position()[1]))
    axis.set(xlim=(-0.52 * cell_m, (COLUMNS - 0.48) * cell_m), ylim=(top * cell_m, 0.05 * cell_m))
    hide_scales(axis)
    axis.spines[:].set_visible(False)
    figure.set_size_inches(WIDTH_IN, 0.7 - top * (WIDTH_IN - 0.2) / COLUMNS)
    figure.colorbar(_discs(axis, [(section, place) for section, _, place in placed]), cax=bar_axes(figure),
                    orientation="horizontal", label="damage: broken share of a sub-sphere's bonds")
    return figure


def _discs(axis: Axes, placed: list[tuple[Section, np.ndarray]]) -> EllipseCollection:
    """Draw all sections as one image: thousands of discs would make the SVG large."""
    diameters = np.concatenate([2 * section.radius_m for section, _ in placed])
    discs = EllipseCollection(
        diameters, diameters, np.zeros_like(diameters), units="xy",
        offsets=np.concatenate([section.centre_m + place for section, place in placed]), transOffset=axis.transData,
        array=np.concatenate([section.damage for section, _ in placed]), cmap=DAMAGE_COLOURS, norm=Normalize(0, 1),
        edgecolor="none", rasterized=True)
    axis.add_collection(discs)
    return discs


@figure("fig-15", "Broken area against the ratio",
        "Crack area of broken bonds after the first collision; area of the sub-spheres in the sections that lost half "
        "of their bonds; damaged volume at the end.", ratios=2)
def broken_areas(results: SweepResults) -> Drawn:
    found = results.of(Breakage)
    first_cm2, end_cm2 = 1e4 * found.area_first_m2, 1e4 * found.area_end_m2
    in_sections_m2 = np.array([sum(section.broken_area_m2 for section in found.sections(i, ends_s))
                               for i, ends_s in enumerate(found.first_collision_end_s)])
    return against_ratio(results.ratios, [
        ("crack area of one stone, cm²", results.mean_by_material(first_cm2)),
        ("crack area of all stones, cm²", {"first collision": first_cm2.sum(axis=1), "end": end_cm2.sum(axis=1)}),
        ("broken area in sections, cm²", {"first collision": 1e4 * in_sections_m2}),
        ("damaged volume, %", results.mean_by_material(100 * found.damaged_volume_share)),
    ]), _draws(results)


@figure("fig-area-time", "Crack area over time", "One curve a stone.")
def area_over_time(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    run = results.runs[index]
    if run.breakage.empty:
        raise MissingResult("no bond breaks")
    t_s = np.linspace(0, max(run.t_s[-1], run.breakage["t_s"].max()), 300)  # of the whole run
    figure, axis = single(2.6)
    for number, (row, kind) in enumerate(zip(breakage.broken_area_over_time(run, t_s), run.materials, strict=True), 1):
        axis.plot(1e3 * t_s, 1e4 * row, color=material_colour(kind), linewidth=0.9, label=f"_stone {number}")
    for kind in KINDS:
        axis.plot([], [], color=material_colour(kind), label=kind)
    axis.set(xlabel="time, ms", ylabel="crack area, cm²")
    axis.legend()
    return figure, _draws(results)


@figure("fig-cracks", "Cracks by mode", "Bonds broken in tension and in shear.", ratios=2)
def cracks(results: SweepResults) -> Drawn:
    counts = [breakage.crack_counts(run) for run in results.runs]
    figure, axes = canvas(1, len(KINDS), height_in=2.4)
    for axis, kind in zip(axes[0], KINDS, strict=True):
        for colour, mode in ((ACCENT, "tension"), (GANGUE, "shear")):
            with_spread(axis, results.ratios, np.array([one[kind][mode] for one in counts]), colour, mode)
        axis.set(title=f"broken bonds of {kind}", xlabel=RATIO_LABEL)
        axis.legend()
    return figure, _draws(results)


@figure("fig-fragments", "Fragments", "A fragment is what intact bonds still hold together.")
def fragments(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    if results.runs[index].breakage.empty:
        raise MissingResult("no bond breaks")
    shares = results.of(Breakage).fragment_shares(index)
    figure, axis = single(2.6)
    for kind in KINDS:
        own = np.flatnonzero(results.is_of(kind)[index])
        if own.size:
            volumes = np.sort(np.concatenate([shares[k] for k in own]))
            axis.step(volumes ** (1 / 3), 100 * np.cumsum(volumes) / volumes.sum(), where="post",
                      color=material_colour(kind), label=f"{kind}, {volumes.size} piece{'s' * (volumes.size > 1)}")
    make_logarithmic(axis.xaxis)
    axis.set(xlabel="size of the fragment over that of the stone", ylabel="volume in smaller pieces, %")
    axis.legend()
    return figure, f"Run of {100 * results.ratios[index]:.0f} % at its end. {_draws(results)}"


BREAKAGE_FIGURES = [stages, sections, broken_areas, area_over_time, cracks, fragments]


def _half(results: SweepResults) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of the runs with five of ten gangue, and which of their stones are gangue (runs, stones)."""
    results.index_at(0.5)  # is there one?
    runs = np.flatnonzero(np.abs(results.ratios - 0.5) < 1e-6)
    return runs, results.is_gangue[runs]


def _with_error(values: np.ndarray, form: str) -> str:
    """The mean and, of two values or more, its standard error."""
    error = f" ± {values.std(ddof=1) / np.sqrt(values.size):{form}}" if values.size > 1 else ""
    return f"{values.mean():{form}}{error}"


def coal_breaks_more(results: SweepResults) -> Finding:
    runs, gangue = _half(results)
    area = 1e4 * results.of(Breakage).area_first_m2[runs]
    stones = f"{_with_error(area[~gangue], '.3g')} and {_with_error(area[gangue], '.3g')} cm² over stones"
    if area[gangue].mean() == 0:
        none = area[~gangue].mean() == 0
        return (NOT_HELD, "neither breaks") if none else (HELD, f"gangue does not break at all; {stones}")
    ratio = area[~gangue].mean() / area[gangue].mean()
    return graded(ratio, 2.0, 1.1), f"coal over gangue {ratio:.2f}: {stones}; {results.of(Breakage).draws_in_words}"


def breaks_later(kind: str, held: float, partly: float) -> Test:
    """Test the share of the crack area of coal or gangue that comes after the first collision."""

    def test(results: SweepResults) -> Finding:
        runs, found = _half(results)[0], results.of(Breakage)
        chosen = results.is_of(kind)[runs]
        first, end = found.area_first_m2[runs][chosen], found.area_end_m2[runs][chosen]
        if end.sum() == 0:
            raise MissingResult(f"no {kind} breaks")
        share = float(1 - first.sum() / end.sum())
        missed = end - first - share * end  # of a ratio of sums
        error = np.sqrt(end.size / max(end.size - 1, 1) * (missed**2).sum()) / end.sum()  # standard, over the stones
        return graded(share, held, partly), (f"{100 * share:.1f} ± {100 * error:.2g} % of its crack area comes after "
                                             f"the first collision, over {end.size} stones; {found.draws_in_words}")

    return test


def coal_falls_into_smaller_pieces(results: SweepResults) -> Finding:
    runs, gangue = _half(results)
    largest = results.of(Breakage).largest_share[runs]
    of_coal, of_gangue = largest[~gangue], largest[gangue]
    value = (f"largest fragment, share of the stone: coal {_with_error(of_coal, '.3f')}, gangue "
             f"{_with_error(of_gangue, '.3f')}; {results.of(Breakage).draws_in_words}")
    return held_if(of_coal.mean() < of_gangue.mean() < 1 + 1e-9), value


def single_area_is_constant(results: SweepResults) -> Finding:
    """The scatter over the ratios, of coal and of gangue, is a share of the area of one coal."""
    means = results.mean_by_material(results.of(Breakage).area_first_m2)
    areas = {name: area[np.isfinite(area)] for name, area in means.items()}
    if not areas["coal"].size or areas["coal"].mean() == 0:
        raise MissingResult("no coal breaks")
    scatter = {name: float(area.std() / areas["coal"].mean()) for name, area in areas.items() if area.size}
    numbers = ", ".join(f"{name} {100 * value:.1f} %" for name, value in scatter.items())
    value = f"scatter over the ratios, of the area of one coal: {numbers}; {results.of(Breakage).draws_in_words}"
    return graded(max(scatter.values()), 0.1, 0.25), value


def total_area_rises(results: SweepResults) -> Finding:
    verdict, words = trend(lambda of: of.of(Breakage).area_first_m2.sum(axis=1), -1, 1e4, "cm²")(results)
    return verdict, f"{words}; {results.of(Breakage).draws_in_words}"


BREAKAGE_STATEMENTS = [
    Statement("After the first collision one coal is broken much more than one gangue", "Fig. 13", "fig-13",
              "'much': 2 or more; partly from 1.1", coal_breaks_more),
    Statement("After the first collision gangue does not break further", "Fig. 13", "fig-13",
              "at most 2 % later; partly to 10 %", breaks_later("gangue", 0.02, 0.1)),
    Statement("Coal goes on breaking in later collisions", "Fig. 13", "fig-13",
              "at least 10 % later; partly from 2 %", breaks_later("coal", 0.1, 0.02)),
    Statement("Coal falls into smaller pieces than gangue", "Fig. 13", "fig-fragments", "coal < gangue",
              coal_falls_into_smaller_pieces),
    Statement("The broken area of a single coal or gangue does not change with the ratio", "Fig. 15", "fig-15",
              "scatter at most 10 % of coal's area; partly to 25 %", single_area_is_constant),
    Statement("The total broken area rises as the ratio falls (Conclusion 1 says the reverse)", "Fig. 15", "fig-15",
              "Spearman <= -0.9", total_area_rises),
]  # fmt: skip
