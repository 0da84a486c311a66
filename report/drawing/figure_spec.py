"""A figure of the report before and after it is drawn."""

from collections.abc import Callable
from dataclasses import dataclass

import matplotlib
from matplotlib.figure import Figure

from report.drawing.data import panels, to_csv
from report.drawing.style import STYLE, to_uri
from report.film.packing import pack_text
from report.missing import MISSING_RESULT

#: A figure alone, or with a note to add to its caption.
Drawn = Figure | tuple[Figure, str]


@dataclass(frozen=True)
class FinishedFigure:
    """A figure as the page shows it. uri: of its SVG, data: packed CSV of its numbers, panels: `data.panels`; all empty
    where the runs do not give the figure, and the caption then says why."""

    key: str
    title: str
    caption: str
    uri: str = ""
    data: str = ""
    panels: str = ""


@dataclass(frozen=True)
class FigureSpec:
    """A figure to draw. key: its id in the page. draw: from the results of a sweep, or of the run of a stream. ratios:
    it needs at least so many."""

    key: str
    title: str
    caption: str
    draw: Callable[..., Drawn]
    ratios: int = 1

    def drawn(self, results: object) -> tuple[Figure, str]:
        """The figure, and a note to add to its caption, "" for none. Raises one of MISSING_RESULT."""
        with matplotlib.rc_context(STYLE):
            drawn = self.draw(results)
        return drawn if isinstance(drawn, tuple) else (drawn, "")

    def finished(self, results: object) -> FinishedFigure:
        """The figure for the page; its caption says why where the runs do not give it."""
        try:
            figure, note = self.drawn(results)
        except MISSING_RESULT as reason:
            return FinishedFigure(self.key, self.title, f"Not drawn: {reason}")
        caption, uri = f"{self.caption} {note}".strip(), to_uri(figure, self.key)
        return FinishedFigure(self.key, self.title, caption, uri, pack_text(to_csv(figure)), panels(figure))


def figure(key: str, title: str, caption: str = "", ratios: int = 1) -> Callable[[Callable[..., Drawn]], FigureSpec]:
    """Make a figure of the function below, which draws it."""
    return lambda draw: FigureSpec(key, title, caption, draw, ratios)
