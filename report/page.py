"""The page of a sweep: report.html with everything inside it, and claims.csv beside it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup

from analysis import Sweep, read_sweep
from analysis.sweep.stream import is_stream
from common.files.output_directory import is_stamped, refuse_foreign_file, stamped
from common.files.whole import write_text
from common.resources import resource
from report import tables, variation
from report.breakage.chapter import BREAKAGE_FIGURES
from report.breakage.claims import BREAKAGE_STATEMENTS
from report.drawing.figure_spec import FigureSpec, FinishedFigure
from report.drawing.style import DAMAGE_COLOURS, STRESS_COLOURS, css_gradient, map_table, to_picture_uri
from report.film.reel import Films
from report.film.still import still
from report.film.still_scene import still_scene
from report.missing import MISSING_RESULT
from report.parts import Parts, Spec, make_parts
from report.recognition.chapter import ANSWER, RECOGNITION_FIGURES
from report.recognition.claims import RECOGNITION_STATEMENTS
from report.recognition.results import HELD_OUT
from report.response.chapter import RESPONSE_FIGURES
from report.response.claims import RESPONSE_STATEMENTS
from report.signals.chapter import SIGNAL_FIGURES
from report.signals.claims import SIGNAL_STATEMENTS
from report.stream.page import stream_runs
from report.sweep_results import SweepResults
from report.tables import FinishedTable, TableSpec, finish_table
from report.theory.chapter import THEORY_FIGURES
from report.theory.claims import THEORY_STATEMENTS
from report.trends import falling_steps, spearman
from report.verdicts import HELD, VERDICTS, to_csv

TEMPLATES = resource("templates")

#: Title, figures and tables of each chapter, in order.
CHAPTERS: list[tuple[str, list[FigureSpec], list[TableSpec]]] = [
    ("Theory", THEORY_FIGURES, [tables.MATERIALS]),
    ("Breakage", BREAKAGE_FIGURES, [variation.ONE_STONE]),
    ("Response of the plate", RESPONSE_FIGURES, []),
    ("Signals", SIGNAL_FIGURES, [tables.STANDARDISED]),
    ("Recognition", RECOGNITION_FIGURES, [tables.ERRORS, tables.DEVIATIONS, tables.RECOGNISED]),
    ("With stones that vary", [], [variation.VARYING]),
]

#: Of whose scene alone the page says what the paper states.
PAPER = "paper"

#: All statements of the paper, in its order, those of a chapter together; the last are of the recognised ratios.
STATEMENTS = [THEORY_STATEMENTS, BREAKAGE_STATEMENTS, RESPONSE_STATEMENTS, SIGNAL_STATEMENTS, RECOGNITION_STATEMENTS]


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


@dataclass(frozen=True)
class Number:
    """One of the numbers of the first screen, and what it says in a few words."""

    value: str
    words: str


def write_report(directory: str | Path) -> Path:
    """Write report.html into a directory of runs, and of the paper's scene claims.csv, each whole or not at all. Of
    streams it is the page of what fell (report/stream/page.py).

    Returns the path of the report. Raises RecordError or RecognitionError, with a message of one line, where the runs
    cannot be used, and OSError where the files cannot be written.
    """
    file = Path(directory) / "report.html"
    refuse_foreign_file(file, is_stamped)
    sweep = read_sweep(directory)
    if all(is_stream(run) for run in sweep.runs):
        write_text(file, stamped(render_streams(sweep)))
        return file
    refuse_foreign_file(file.with_name("claims.csv"), is_stamped)
    results = SweepResults(sweep)
    parts = _parts(results)
    parts = replace(parts, claims=[replace(c, value=local(c.value, results.sweep)) for c in parts.claims])
    if parts.claims:
        write_text(file.with_name("claims.csv"), stamped(to_csv(parts.claims), "# {}"))
    write_text(file, stamped(render(results, parts)))
    return file


def _parts(results: SweepResults) -> Parts:
    chapters = chapters_of(results)
    longest_first: list[Spec] = [table for _, _, chapter_tables in chapters for table in chapter_tables]
    specs = [*longest_first, ANSWER, *(figure for _, figures, _ in chapters for figure in figures)]
    return make_parts(results, specs, STATEMENTS if _is_of_paper(results) else [[]])


def _is_of_paper(results: SweepResults) -> bool:
    return all(run.scene.name == PAPER for run in results.runs)


def chapters_of(results: SweepResults) -> list[tuple[str, list[FigureSpec], list[TableSpec]]]:
    """Return the chapters of a sweep; draws of stones that vary stand beside the paper's scene alone."""
    return [chapter for chapter in CHAPTERS if _is_of_paper(results) or variation.VARYING not in chapter[2]]


def render(results: SweepResults, parts: Parts) -> str:
    """Return the page as HTML."""
    claims = parts.claims
    counts = Counter(claim.verdict for claim in claims)
    return _environment(results.sweep).get_template("report.html.j2").render(
        name=results.sweep.path.resolve().name,
        sweep=results.sweep,
        answer=parts.finished[ANSWER.key],
        numbers=numbers(results, counts),
        rises=rises(results),
        claims=claims,
        verdicts=[(verdict, counts[verdict]) for verdict in VERDICTS],
        chapters=[Chapter(title, [parts.finished[spec.key] for spec in figures],
                          [parts.finished[spec.key] for spec in chapter_tables])
                  for title, figures, chapter_tables in chapters_of(results)],
        runs=finish_table(tables.RUNS, results),
        assumptions=assumptions(results.sweep),
        **view_of(results, parts.films),
    )


def render_streams(sweep: Sweep) -> str:
    """Return the page of streams as HTML."""
    return _environment(sweep).get_template("stream.html.j2").render(
        name=sweep.path.resolve().name,
        runs=stream_runs(sweep.runs),
        passed_over=sweep.passed_over,
        assumptions=assumptions(sweep),
    )


def _environment(sweep: Sweep) -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"local": lambda text: local(text, sweep), "in_script": in_script}
    return environment


def in_script(json_text: str) -> Markup:
    """JSON for inside a script element: text in it, which may come from any run.json, cannot end the element."""
    return Markup(json_text.replace("<", "\\u003c"))  # noqa: S704 - as htmlsafe_json_dumps does


def local(text: str, sweep: Sweep) -> str:
    """Return a text without the place of the runs on this machine, so that a page can be passed on."""
    for path in (sweep.path, sweep.path.resolve()):
        if path.is_absolute() and path.parent != path:
            text = text.replace(f"{path.parent}/", "")
    return text


def view_of(results: SweepResults, films: Films) -> dict[str, Any]:
    """Return what the template needs for the three-dimensional view."""
    shown = results.index_nearest(0.5)
    try:
        still_uri = to_picture_uri(still(still_scene(results.runs[shown], results.breakage.networks[shown])))
    except MISSING_RESULT:
        still_uri = ""  # then there are no films either, and their reason stands in the page
    maps = (DAMAGE_COLOURS, STRESS_COLOURS)
    return {
        "films": films,
        "still": still_uri,
        "three": three_js(),
        "maps": [map_table(name) for name in maps],
        "scales": [css_gradient(name) for name in maps],
    }


def three_js() -> str:
    """Return the source of three.js, which the extra `report` installs; "" where it is not installed."""
    try:
        return (files("jupyter_threejs_sage") / "static" / "r130" / "three.min.js").read_text()
    except ModuleNotFoundError:
        return ""


def numbers(results: SweepResults, counts: Counter[str]) -> list[Number]:
    """Return the numbers of the first screen."""
    total = sum(counts.values())
    peaks_kN = 1e-3 * results.sweep.peaks("force_N")
    found = [
        _held_out(results),
        Number(f"{peaks_kN[0]:.0f} to {peaks_kN[-1]:.0f} kN", "largest force, from lowest to highest ratio"),
    ]
    return [*found, Number(f"{counts[HELD]} of {total}", "statements of the paper held")] if total else found


def _held_out(results: SweepResults) -> Number:
    """Return the error of the method that answers most runs, trained on the other ratios."""
    words = "mean error of the ratio, trained on the other ratios"
    try:
        error = np.abs(results.recognition.errors_points(HELD_OUT, results.recognition.leading_method))
    except MISSING_RESULT as reason:
        return Number("-", f"{words}: {reason}")
    if not error.size:
        return Number("-", f"{words}: no answer")
    return Number(f"{error.mean():.1f} points", f"{words}, worst {error.max():.1f}")


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
