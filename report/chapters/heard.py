"""The chapter of a stream whose stones were heard one by one."""

from __future__ import annotations

from report.chapters.figure_spec import Drawn, FigureSpec
from report.figures.heard import ratio_over_time
from report.results.heard import WINDOW_S, read_heard
from report.results.stream import StreamResults


def heard(results: StreamResults) -> Drawn:
    found = read_heard(results)
    return (ratio_over_time(found.heard, found.truth),
            f"{found.stones_heard} stones were heard, {found.stones} touched the plate.")


HEARD_FIGURES = [
    FigureSpec("stream-heard", "What was heard", "",
               f"Mixing ratio by mass of the stones of the last {WINDOW_S:g} s, from accelerometers with noise.",
               heard),
]
