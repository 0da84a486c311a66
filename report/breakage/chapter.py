"""The chapter of breakage: Figures 13 to 15 of the paper."""

from __future__ import annotations

import numpy as np

from analysis.sweep import breakage
from report.breakage import figures
from report.drawing.figure_spec import Drawn, FigureSpec
from report.drawing.lines import against_ratio
from report.sweep_results import SweepResults

MATERIALS = ("coal", "gangue")


def stages(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    run, first_end_s = results.runs[index], results.breakage.first_collision_end_s[index]
    times_s = {"first\ncollision": first_end_s, "20 ms": 0.02, "end": np.inf}
    rows = [(label, results.breakage.sections(index, t), run.materials) for label, t in times_s.items()]
    note = f"Run of {run.gangue_ratio:.0%}; black frames: coal, brown: gangue."
    return figures.sections(rows, results.theory.setup.radius_m), note


def sections(results: SweepResults) -> Drawn:
    ends_s = results.breakage.first_collision_end_s
    rows = [
        (f"{100 * run.gangue_ratio:.0f} %", results.breakage.sections(i, ends_s[i]), run.materials)
        for i, run in enumerate(results.runs)
    ]
    return figures.sections(rows, results.theory.setup.radius_m)


def broken_areas(results: SweepResults) -> Drawn:
    first_m2, end_m2 = results.breakage.area_first_m2, results.breakage.area_end_m2
    ends_s = results.breakage.first_collision_end_s
    in_sections_m2 = np.array([
        sum(section.broken_area_m2 for section in results.breakage.sections(i, ends_s[i]))
        for i in range(len(results.runs))
    ])  # fmt: skip
    volume = results.mean_by_material(results.breakage.damaged_volume_share)
    of_all = {"first collision": 1e4 * first_m2.sum(axis=1), "end": 1e4 * end_m2.sum(axis=1)}
    panels = [
        ("crack area of one stone, cm²", {k: 1e4 * area for k, area in results.mean_by_material(first_m2).items()}),
        ("crack area of all stones, cm²", of_all),
        ("broken area in sections, cm²", {"first collision": 1e4 * in_sections_m2}),
        ("damaged volume of one stone, %", {name: 100 * share for name, share in volume.items()}),
    ]
    return against_ratio(results.ratios, panels)


def area_over_time(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    run = results.runs[index]
    last_s = run.breakage["t_s"].max() if len(run.breakage) else 0.0  # of the whole run, not of the paper's window
    t_s = np.linspace(0, max(run.t_s[-1], last_s), 300)
    return figures.area_over_time(t_s, breakage.broken_area_over_time(run, t_s), results.is_gangue[index])


def cracks(results: SweepResults) -> Drawn:
    found = [breakage.crack_counts(run) for run in results.runs]
    counts = {
        material: {mode: np.array([f[material][mode] for f in found]) for mode in ("tension", "shear")}
        for material in MATERIALS
    }
    return figures.cracks(results.ratios, counts)


def fragments(results: SweepResults) -> Drawn:
    index = results.index_nearest(0.5)
    shares, is_gangue = results.breakage.fragment_shares(index), results.is_gangue[index]
    sizes = {
        material: np.concatenate(
            [np.empty(0), *(s for s, g in zip(shares, is_gangue, strict=True) if g == (material == "gangue"))]
        )
        for material in MATERIALS
    }
    return figures.fragment_sizes(sizes), f"Run of {results.ratios[index]:.0%} at its end."


BREAKAGE_FIGURES = [
    FigureSpec(
        key="fig-13",
        title="Breakage at stages of the impact (Figure 13)",
        in_paper=(
            "After the first collision coal is broken much more than gangue; gangue does not change after it, coal"
            " goes on breaking."
        ),
        caption="Vertical sections of the ten stones in their undeformed shape.",
        draw=stages,
    ),
    FigureSpec(
        key="fig-14",
        title="Sections after the first collision (Figures 14, 15)",
        in_paper="The broken area of single particles does not change with the ratio.",
        caption="One row a ratio; black frames: coal, brown: gangue.",
        draw=sections,
    ),
    FigureSpec(
        key="fig-15",
        title="Broken area against the ratio (Figure 15)",
        in_paper="Of one coal or gangue: constant. Of all ten: rising as the ratio falls.",
        caption=(
            "Crack area of broken bonds after the first collision; area of the sub-spheres in the sections that lost"
            " half of their bonds; damaged volume at the end."
        ),
        draw=broken_areas,
    ),
    FigureSpec(
        key="fig-area-time",
        title="Crack area over time",
        in_paper="Coal breaks on in later collisions.",
        caption="Each stone of the run nearest to 50 %.",
        draw=area_over_time,
    ),
    FigureSpec(
        key="fig-cracks",
        title="Cracks by mode",
        in_paper="Not in the paper.",
        caption="Bonds broken in tension and in shear.",
        draw=cracks,
    ),
    FigureSpec(
        key="fig-fragments",
        title="Fragments",
        in_paper="Not in the paper, which shows the pieces only.",
        caption="A fragment is what intact bonds still hold together.",
        draw=fragments,
    ),
]
