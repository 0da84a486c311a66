"""A stream on the page: what fell, what the plate felt of it and the pieces."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pandas as pd

from analysis import RecordError, Run
from analysis.sweep.stream import By, true_ratio
from report.drawing.figure_spec import FinishedFigure
from report.stream.chapter import STREAM_FIGURES
from report.stream.heard import HEARD_FIGURES, was_heard
from report.stream.results import StreamResults
from report.tables import FinishedTable


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
        found = [(f"{len(here)} stones", f"{here['mass_kg'].sum():.3g} kg, in {self.results.end_s:.3g} s")]
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
