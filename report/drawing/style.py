"""The look of all figures, and how a figure gets into the page."""

from __future__ import annotations

import base64
import functools
import io
from collections.abc import Callable
from typing import Any, ParamSpec

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize, to_hex
from matplotlib.figure import Figure

Arguments = ParamSpec("Arguments")

STYLE: Any = {
    "svg.fonttype": "none",  # text stays text: small files, sharp in print
    "font.size": 9,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 8,
}
WIDTH_IN = 5.0  # about the width of a phone, so that text keeps its size there
COAL, GANGUE, ACCENT, PALE = "#333333", "#b5651d", "#0b6e99", "#999999"
GREEN, ROSE, VIOLET, YELLOW = "#88b04b", "#c06c84", "#6c5b7b", "#f2b134"
RATIO_LABEL = "gangue mixing ratio, %"

#: Perceptually even maps that a colour-blind reader can follow: of stress and of damage, in figures and in the view.
STRESS_COLOURS, DAMAGE_COLOURS = "cividis", "inferno_r"


def styled(draw: Callable[Arguments, Figure]) -> Callable[Arguments, Figure]:
    """Run a drawing function with STYLE and leave matplotlib's own settings alone."""

    @functools.wraps(draw)
    def drawn(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Figure:
        with matplotlib.rc_context(STYLE):
            return draw(*args, **kwargs)

    return drawn


def canvas(
    rows: int, columns: int = 1, *, height_in: float, sharex: bool = False, sharey: bool = False
) -> tuple[Figure, np.ndarray]:
    """Return a figure of the report's width and its axes, shape (rows, columns)."""
    figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey)


def to_uri(figure: Figure, name: str) -> str:
    """Return the figure as a data URI of SVG, in which artists with thousands of shapes are images.

    name: of the figure; it makes the ids inside the SVG the same in every report.
    """
    with matplotlib.rc_context({**STYLE, "svg.hashsalt": name}):
        _lay_out(figure)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="svg", dpi=140, metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()


def _lay_out(figure: Figure) -> None:
    """Place the axes as an SVG has its text, and leave the figure without a layout engine: with one, even one that does
    nothing, `savefig` draws all of the figure twice."""
    FigureCanvasSVG(figure)
    figure.dpi = FigureCanvasSVG.fixed_dpi
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if not axis.get_label_text():  # its place would be sought from all tick labels, each time again
                axis.set_label_coords(0.5, 0.0)
    engine = figure.get_layout_engine()
    if engine is not None:
        for axes in figure.axes:
            axes.apply_aspect()
        engine.execute(figure)
        figure.set_layout_engine(None)


def to_picture_uri(figure: Figure) -> str:
    """Return the figure as a data URI of JPEG, for a picture of many shades."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="jpeg", dpi=130, pil_kwargs={"quality": 82})
    return "data:image/jpeg;base64," + base64.b64encode(buffer.getvalue()).decode()


def map_table(name: str) -> str:
    """Return a colour map as base64 of 256 times red, green, blue, for the page's view."""
    colours = np.rint(255 * matplotlib.colormaps[name](np.linspace(0, 1, 256))[:, :3])
    return base64.b64encode(colours.astype(np.uint8).tobytes()).decode()


def css_gradient(name: str) -> str:
    """Return a colour map as a gradient of CSS, for its scale in the page."""
    stops = matplotlib.colormaps[name](np.linspace(0, 1, 9))
    return f"linear-gradient(90deg, {', '.join(to_hex(stop) for stop in stops)})"


def material_colour(material: str) -> str:
    """Return the colour of gangue, or that of coal for anything else."""
    return GANGUE if material == "gangue" else COAL


def ratio_colour(ratio: float) -> tuple[float, float, float, float]:
    """Return the colour of a mixing ratio, dark blue (coal) to yellow-green (gangue), the same in every figure."""
    return matplotlib.colormaps["viridis"](0.93 * ratio)


def add_ratio_bar(figure: Figure, axes: np.ndarray) -> None:
    """Add the scale of `ratio_colour` beside axes."""
    colours = ListedColormap([ratio_colour(r) for r in np.linspace(0, 1, 101)])
    bar = figure.colorbar(ScalarMappable(Normalize(0, 100), colours), ax=axes, fraction=0.03, pad=0.02)
    bar.set_label(RATIO_LABEL)
    bar.outline.set_visible(False)


def hide_scales(axis: Axes) -> None:
    """Leave a picture without ticks and grid, with one scale in both directions."""
    axis.set_aspect("equal")
    axis.set_xticks([])
    axis.set_yticks([])
    axis.grid(False)
