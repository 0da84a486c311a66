"""The numbers of a drawn figure as CSV, so that each picture of the report carries its data."""

import json
from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, PathCollection, QuadMesh
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

MAP_POINTS = 2500  # of a map in a figure of many; its picture has all of them

#: Name of a curve, or what else it is, and its x, y and, where it has them, values.
Series = tuple[str, list[np.ndarray]]


def to_csv(figure: Figure) -> str:
    """All curves, points, maps and discs of a figure, one row a point. panel: title of the axes, or its number. x, y:
    in the units of the axes, which the first lines name. value: of a map or a disc."""
    names, rows = [], []
    for number, axis in enumerate(figure.axes, 1):
        panel = axis.get_title(loc="left") or axis.get_title() or f"panel {number}"
        found = [_rows(panel, name, columns) for name, columns in _series(axis)]
        if found:
            names.append(f"# {panel}: x = {axis.get_xlabel() or '-'}, y = {axis.get_ylabel() or '-'}\n")
        rows += found
    return "".join([*dict.fromkeys(names), "panel,series,x,y,value\n", *rows])


def panels(figure: Figure) -> str:
    """Where the axes of a laid out figure are and what their lines are, as JSON for the page's values and zoom: `box`
    left, top, width and height as shares of the figure; of each line name, colour and number of rows in `to_csv`."""
    found = []
    for axis in figure.axes:
        axis.apply_aspect()
        place, rows = axis.get_position(), [(name, len(columns[0])) for name, columns in _series(axis)]
        lines = [line for line in axis.get_lines() if np.size(line.get_xdata())]
        found.append({
            "box": np.round([place.x0, 1 - place.y1, place.width, place.height], 4).tolist(),
            "x": _digits(axis.get_xlim()), "y": _digits(axis.get_ylim()),
            "log": [axis.get_xscale() == "log", axis.get_yscale() == "log"], "labels": [axis.get_xlabel(), ""],
            "lines": [[name, to_hex(line.get_color()), count, line.get_drawstyle() != "default"]
                      for line, (name, count) in zip(lines, rows, strict=False)],
            "skip": sum(count for _, count in rows[len(lines):])})
    return json.dumps(found, separators=(",", ":"))


def _digits(ends: tuple[float, float]) -> list[float]:
    return [float(f"{end:.6g}") for end in ends]


def _rows(panel: str, name: str, columns: list[np.ndarray]) -> str:
    """Rows with five digits; a number that is none is left out. One format for all rows at once: a table of pandas
    takes ten times as long."""
    beginning = f"{_quoted(panel)},{_quoted(name)},".replace("%", "%%")
    row = beginning + ",".join(["%.5g"] * len(columns)) + "," * (3 - len(columns)) + "\n"
    numbers = np.column_stack(columns)
    text = row * len(numbers) % tuple(numbers.ravel().tolist())
    return text.replace(",nan", ",") if np.isnan(numbers).any() else text


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',"\n') else text


def _series(axis: Axes) -> Iterator[Series]:
    for number, line in enumerate(axis.get_lines(), 1):
        x, y = np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
        if x.size:
            label = str(line.get_label())
            yield f"line {number}" if label.startswith("_child") else label.removeprefix("_"), [x, y]
    for image in axis.images:
        yield "map", _shown(*_pixels(image))
    for collection in axis.collections:
        if isinstance(collection, QuadMesh):
            yield "map", _shown(*_cells(collection))
        elif isinstance(collection, (EllipseCollection, PathCollection)):
            places, values = np.asarray(collection.get_offsets(), dtype=float).T, collection.get_array()
            yield "discs", [*places, *([] if values is None else [np.asarray(values)])]


def _cells(mesh: QuadMesh) -> tuple[np.ndarray, np.ndarray]:
    """Middles (rows, columns, 2) of the cells of a map, and their values."""
    nodes: np.ndarray = np.asarray(mesh.get_coordinates())
    return (0.25 * (nodes[:-1, :-1] + nodes[1:, :-1] + nodes[:-1, 1:] + nodes[1:, 1:]),
            np.ma.filled(np.ma.asarray(mesh.get_array(), dtype=float), np.nan))


def _pixels(image: AxesImage) -> tuple[np.ndarray, np.ndarray]:
    """The same of a picture whose first row is the lowest."""
    values: np.ndarray = np.ma.filled(np.ma.asarray(image.get_array(), dtype=float), np.nan)
    left, right, bottom, top = image.get_extent()
    x, y = (first + (np.arange(count) + 0.5) * (last - first) / count
            for first, last, count in ((left, right, values.shape[1]), (bottom, top, values.shape[0])))
    middles = np.stack(np.meshgrid(x, y), axis=-1)
    return np.round(middles / (right - left), 12) * (right - left) + 0.0, values  # rounding errors of 0 are no places


def _shown(middles: np.ndarray, values: np.ndarray) -> list[np.ndarray]:
    """Return x, y and values of a map. Of a fine one every second or third point along either axis, so that it has at
    most about MAP_POINTS."""
    every = max(1, int(np.ceil(np.sqrt(values.size / MAP_POINTS))))
    known = values[::every, ::every].ravel()
    x, y = middles[::every, ::every].reshape(-1, 2).T
    return [column[~np.isnan(known)] for column in (x, y, known)]
