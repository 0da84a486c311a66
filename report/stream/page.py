"""The page of streams: what fell, what the plate felt of it and the pieces, of each run of a directory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np
import pandas as pd

from analysis import RecordError, Run
from analysis.sweep.stream import By, true_ratio
from common.process.processes import side_by_side
from report.drawing.figure_spec import FinishedFigure, finish_figure
from report.stream.chapter import STREAM_FIGURES
from report.stream.heard import HEARD_FIGURES, was_heard
from report.stream.results import StreamResults
from report.tables import FinishedTable


@dataclass(frozen=True)
class StreamRun:
    """A run as the page shows it. numbers: value and words of each."""

    name: str
    title: str
    numbers: list[tuple[str, str]]
    figures: list[FinishedFigure]
    table: FinishedTable


def stream_runs(runs: list[Run]) -> list[StreamRun]:
    """Everything that the page shows of the runs. Raises RecordError where a run cannot be used."""
    results = [StreamResults(run) for run in runs]
    of_each = [STREAM_FIGURES + (HEARD_FIGURES if was_heard(r) else []) for r in results]
    specs = [(r, spec) for r, figures in zip(results, of_each, strict=True) for spec in figures]
    finished = iter(side_by_side(lambda k: _finish(*specs[k]), len(specs)))
    return [_stream_run(r, [next(finished) for _ in figures]) for r, figures in zip(results, of_each, strict=True)]


def _finish(results: StreamResults, spec: Any) -> FinishedFigure:
    figure = finish_figure(spec, results)
    return replace(figure, key=f"{results.run.path.name}-{figure.key}")


def _stream_run(results: StreamResults, figures: list[FinishedFigure]) -> StreamRun:
    stones, run = results.stones, results.run
    touched = stones["first_contact_s"].notna()
    here = stones[touched]
    numbers = [(f"{touched.sum()} stones", f"{here['mass_kg'].sum():.3g} kg, in {results.end_s:.3g} s")]
    try:
        by_mass, by_number = (true_ratio(stones, -np.inf, np.inf, by) for by in get_args(By))
        numbers.append((f"{100 * by_mass:.1f} %", f"gangue by mass; {100 * by_number:.1f} % by number"))
    except RecordError as reason:
        numbers.append(("-", f"gangue: {reason}"))
    numbers.append((f"{1e-3 * run.peak('force_N'):.2f} kN", "largest force on the plate"))
    return StreamRun(run.path.name, f"{run.path.name}: {run.scene.name or 'stream'}", numbers, figures,
                     FinishedTable(f"{run.path.name}-stones", "Stones", _closure(run), *_cells(results, here)))


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
    chips = results.left["is_chip"]
    of_chips = f"{results.left['mass_kg'][chips].sum():.4g}"
    rows.append(["of it small fragments", str(chips.sum()), "", "", "", "", of_chips, ""])
    return header, rows
