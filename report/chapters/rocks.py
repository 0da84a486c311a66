"""The chapter of the shipped rocks, soft coal, hard coal and gangue; the paper has none."""

from __future__ import annotations

from report.chapters.figure_spec import Drawn, FigureSpec
from report.figures import rocks as figures
from report.results.rocks import struck_rocks
from report.results.sweep_results import SweepResults


def against_speed(_: SweepResults) -> Drawn:
    return figures.against_speed(struck_rocks()[1])


def slices(_: SweepResults) -> Drawn:
    speed_m_s, rocks = struck_rocks()
    return figures.slices([rock for rock in rocks if "coal" in rock.name], speed_m_s), f"At {speed_m_s:g} m/s."


KEPT_NOTE = "Kept from `python -m benchmarks.rocks`, not from these runs."

ROCK_FIGURES = [
    FigureSpec(
        key="fig-rocks",
        title="Soft coal, hard coal and gangue in the same impact",
        in_paper="One coal and one gangue.",
        caption=f"One stone of one packing on a rigid plate, with the bonds of each rock. {KEPT_NOTE}",
        draw=against_speed,
    ),
    FigureSpec(
        key="fig-rock-slices",
        title="Pieces of soft and hard coal",
        in_paper="Not in the paper.",
        caption=(
            "The same stone seen along the impact: sub-spheres within 5 mm of its middle, where they were before; a"
            f" colour a fragment, grey the largest. {KEPT_NOTE}"
        ),
        draw=slices,
    ),
]
