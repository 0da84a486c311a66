"""The numbers of a drawn figure as CSV, so that each picture of the report carries its data."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, PathCollection, QuadMesh
from matplotlib.figure import Figure

MAP_POINTS = 2500  # of a map in a figure of many; its picture has all of them
COLUMNS = ["panel", "series", "x", "y", "value"]


def to_csv(figure: Figure) -> str:
    """Return all curves, points, maps and discs of a figure, one row a point.

    panel: title of the axes, or its number. series: of a curve. x, y: in the units of the axes, which the first lines
    name. value: of a map or a disc.
    """
    tables, names = [], []
    for number, axis in enumerate(figure.axes, 1):
        found = _tables(axis)
        if not found:
            continue
        panel = axis.get_title(loc="left") or axis.get_title() or f"panel {number}"
        names.append(f"# {panel}: x = {axis.get_xlabel() or '-'}, y = {axis.get_ylabel() or '-'}")
        tables += [table.assign(panel=panel) for table in found]
    if not tables:
        return ",".join(COLUMNS) + "\n"
    rows = pd.concat(tables, ignore_index=True).reindex(columns=COLUMNS)
    return "\n".join(dict.fromkeys(names)) + "\n" + rows.to_csv(index=False, float_format="%.5g")


def _tables(axis: Axes) -> list[pd.DataFrame]:
    tables = []
    for number, line in enumerate(axis.get_lines(), 1):
        x, y = np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
        if x.size:
            label = str(line.get_label())
            name = f"line {number}" if label.startswith("_child") else label.removeprefix("_")
            tables.append(pd.DataFrame({"series": name, "x": x, "y": y}))
    for collection in axis.collections:
        if isinstance(collection, QuadMesh):
            tables.append(_map(collection))
        elif isinstance(collection, (EllipseCollection, PathCollection)):
            x, y = np.asarray(collection.get_offsets(), dtype=float).T
            values = collection.get_array()
            tables.append(pd.DataFrame({"series": "discs", "x": x, "y": y, "value": values}))
    return tables


def _map(mesh: QuadMesh) -> pd.DataFrame:
    """Return the values of a map at the middle of its cells, or at its nodes where it is shaded between them.

    Of a fine map every second or third point along either axis, so that it has at most about MAP_POINTS.
    """
    nodes: np.ndarray = np.asarray(mesh.get_coordinates())
    values: np.ndarray = np.ma.filled(np.ma.asarray(mesh.get_array(), dtype=float), np.nan)
    if values.size != nodes.shape[0] * nodes.shape[1]:
        nodes = 0.25 * (nodes[:-1, :-1] + nodes[1:, :-1] + nodes[:-1, 1:] + nodes[1:, 1:])
    every = max(1, int(np.ceil(np.sqrt(values.size / MAP_POINTS))))
    values = values.reshape(nodes.shape[:2])[::every, ::every]
    x, y = nodes[::every, ::every].reshape(-1, 2).T
    table = pd.DataFrame({"series": "map", "x": x, "y": y, "value": values.ravel()})
    return table[table["value"].notna()]
