"""The page of a stream: what the plate felt, what fell over time, and its pieces."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pandas as pd

from analysis import RecordError, Run
from analysis.sweep.runs import By, true_ratio
from common.channels import ACCELEROMETERS
from report.drawing.figure_spec import Drawn, FigureSpec, FinishedFigure
from report.drawing.lines import envelope
from report.stream import figures
from report.stream.heard import HEARD_FIGURES, was_heard
from report.stream.results import StreamResults
from report.tables import FinishedTable

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


class StreamRun:
    """Numbers, figures and table of one run. Raises RecordError where it cannot be used."""

    def __init__(self, run: Run):
        self.results = StreamResults(run)
        self.specs = (HEARD_FIGURES if was_heard(self.results) else []) + STREAM_FIGURES

    def keyed(self, figures: list[FinishedFigure]) -> list[FinishedFigure]:
        """Figures whose keys begin with the name of the run."""
        return [replace(figure, key=f"{self.results.run.path.name}-{figure.key}") for figure in figures]

    def numbers(self) -> list[tuple[str, str]]:
        """Value and words of each number of the first screen."""
        stones, run = self.results.stones, self.results.run
        here = stones[stones["first_contact_s"].notna()]
        found = [(f"{len(here)} stone{'s' * (len(here) != 1)}",
                  f"{here['mass_kg'].sum():.3g} kg, in {self.results.end_s:.3g} s")]
        try:
            by_mass, by_number = (true_ratio(stones, -np.inf, np.inf, by) for by in get_args(By))
            found.append((f"{100 * by_mass:.1f} %", f"gangue by mass; {100 * by_number:.1f} % by number"))
        except RecordError as reason:
            found.append(("-", f"gangue: {reason}"))
        return [*found, (f"{1e-3 * run.peak('force_N'):.2f} kN", "largest force on the plate")]

    def table(self) -> FinishedTable:
        """The stones that came, by their material."""
        stones, run = self.results.stones, self.results.run
        cells = _cells(self.results, stones[stones["first_contact_s"].notna()])
        return FinishedTable(f"{run.path.name}-stones", "Stones", _closure(run), *cells)


def _closure(run: Run) -> str:
    energy, wall = run.summary.energy or {}, run.summary.wall_time_s
    took = f" The run took {sum(wall.values()):.0f} s." if wall else ""
    return f"Energy closes to {energy['closure']:.2g} of what came in.{took}" if "closure" in energy else took.strip()


def _cells(results: StreamResults, here: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    header = ["", "stones", "mass, kg", "mean diameter, mm", "largest force, kN", "broken area, cm²",
              "left the plate, kg", "still there, kg"]
    rows = []
    for name, own in (("coal", here[~here["is_gangue"]]), ("gangue", here[here["is_gangue"]]), ("all", here)):
        mass, left = own["mass_kg"].sum(), own["left_mass_kg"].sum()
        most = own["peak_force_N"].max() if len(own) else 0.0
        size = own["radius_m"].mean() if len(own) else 0.0
        rows.append([name, str(len(own)), f"{mass:.4g}", f"{2e3 * size:.1f}", f"{1e-3 * most:.2f}",
                     f"{1e4 * own['broken_area_m2'].sum():.3g}", f"{left:.4g}", f"{mass - left:.4g}"])
    table = results.left
    chips = table["mass_kg"][table["is_chip"] & table["agglomerate"].isin(here["stone"])]
    rows.append(["of it small fragments", str(len(chips)), "", "", "", "", f"{chips.sum():.4g}", ""])
    return header, rows
