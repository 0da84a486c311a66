"""The chapter of a stream whose stones were heard one by one; the paper has none."""

from __future__ import annotations

from report.chapters.figure_spec import Drawn, FigureSpec
from report.figures.stream import ratio_over_time
from report.results.heard import DIRECTORY, WINDOW_S, read_heard
from report.results.sweep_results import SweepResults


def was_heard(results: SweepResults) -> bool:
    """Whether `listen` left its stones among the runs."""
    return (results.sweep.path / DIRECTORY).is_dir()


def _ratio(results: SweepResults) -> Drawn:
    found = read_heard(results.sweep.path, results.runs[0])
    return (ratio_over_time(found.heard, found.truth),
            f"{found.stones_heard} stones were heard, {found.stones} touched the plate.")


STREAM_FIGURES = [
    FigureSpec(
        key="fig-heard",
        title="Stones heard one by one",
        in_paper="Not in the paper.",
        caption=f"Mixing ratio by mass of the stones of the last {WINDOW_S:g} s, from four accelerometers with noise.",
        draw=_ratio,
    ),
]
