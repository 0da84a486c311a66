"""The figures of breakage: Figures 13 to 15 of the paper."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import LogLocator, NullFormatter

from analysis.sweep import breakage
from analysis.sweep.breakage import Section
from common.scene.stones import KINDS
from report.drawing.figure_spec import Drawn, figure
from report.drawing.lines import against_ratio, with_spread
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
)
from report.missing import MissingResult
from report.sweep_results import SweepResults

MOST_SECTIONS = 10  # of the stones of a run
COLUMNS = 5  # of sections
#: Label of a row, its sections, and the materials of their stones.
Row = tuple[str, list[Section], list[str]]


def _draws(results: SweepResults) -> str:
    """The end of a note: how many draws a figure shows."""
    words = results.breakage.draws_in_words
    return f"{words[0].upper()}{words[1:]}."


@figure("fig-13", "Breakage at stages of the impact",
        "Vertical sections of stones in their undeformed shape; grey frames: coal, brown: gangue.")
def stages(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    run, first_end_s = results.runs[index], results.breakage.first_collision_end_s[index]
    times_s = {"after its first collision": first_end_s, "end": np.inf}
    shown = sorted(np.argsort(-results.breakage.area_end_m2[index], kind="stable")[:MOST_SECTIONS])
    materials = [run.materials[k] for k in shown]
    rows = [(label, [one for k, one in enumerate(results.breakage.sections(index, t)) if k in shown], materials)
            for label, t in times_s.items()]
    few = f", the {MOST_SECTIONS} that broke most" if len(run.materials) > MOST_SECTIONS else ""
    return _rows_of_sections(rows), f"Run of {100 * run.gangue_ratio:.0f} %{few}. {_draws(results)}"


@figure("fig-14", "Sections after the first collision",
        "Of each ratio the coal and the gangue stone of middling damage; grey frames: coal, brown: gangue.", ratios=2)
def sections(results: SweepResults) -> Drawn:
    rows, ends_s = [], results.breakage.first_collision_end_s
    for kind in KINDS:
        found, names = [], []
        for i, run in enumerate(results.runs):
            own = np.flatnonzero(results.is_gangue[i] == (kind == "gangue"))
            if own.size:
                middling = own[np.argsort(results.breakage.area_first_m2[i][own], kind="stable")[own.size // 2]]
                found.append(results.breakage.sections(i, ends_s[i])[middling])
                names.append(f"{100 * run.gangue_ratio:.0f}")
        if found:
            rows.append((f"{kind} of the runs of {', '.join(names)} %", found, [kind] * len(found)))
    return _rows_of_sections(rows), _draws(results)


def _rows_of_sections(rows: list[Row]) -> Figure:
    """Sections coloured by damage, each row in as many lines of COLUMNS as it needs, below its label."""
    radius_m = max(float(np.max(np.abs(one.centre_m) + one.radius_m[:, None], initial=1e-6))
                   for _, found, _ in rows for one in found)
    cell_m, placed, top = 2.3 * radius_m, [], 0.0
    figure, axes = canvas(1, height_in=1.0, bar="bottom")
    axis = axes[0, 0]
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
    first_m2, end_m2 = results.breakage.area_first_m2, results.breakage.area_end_m2
    ends_s = results.breakage.first_collision_end_s
    in_sections_m2 = np.array([sum(section.broken_area_m2 for section in results.breakage.sections(i, ends_s[i]))
                               for i in range(len(results.runs))])
    volume = results.mean_by_material(results.breakage.damaged_volume_share)
    of_all = {"first collision": 1e4 * first_m2.sum(axis=1), "end": 1e4 * end_m2.sum(axis=1)}
    return against_ratio(results.ratios, [
        ("crack area of one stone, cm²", {k: 1e4 * area for k, area in results.mean_by_material(first_m2).items()}),
        ("crack area of all stones, cm²", of_all),
        ("broken area in sections, cm²", {"first collision": 1e4 * in_sections_m2}),
        ("damaged volume, %", {name: 100 * share for name, share in volume.items()}),
    ]), _draws(results)


@figure("fig-area-time", "Crack area over time", "One curve a stone.")
def area_over_time(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    run = results.runs[index]
    if run.breakage.empty:
        raise MissingResult("no bond breaks")
    t_s = np.linspace(0, max(run.t_s[-1], run.breakage["t_s"].max()), 300)  # of the whole run
    figure, axes = canvas(1, height_in=2.6)
    axis = axes[0, 0]
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
        axis.set_title(f"broken bonds of {kind}")
        axis.set_xlabel(RATIO_LABEL)
        axis.legend()
    return figure, _draws(results)


@figure("fig-fragments", "Fragments", "A fragment is what intact bonds still hold together.")
def fragments(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    if results.runs[index].breakage.empty:
        raise MissingResult("no bond breaks")
    shares = results.breakage.fragment_shares(index)
    figure, axes = canvas(1, height_in=2.6)
    axis = axes[0, 0]
    for kind in KINDS:
        of_kind = results.is_gangue[index] == (kind == "gangue")
        volumes = np.sort(np.concatenate([np.empty(0), *(s for s, own in zip(shares, of_kind, strict=True) if own)]))
        if volumes.size:
            axis.step(volumes ** (1 / 3), 100 * np.cumsum(volumes) / volumes.sum(), where="post",
                      color=material_colour(kind), label=f"{kind}, {volumes.size} piece{'s' * (volumes.size > 1)}")
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set(xlabel="size of the fragment over that of the stone", ylabel="volume in smaller pieces, %")
    axis.legend()
    return figure, f"Run of {100 * results.ratios[index]:.0f} % at its end. {_draws(results)}"


BREAKAGE_FIGURES = [stages, sections, broken_areas, area_over_time, cracks, fragments]
