"""The look of all figures, and how a figure gets into the page."""

import base64
import io
from collections.abc import Iterable
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize, to_hex
from matplotlib.figure import Figure

STYLE: Any = {
    "svg.fonttype": "none",  # text stays text: small files, sharp in print
    "font.size": 9,  # no text is smaller: on a phone it would be unreadable
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), "#1c1e21"),
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # else the texts of the axis below are laid out once more to find it
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "legend.labelspacing": 0.3,
    "axes.formatter.limits": (-5, 5),  # beyond, a power of ten stands above, where there is no room
}
WIDTH_IN = 5.0  # about the width of a phone, so that text keeps its size there
COAL, GANGUE, ACCENT, PALE = "#333333", "#b5651d", "#0b6e99", "#999999"
INK = "#1c1e21"  # of text and axes
#: What stands for dark colours where the reader's system is dark.
DARK = {INK: "#d5d9de", COAL: "#b9bec6", ACCENT: "#4fb3de", GANGUE: "#d98d45", "#000000": "#ffffff",
        "#dddddd": "#3a3f45", "#eef1f3": "#2a2f35"}
GREEN, ROSE, VIOLET, YELLOW = "#88b04b", "#c06c84", "#6c5b7b", "#f2b134"
RATIO_LABEL = "gangue mixing ratio, %"

#: Perceptually even maps that a colour-blind reader can follow: of stress and of damage, in figures and in the view.
STRESS_COLOURS, DAMAGE_COLOURS = "cividis", "inferno_r"


def canvas(rows: int, columns: int = 1, *, height_in: float, sharex: bool = False, sharey: bool = False,
           bar: str = "") -> tuple[Figure, np.ndarray]:
    """A figure of the report's width and its axes (rows, columns). bar: room at the "right" or the "bottom" for a
    colour scale, whose axes `bar_axes` gives."""
    figure = Figure(figsize=(WIDTH_IN, height_in))
    figure.set_gid(bar or "whole")
    return figure, figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey)


def single(height_in: float, bar: str = "") -> tuple[Figure, Axes]:
    """A `canvas` with one pair of axes."""
    figure, axes = canvas(1, height_in=height_in, bar=bar)
    return figure, axes[0, 0]


def bar_axes(figure: Figure) -> Axes:
    """Axes for the colour scale for which `canvas` left room."""
    axes = figure.add_axes((0.0, 0.0, 0.1, 0.1), label="bar")
    axes.grid(False)
    return axes


def to_uri(figure: Figure, name: str) -> str:
    """The figure as a data URI of SVG, in which artists with thousands of shapes are images. name: makes the ids inside
    the same in every report."""
    with matplotlib.rc_context({**STYLE, "svg.hashsalt": name}):
        lay_out(figure)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="svg", dpi=140, metadata={"Date": None})
    dark = "".join(f'[style*="{kind}: {light}"]{{{kind}:{dark}!important}}' for light, dark in DARK.items()
                   for kind in ("stroke", "fill"))
    style = f"<style>@media (prefers-color-scheme: dark){{{dark}}}</style></svg>"
    svg = buffer.getvalue().replace(b"</svg>", style.encode())
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode()


# Room for texts of 9 points, in inches. Seeking it from the texts themselves would take longer than drawing.
TICKS_BESIDE, TICKS_BELOW, LABEL, TITLE, GAP = 0.54, 0.23, 0.2, 0.22, 0.1
BAR_RIGHT, BAR_BELOW, BAR = 0.7, 0.56, 0.12


def lay_out(figure: Figure) -> None:
    """Place the axes of a `canvas`, with as much room as their texts take."""
    width, height = figure.get_size_inches()
    bar = figure.get_gid()
    grid = {(cell.rowspan.start, cell.colspan.start): axes for axes in figure.axes
            if (cell := axes.get_subplotspec()) is not None}
    if not grid:
        return
    rows, columns = 1 + max(row for row, _ in grid), 1 + max(column for _, column in grid)
    seen = {place: axes for place, axes in grid.items() if axes.get_visible() and axes.axison}
    beside, below, above = np.zeros(columns), np.zeros(rows), np.full(rows, 0.05)
    for (row, column), axes in seen.items():
        beside[column] = max(beside[column], _room_beside(axes))
        below[row] = max(below[row], _room_below(axes))
        if axes.get_title(loc="left"):
            above[row] = TITLE
    cell_width = (width - GAP * columns - sum(beside) - (BAR_RIGHT if bar == "right" else 0)) / columns
    cell_height = (height - sum(below) - sum(above) - (BAR_BELOW if bar == "bottom" else 0)) / rows
    for (row, column), axes in grid.items():
        left = sum(beside[:column + 1]) + column * (cell_width + GAP)
        top = height - sum(above[:row + 1]) - sum(below[:row]) - row * cell_height
        axes.set_position((left / width, (top - cell_height) / height, cell_width / width, cell_height / height))
    first, last = beside[0], width - GAP - (BAR_RIGHT if bar == "right" else 0)
    foot, head = (BAR_BELOW if bar == "bottom" else 0) + below[-1], height - above[0]
    for axes in figure.axes:
        if axes.get_label() == "bar" and bar == "right":
            axes.set_position(((last + 0.12) / width, foot / height, BAR / width, (head - foot) / height))
        elif axes.get_label() == "bar":
            axes.set_position((first / width, 0.42 / height, (last - first) / width, BAR / height))


def _room_beside(axes: Axes) -> float:
    shown = axes.yaxis.get_tick_params().get("labelleft", True) and len(axes.get_yticks())
    return (TICKS_BESIDE if shown else 0.15) + (LABEL if axes.get_ylabel() else 0.0)


def _room_below(axes: Axes) -> float:
    shown = axes.xaxis.get_tick_params().get("labelbottom", True) and len(axes.get_xticks())
    return (TICKS_BELOW if shown else 0.05) + (LABEL if axes.get_xlabel() else 0.0)


def to_picture_uri(figure: Figure) -> str:
    """Return the figure as a data URI of WebP, for a picture of many shades on any ground."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="webp", dpi=130, pil_kwargs={"quality": 82})
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()


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


def ratio_colours(ratios: Iterable[float]) -> list[Any]:
    """Return the colour of each mixing ratio; one alone has that of any curve."""
    found = [ratio_colour(ratio) for ratio in ratios]
    return found if len(found) > 1 else [ACCENT]


def add_ratio_bar(figure: Figure) -> None:
    """Add the scale of `ratio_colour` to a canvas with room at its right."""
    colours = ListedColormap([ratio_colour(r) for r in np.linspace(0, 1, 101)])
    bar = figure.colorbar(ScalarMappable(Normalize(0, 100), colours), cax=bar_axes(figure))
    bar.set_label(RATIO_LABEL)
    bar.outline.set_visible(False)


def legend_above(axis: Axes, share: float = 0.4, **settings: Any) -> None:
    """Add a legend in a room of its own above the curves, which takes a `share` of the height."""
    low, high = axis.get_ylim()
    axis.set_ylim(low, low + (high - low) / (1 - share))
    axis.legend(loc="upper left", **settings)


def hide_scales(axis: Axes) -> None:
    """Leave a picture without ticks and grid, with one scale in both directions."""
    axis.set_aspect("equal")
    axis.set_xticks([])
    axis.set_yticks([])
    axis.grid(False)
