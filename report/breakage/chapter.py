"""The chapter of breakage: Figures 13 to 15 of the paper."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps

import numpy as np

from analysis.sweep import breakage
from report.breakage import figures
from report.drawing.figure_spec import Drawn, FigureSpec
from report.drawing.lines import against_ratio
from report.missing import MissingResult
from report.sweep_results import SweepResults

MATERIALS = ("coal", "gangue")
MOST_SECTIONS = 10  # of the stones of a run


def of_draws(draw: Callable[[SweepResults], Drawn]) -> Callable[[SweepResults], Drawn]:
    """A figure whose note ends with how many draws it shows."""
    @wraps(draw)
    def told(results: SweepResults) -> Drawn:
        drawn = draw(results)
        figure, note = drawn if isinstance(drawn, tuple) else (drawn, "")
        words = results.breakage.draws_in_words
        return figure, f"{note} {words[0].upper()}{words[1:]}.".strip()

    return told


@of_draws
def stages(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    run, first_end_s = results.runs[index], results.breakage.first_collision_end_s[index]
    times_s = {"after its first collision": first_end_s, "end": np.inf}
    shown = sorted(np.argsort(-results.breakage.area_end_m2[index], kind="stable")[:MOST_SECTIONS])
    materials = [run.materials[k] for k in shown]
    rows = [(label, [one for k, one in enumerate(results.breakage.sections(index, t)) if k in shown], materials)
            for label, t in times_s.items()]
    few = f", the {MOST_SECTIONS} that broke most" if len(run.materials) > MOST_SECTIONS else ""
    return figures.sections(rows), f"Run of {100 * run.gangue_ratio:.0f} %{few}."


@of_draws
def sections(results: SweepResults) -> Drawn:
    rows, ends_s = [], results.breakage.first_collision_end_s
    for material in MATERIALS:
        found, names = [], []
        for i, run in enumerate(results.runs):
            own = np.flatnonzero(results.is_gangue[i] == (material == "gangue"))
            if own.size:
                middling = own[np.argsort(results.breakage.area_first_m2[i][own], kind="stable")[own.size // 2]]
                found.append(results.breakage.sections(i, ends_s[i])[middling])
                names.append(f"{100 * run.gangue_ratio:.0f}")
        if found:
            rows.append((f"{material} of the runs of {', '.join(names)} %", found, [material] * len(found)))
    return figures.sections(rows)


@of_draws
def broken_areas(results: SweepResults) -> Drawn:
    first_m2, end_m2 = results.breakage.area_first_m2, results.breakage.area_end_m2
    ends_s = results.breakage.first_collision_end_s
    in_sections_m2 = np.array([sum(section.broken_area_m2 for section in results.breakage.sections(i, ends_s[i]))
                               for i in range(len(results.runs))])
    volume = results.mean_by_material(results.breakage.damaged_volume_share)
    of_all = {"first collision": 1e4 * first_m2.sum(axis=1), "end": 1e4 * end_m2.sum(axis=1)}
    panels = [
        ("crack area of one stone, cm²", {k: 1e4 * area for k, area in results.mean_by_material(first_m2).items()}),
        ("crack area of all stones, cm²", of_all),
        ("broken area in sections, cm²", {"first collision": 1e4 * in_sections_m2}),
        ("damaged volume, %", {name: 100 * share for name, share in volume.items()}),
    ]
    return against_ratio(results.ratios, panels)


@of_draws
def area_over_time(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    run = results.runs[index]
    if run.breakage.empty:
        raise MissingResult("no bond breaks")
    t_s = np.linspace(0, max(run.t_s[-1], run.breakage["t_s"].max()), 300)  # of the whole run
    return figures.area_over_time(t_s, breakage.broken_area_over_time(run, t_s), results.is_gangue[index])


@of_draws
def cracks(results: SweepResults) -> Drawn:
    found = [breakage.crack_counts(run) for run in results.runs]
    counts = {
        material: {mode: np.array([f[material][mode] for f in found]) for mode in ("tension", "shear")}
        for material in MATERIALS
    }
    return figures.cracks(results.ratios, counts)


@of_draws
def fragments(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    if results.runs[index].breakage.empty:
        raise MissingResult("no bond breaks")
    shares, is_gangue = results.breakage.fragment_shares(index), results.is_gangue[index]
    sizes = {
        material: np.concatenate(
            [np.empty(0), *(s for s, g in zip(shares, is_gangue, strict=True) if g == (material == "gangue"))]
        )
        for material in MATERIALS
    }
    return figures.fragment_sizes(sizes), f"Run of {100 * results.ratios[index]:.0f} % at its end."


BREAKAGE_FIGURES = [
    FigureSpec("fig-13", "Breakage at stages of the impact",
               "Vertical sections of stones in their undeformed shape; grey frames: coal, brown: gangue.", stages),
    FigureSpec("fig-14", "Sections after the first collision",
               "Of each ratio the coal and the gangue stone of middling damage; grey frames: coal, brown: gangue.",
               sections, ratios=2),
    FigureSpec("fig-15", "Broken area against the ratio",
               "Crack area of broken bonds after the first collision; area of the sub-spheres in the sections that "
               "lost half of their bonds; damaged volume at the end.",
               broken_areas, ratios=2),
    FigureSpec("fig-area-time", "Crack area over time", "One curve a stone.", area_over_time),
    FigureSpec("fig-cracks", "Cracks by mode", "Bonds broken in tension and in shear.", cracks, ratios=2),
    FigureSpec("fig-fragments", "Fragments", "A fragment is what intact bonds still hold together.", fragments),
]
