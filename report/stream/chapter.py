"""The page of a stream: what the plate felt, what fell over time, and its pieces."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis import RecordError
from analysis.sweep.runs import true_ratio
from common.channels import ACCELEROMETERS
from report.drawing.figure_spec import Drawn, FigureSpec
from report.drawing.lines import envelope
from report.stream import figures
from report.stream.results import StreamResults

POINTS = 2400  # of a curve


def felt(results: StreamResults) -> Drawn:
    table = results.run.signals if results.run.fast is None else results.run.fast
    sensors = [name for name in table.columns if name.startswith(ACCELEROMETERS)][:1]
    wanted = [("force on the plate, kN", "force_N", 1e-3),
              ("acceleration of the plate's centre of mass, m/s²", "a_m_s2", 1.0),
              *((f"acceleration at {name[4:-5]}, m/s²", name, 1.0) for name in sensors)]
    t_s = table["t_s"].to_numpy()
    panels = []
    for label, column, unit in wanted:
        if column in table.columns:
            times, values = envelope(t_s, table[column].to_numpy(), POINTS)
            panels.append((label, (times, unit * values)))
    return figures.felt(panels, results.touched)


def fell(results: StreamResults) -> Drawn:
    ends_s, ratios = results.sliding_ratio()
    whole = true_ratio(results.touched, -np.inf, np.inf)
    return figures.fell(results.touched, ends_s, ratios, whole), f"Window: {results.window_s:g} s."


def hits(results: StreamResults) -> Drawn:
    return figures.hits(results.touched)


def pieces(results: StreamResults) -> Drawn:
    events, stones, left = results.run.breakage, results.stones, results.left
    gangue = stones["is_gangue"].to_numpy()[events["agglomerate"].to_numpy(dtype=int) - 1]
    area = {}
    for name in figures.KINDS:
        own = events[gangue == (name == "gangue")]
        area[name] = (_steps(own["t_s"], results.end_s), _grown(1e4 * own["area_m2"]))
    gone = {}
    for name, chips in (("over the edge", False), ("small fragments", True)):
        own = left[left["is_chip"] == chips]
        gone[name] = (_steps(own["t_s"], results.end_s), _grown(own["mass_kg"]))
    try:
        return figures.pieces(area, gone, results.piece_masses_kg)
    except RecordError as reason:
        return figures.pieces(area, gone, None), f"Sizes not drawn: {reason}."


def _steps(t_s: pd.Series, end_s: float) -> np.ndarray:
    return np.concatenate([[0.0], t_s.to_numpy(), [end_s]])


def _grown(values: pd.Series) -> np.ndarray:
    total = np.concatenate([[0.0], np.cumsum(values.to_numpy())])
    return np.append(total, total[-1])


STREAM_FIGURES = [
    FigureSpec("stream-felt", "What the plate felt", "Fast stream. Ticks: first touch of each stone.", felt),
    FigureSpec("stream-fell", "What fell", "A stone counts from its first touch.", fell),
    FigureSpec("stream-hits", "How hard each stone hit",
               "Largest force of each stone, and what broke of it until the end.", hits),
    FigureSpec("stream-pieces", "The pieces",
               "Bonds that broke, what left the plate, and the pieces at the end of all stones that touched it.",
               pieces),
]
