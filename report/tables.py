"""Tables of the report: Tables 1 to 3 of the paper from our data, the answers of recognition, and the runs."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.signals.features import BASE_PARAMETERS
from report.film.packing import pack_text
from report.missing import MISSING_RESULT
from report.recognition.results import MODEL_METHODS
from report.sweep_results import SweepResults

#: A space at which "3 of 11" does not break into two lines.
NO_BREAK = "\u00a0"


#: The header, and rows of text of which the first column names the row.
Cells = tuple[list[str], list[list[str]]]


@dataclass(frozen=True)
class TableSpec:
    """A table to build. key: its id in the page. build: gives its cells from the results of a sweep."""

    key: str
    title: str
    note: str
    build: Callable[[SweepResults], Cells]


@dataclass(frozen=True)
class FinishedTable:
    """A table as the page shows it; without rows where the runs do not give it, and the note then says why."""

    key: str
    title: str
    note: str
    header: list[str]
    rows: list[list[str]]

    @property
    def csv(self) -> str:
        """The packed CSV of the table."""
        buffer = io.StringIO()
        csv.writer(buffer, lineterminator="\n").writerows([self.header, *self.rows])
        return pack_text(buffer.getvalue())


def finish_table(spec: TableSpec, results: SweepResults) -> FinishedTable:
    """Build one table, or an empty one that says why the runs do not give it."""
    try:
        header, rows = spec.build(results)
    except MISSING_RESULT as reason:
        return FinishedTable(spec.key, spec.title, f"Not given: {reason}", [], [])
    return FinishedTable(spec.key, spec.title, spec.note, header, rows)


def materials(results: SweepResults) -> Cells:
    """Return the elastic parameters of coal, gangue and plate, from the scene."""
    setup = results.theory.setup
    rows = [
        [name, f"{m.density_kg_m3:g}", f"{1e-9 * m.youngs_modulus_Pa:g}", f"{m.poisson_ratio:g}"]
        for name, m in {**setup.rocks, "plate": setup.plate}.items()
    ]
    header = ["", "density, kg/m³", "E, GPa", "Poisson's ratio"]
    return header, rows


def standardised(results: SweepResults) -> Cells:
    """Return the eight base parameters by Eq. 39, a row a parameter."""
    values, falling = results.recognition.standardised_base
    rows = [
        [name.replace("_", " ") + (" (falling)" if falls else ""), *(f"{v:.4f}" for v in column)]
        for name, falls, column in zip(BASE_PARAMETERS, falling, values.T, strict=True)
    ]
    return ["", *_percent(results.ratios)], rows


def deviations(results: SweepResults) -> Cells:
    """Return Q of each run beside the quadratic through all of them."""
    measured = results.recognition.q
    calculated = results.recognition.q_quadratic(results.ratios)
    named = {"measured": measured, "calculated": calculated, "difference": calculated - measured}
    rows = [[name, *(f"{v:.5f}" for v in values)] for name, values in named.items()]
    return ["", *_percent(results.ratios)], rows


def recognised(results: SweepResults) -> Cells:
    """Return the recognised ratio of each run, for both trainings."""
    answers = results.recognition.answers
    header = ["true", *(f"{name}, {training}" for training in answers for name in MODEL_METHODS.values())]
    rows = []
    for i, true in enumerate(_percent(results.ratios)):
        cells = [rows_of_training[i][method] for rows_of_training in answers.values() for method in MODEL_METHODS]
        rows.append([true, *("no answer" if c.reason else f"{100 * c.ratio:.2f}" for c in cells)])
    return header, rows


def errors(results: SweepResults) -> Cells:
    """Return mean and worst error of each method and training, in points of mixing ratio."""
    rows = [
        [name, training, *_error_cells(results.recognition.errors_points(training, method), len(results.runs))]
        for training in results.recognition.answers
        for method, name in MODEL_METHODS.items()
    ]
    return ["method", "training", "answered", "mean", "worst"], rows


def _or_dash(count: int | None) -> str:
    return "-" if count is None else str(count)


def runs(results: SweepResults) -> Cells:
    """Return sizes, peaks and wall time of each run."""
    peaks, rows = results.response.peaks, []
    for i, run in enumerate(results.runs):
        summary = run.summary
        rows.append([
            f"{100 * run.gangue_ratio:.0f} %",
            _or_dash(summary.n_particles),
            _or_dash(summary.n_bonds),
            _or_dash(summary.n_bonds_broken),
            f"{1e-3 * peaks['force_N'][i]:.2f}",
            f"{peaks['kinetic_J'][i]:.4g}",
            f"{results.signals.parameters['rms'][i]:.4g}",
            f"{sum(summary.wall_time_s.values()):.1f}",
        ])  # fmt: skip
    header = ["ratio", "particles", "bonds", "broken", "peak force, kN", "peak kinetic, J", "RMS, m/s²",
              "wall time, s"]  # fmt: skip
    return header, rows


def _percent(ratios: np.ndarray) -> list[str]:
    return [f"{100 * r:.0f} %" for r in ratios]


def _of(answered: int, count: int) -> str:
    return f"{answered}{NO_BREAK}of{NO_BREAK}{count}"


def _error_cells(errors_points: np.ndarray, count: int) -> list[str]:
    """Return how many of `count` runs were answered, and the mean and the worst error."""
    size = np.abs(errors_points)
    numbers = [f"{size.mean():.2f}", f"{size.max():.2f}"] if size.size else ["-", "-"]
    return [_of(size.size, count), *numbers]


MATERIALS = TableSpec("table-1", "Elastic parameters (Table 1)", "", materials)
STANDARDISED = TableSpec("table-2", "Standardised parameters (Table 2)", (
    "Standardised by Eq. 39; the direction of each parameter is that of these runs, not the paper's."), standardised)
DEVIATIONS = TableSpec("table-3", "Q and its quadratic (Table 3)",
                       "The paper's differences reach from 0.006 to 0.046, to both sides.", deviations)
RECOGNISED = TableSpec("table-recognised", "Recognised mixing ratio of each run",
                       "In per cent; not clipped to 0..100. Held out: 0 and 100 % are extrapolations.", recognised)
ERRORS = TableSpec("table-errors", "Errors of recognition", (
    "Points of mixing ratio. Trained on all: the run itself was in the training, so it tells how well a method"
    " describes its own data. That ratio held out: trained on the other ratios."), errors)
RUNS = TableSpec("table-runs", "Runs", "", runs)
