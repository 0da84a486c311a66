"""The page of a sweep: report.html with everything inside it, and claims.csv beside it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from analysis import Sweep, read_sweep
from common.files import write_text
from common.output_directory import refuse_foreign_file
from common.resources import resource
from report import tables
from report.chapters.breakage import BREAKAGE_FIGURES
from report.chapters.evaluation import EVALUATION_FIGURES
from report.chapters.figure_spec import FigureSpec, FinishedFigure, finish_figure
from report.chapters.recognition import RECOGNITION_FIGURES
from report.chapters.response import RESPONSE_FIGURES
from report.chapters.signals import SIGNAL_FIGURES
from report.chapters.theory import THEORY_FIGURES
from report.claims.breakage import BREAKAGE_STATEMENTS
from report.claims.recognition import RECOGNITION_STATEMENTS
from report.claims.response import RESPONSE_STATEMENTS
from report.claims.signals import SIGNAL_STATEMENTS
from report.claims.theory import THEORY_STATEMENTS
from report.claims.trends import falling_steps, spearman
from report.claims.verdicts import VERDICTS, Claim, check_statements, to_csv
from report.results.missing import MISSING_RESULT
from report.results.sweep_results import SweepResults
from report.tables import FinishedTable, TableSpec, finish_table

TEMPLATES = resource("templates")
GENERATOR = 'name="generator" content="coal-gangue-impact"'  # by which the template says who wrote the page

#: Title, figures and tables of each chapter, in order.
CHAPTERS: list[tuple[str, list[FigureSpec], list[TableSpec]]] = [
    ("Theory", THEORY_FIGURES, [tables.MATERIALS]),
    ("Breakage", BREAKAGE_FIGURES, []),
    ("Response of the plate", RESPONSE_FIGURES, []),
    ("Signals", SIGNAL_FIGURES, [tables.EMD_RULES, tables.STANDARDISED]),
    ("Recognition", RECOGNITION_FIGURES, [tables.DEVIATIONS, tables.RECOGNISED, tables.CHOICES]),
    ("Runs not trained on", EVALUATION_FIGURES, [tables.UNSEEN]),
]

#: All statements of the paper, in its order.
STATEMENTS = [
    *THEORY_STATEMENTS,
    *BREAKAGE_STATEMENTS,
    *RESPONSE_STATEMENTS,
    *SIGNAL_STATEMENTS,
    *RECOGNITION_STATEMENTS,
]


@dataclass(frozen=True)
class Chapter:
    """A chapter as the page shows it."""

    title: str
    figures: list[FinishedFigure]
    tables: list[FinishedTable]


@dataclass(frozen=True)
class Rise:
    """Whether a quantity rises with the ratio.

    falls_at: pairs of neighbouring ratios between which it falls. first, last: its values at the lowest and the highest
    ratio, as text.
    """

    name: str
    spearman: float
    falls_at: list[tuple[float, float]]
    first: str
    last: str

    @property
    def in_words(self) -> str:
        if self.spearman >= 0.9:
            return "rises as a whole" if self.falls_at else "rises"
        return "rises weakly" if self.spearman >= 0.5 else "does not rise"


def write_report(directory: str | Path) -> Path:
    """Write report.html and claims.csv into a directory of runs, each whole or not at all.

    Returns the path of the report. Raises RecordError or RecognitionError, with a message of one line, where the runs
    cannot be used, and OSError where the files cannot be written.
    """
    file = Path(directory) / "report.html"
    refuse_foreign_file(file, GENERATOR, "<title>Coal and gangue")  # the title is that of earlier versions
    refuse_foreign_file(file.with_name("claims.csv"), "claim,where,verdict")
    results = SweepResults(read_sweep(directory))
    claims = check_statements(results, STATEMENTS)
    write_text(file.with_name("claims.csv"), to_csv(claims))
    write_text(file, render(results, claims))
    return file


def render(results: SweepResults, claims: list[Claim]) -> str:
    """Return the page as HTML."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    counts = Counter(claim.verdict for claim in claims)
    return environment.get_template("report.html.j2").render(
        sweep=results.sweep,
        rises=rises(results),
        claims=claims,
        verdicts=[(verdict, counts[verdict]) for verdict in VERDICTS],
        chapters=[finish_chapter(results, *chapter) for chapter in CHAPTERS],
        errors=finish_table(tables.ERRORS, results),
        runs=finish_table(tables.RUNS, results),
        assumptions=assumptions(results.sweep),
    )


def finish_chapter(
    results: SweepResults, title: str, figures: list[FigureSpec], chapter_tables: list[TableSpec]
) -> Chapter:
    """Draw the figures and build the tables of one chapter."""
    finished = [finish_figure(spec, results) for spec in figures]
    return Chapter(title, finished, [finish_table(spec, results) for spec in chapter_tables])


def rises(results: SweepResults) -> list[Rise]:
    """Return whether the three main quantities rise with the ratio, as far as the runs have them; nothing for a single
    run."""
    if len(results.runs) < 2:
        return []
    quantities: list[tuple[str, Callable[[], np.ndarray], str]] = [
        ("peak total force", lambda: 1e-3 * results.sweep.peaks("force_N"), "kN"),
        ("peak kinetic energy of the plate", lambda: results.response.peaks["kinetic_J"], "J"),
        ("RMS of the plate's acceleration", lambda: results.signals.parameters["rms"], "m/s²"),
    ]
    found = []
    for name, values_of, unit in quantities:
        try:
            values = values_of()
        except MISSING_RESULT:
            continue
        found.append(Rise(name, spearman(results.ratios, values), falling_steps(results.ratios, values),
                          f"{values[0]:.4g}", f"{values[-1]:.4g} {unit}"))
    return found


def assumptions(sweep: Sweep) -> list[str]:
    """Return the assumptions of the scenes as lines, each once and in order, with the values of the scene."""
    lines: dict[str, None] = {}
    for run in sweep.runs:
        found = run.summary.assumptions
        found = [f"{key}: {value}" for key, value in found.items()] if isinstance(found, dict) else found
        scene = run.scene.as_json()
        lines.update(dict.fromkeys(_with_value(str(line), scene) for line in found))
    return list(lines)


def _with_value(line: str, scene: dict[str, Any]) -> str:
    """Return `plate.length_m` as `plate.length_m = 0.5`, and any line that is no single value of the scene as it is."""
    value = scene
    for key in line.split("."):
        if not isinstance(value, dict) or key not in value:
            return line
        value = value[key]
    return line if isinstance(value, (dict, list)) else f"{line} = {value}"
