"""The page of a run or of a directory of runs: report.html with everything inside it, and of the paper's scene
claims.csv beside it. Every number on it is of these runs. Parts are made side by side:
first what many of them show, then the rest."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from analysis import Run, Sweep, read_sweep
from analysis.sweep import breakage
from analysis.sweep.run_table import dotted
from analysis.sweep.runs import is_stream
from common.files.output_directory import (
    hash_of,
    is_stamped,
    listed_files,
    refuse_foreign_file,
    stamped,
    write_contents,
)
from common.files.whole import write_text
from common.process.processes import side_by_side
from common.resources import resource
from common.result import Result
from common.scene.scene import read_scene
from recognition.estimation.window import LEAST_RATIOS
from report import tables, variation
from report.breakage import BREAKAGE_FIGURES, BREAKAGE_STATEMENTS, Breakage
from report.drawing.figure_spec import FigureSpec, FinishedFigure
from report.drawing.pages import rendered
from report.drawing.style import DAMAGE_COLOURS, STRESS_COLOURS, css_gradient, map_table, to_picture_uri
from report.film.pictures import EARLY, IMPACT, WHOLE, Series
from report.film.reel import Films, films_of, pack_films
from report.film.still import still
from report.missing import MISSING_RESULT
from report.recognition.claims import RECOGNITION_STATEMENTS
from report.recognition.figures import RECOGNITION_FIGURES, RECOGNITION_TABLES, recognised_against_true
from report.recognition.results import HELD_OUT, LEADING_METHODS, MODEL_METHODS, Recognition
from report.response import RESPONSE_FIGURES, RESPONSE_STATEMENTS, felt, maxima
from report.signals import SIGNAL_FIGURES, SIGNAL_STATEMENTS
from report.stream import STREAM_FIGURES, StreamResults, heard, stop
from report.sweep_results import SweepResults
from report.tables import FinishedTable, Number, TableSpec
from report.theory import THEORY_FIGURES, THEORY_STATEMENTS
from report.verdicts import (
    LEAST_TREND,
    VERDICTS,
    Claim,
    Statement,
    check_statements,
    claims_csv,
    falling_steps,
    spearman,
)

Work = Callable[[], Any]


def make_parts(results: SweepResults, works: Sequence[Work], statements: Sequence[Sequence[Statement]],
               recognises: bool) -> tuple[list[Any], list[Claim]]:
    """Return what each work returns, and the claims in order, made by as many processes as there are processors.

    The last of `statements` are of the recognised ratios. While other processes recognise the runs, this one checks the
    other statements, for which it finds most of what the figures show; the figures are drawn by copies of it.
    """
    claims: list[Claim] = []
    *early, late = statements

    def beside() -> None:
        for own in early:
            claims.extend(check_statements(results, own))
        if recognises:
            attempt(lambda: results.of(Recognition).filtered)
            attempt(lambda: results.of(Recognition).fused)

    if recognises:
        recognition, runs = results.of(Recognition), range(len(results.runs))
        attempt(lambda: recognition.prepared)  # else each process prepares them
        model, *held_out = all_of([lambda: (recognition.model, recognition.by_all),
                                   *(partial(lambda k: recognition.prepared.answers_without(k), k) for k in runs)],
                                  beside)
        if not any(isinstance(one, Exception) for one in (model, *held_out)):  # else it is told where it is asked for
            (recognition.model, recognition.by_all), recognition.held_out = model, held_out
    else:
        beside()
    last, *made = all_of([partial(check_statements, results, late), *works])
    return made, claims + last


def all_of(works: Sequence[Work], beside: Callable[[], object] = lambda: None) -> list[Any]:
    """What each work returns, or the reason that the runs do not give it; beside: done by this process meanwhile."""
    return side_by_side(lambda k: attempt(works[k]), len(works), beside)


def attempt(work: Work) -> Any:
    try:
        return work()
    except MISSING_RESULT as reason:
        return reason


#: Title, figures and tables of each chapter, in order.
CHAPTERS: list[tuple[str, list[FigureSpec], list[TableSpec]]] = [
    ("Response of the plate", RESPONSE_FIGURES, []),
    ("Breakage", BREAKAGE_FIGURES, [variation.one_stone]),
    ("Signals", SIGNAL_FIGURES, []),
    ("Theory", THEORY_FIGURES, [tables.materials]),
    ("Recognition", RECOGNITION_FIGURES, RECOGNITION_TABLES),
    ("With stones that vary", [], [variation.varying]),
]

STATEMENTS = [THEORY_STATEMENTS, BREAKAGE_STATEMENTS, RESPONSE_STATEMENTS, SIGNAL_STATEMENTS, RECOGNITION_STATEMENTS]

#: What is no physics of a scene: the paper's statements hold for it with any of these.
NO_PHYSICS = {"stones": ("gangue_ratio", "seed"), "plate": ("sensors", "max_frequency_Hz")}


@dataclass(frozen=True)
class Chapter:
    title: str
    figures: list[FinishedFigure]
    tables: list[FinishedTable]


@dataclass(frozen=True)
class Rise:
    """Whether a quantity rises with the ratio. falls_at: neighbouring ratios between which it falls. first, last: its
    values at the lowest and the highest ratio."""

    name: str
    spearman: float
    falls_at: list[tuple[float, float]]
    first: str
    last: str

    @property
    def in_words(self) -> str:
        if not self.falls_at:
            return "rises at every step"
        if self.spearman >= 0.9:
            return "rises as a whole"
        return "rises weakly" if self.spearman >= 0.5 else "does not rise"


@dataclass(frozen=True)
class Content:
    """What a page shows. first: the figure of the first screen. runs: a table of them."""

    title: str
    numbers: list[Number]
    first: FinishedFigure
    films: Films
    chapters: list[Chapter]
    runs: FinishedTable | None = None
    rises: list[Rise] = field(default_factory=list)
    claims: list[Claim] = field(default_factory=list)


@dataclass(frozen=True)
class ReportResult(Result):
    line = "report written to {report}"
    report: Path


def report(directory: str | Path) -> ReportResult:
    """Write report.html into a run directory or a directory of runs, and of the paper's scene claims.csv beside it,
    each whole or not at all.

    Raises RecordError or RecognitionError, with a message of one line, where the runs cannot be used, and OSError where
    the files cannot be written.

    >>> report("runs/paper/ratio_030").report.name
    'report.html'
    """
    directory = Path(directory)
    file, claims = directory / "report.html", directory / "claims.csv"
    refuse_foreign_file(file, is_stamped)
    refuse_foreign_file(claims, is_stamped)
    sweep = read_sweep(directory)
    content = _of_streams(sweep) if all(map(is_stream, sweep.runs)) else _of_impacts(SweepResults(sweep))
    if content.claims:
        write_text(claims, stamped(local(claims_csv(content.claims), sweep), "# {}"))
    write_text(file, stamped(render(sweep, content)))
    if (listed := listed_files(directory, "run")) is not None:  # a run may be replaced with what belongs to it
        own = {one.name: hash_of(one) for one in (file, claims) if one.is_file()}
        write_contents(directory, "run", listed | own)
    return ReportResult(file)


def _of_impacts(results: SweepResults) -> Content:
    runs, ratios = results.runs, len(set(results.ratios))
    recognises, papers = ratios >= LEAST_RATIOS and results.plate_moves, ratios >= LEAST_TREND and are_papers(runs)
    given = {"Breakage": any(run.summary.n_bonds for run in runs), "Signals": results.plate_moves,
             "Theory": bool(runs[0].scene.plate.rods),  # a chapter of nothing but reasons helps nobody
             "Recognition": recognises, "With stones that vary": papers}
    chapters = [one for one in CHAPTERS if given.get(one[0], True)]
    first = felt if ratios == 1 else recognised_against_true if recognises else maxima
    of_chapters: list[FigureSpec | TableSpec] = []
    for _, figures, of_chapter in chapters:
        of_chapters += [*of_chapter, *(spec for spec in figures if spec.ratios <= ratios)]
    specs = [spec for spec in of_chapters if spec is not first] + [first]
    main = results.index_nearest(0.5)
    made, claims = make_parts(
        results, [*(partial(spec.finished, results) for spec in specs),
                  *(partial(_film, runs, k, main, (IMPACT, EARLY, WHOLE) if k == main else (IMPACT, WHOLE))
                    for k in range(len(runs)))], STATEMENTS if papers else [[]], recognises)
    finished = {spec.key: one for spec, one in zip(specs, made, strict=False)}
    return Content(
        "How much gangue fell on the plate?" if ratios > 1 else "What the stones did to the plate",
        numbers(results, recognises), finished[first.key],
        films_of([f"{100 * run.gangue_ratio:.0f} % gangue" for run in runs], made[len(specs):], main),
        [Chapter(title, [finished[spec.key] for spec in figures if spec.key in finished and spec is not first],
                 [finished[spec.key] for spec in of_chapter if spec.key in finished])
         for title, figures, of_chapter in chapters],
        tables.runs.finished(results), rises(results), claims)


def _of_streams(sweep: Sweep) -> Content:
    streams = [StreamResults(run) for run in sweep.runs]
    names = [run.path.name for run in sweep.runs]
    works = [[partial(replace(spec, key=f"{name}-{spec.key}").finished, one)
              for spec in ([heard, stop] if one.was_heard else []) + STREAM_FIGURES]
             for name, one in zip(names, streams, strict=True)]
    films = [partial(_film, sweep.runs, k, 0, (WHOLE,)) for k in range(len(streams))]
    figures = iter(all_of([*chain(*works), *films]))
    of_each = [[next(figures) for _ in own] for own in works]
    chapters = [Chapter("What fell" if len(streams) == 1 else name, found if k else found[1:], [one.table()])
                for k, (name, one, found) in enumerate(zip(names, streams, of_each, strict=True))]
    return Content("What fell on the plate?", streams[0].numbers(), of_each[0][0],
                   films_of(names, list(figures), 0), chapters)


def _film(runs: list[Run], index: int, main: int, wanted: tuple[Series, ...]) -> tuple[str, str]:
    """The packed film of a run, and of the main one the still picture that stands in its place."""
    run = runs[index]
    network = breakage.read_network(run)
    picture = to_picture_uri(still(run, network)) if index == main else ""
    return pack_films(run, network, (1 + (index == main)) / (1 + len(runs)), wanted), picture


def are_papers(runs: Sequence[Run]) -> bool:
    """Is the physics of the runs' scenes that of the paper, whatever the scenes' names are?"""
    papers = _physics(read_scene(resource("scenes") / "paper.toml").model_dump(mode="json"))
    return all(_physics(run.scene.as_json()) == papers for run in runs)


def _physics(scene: dict[str, Any]) -> dict[str, Any]:
    tables_of = {name: scene.get(name) for name in ("stones", "materials", "contacts", "plate")}
    for name, keys in NO_PHYSICS.items():
        tables_of[name] = {key: value for key, value in (tables_of[name] or {}).items() if key not in keys}
    return tables_of | {"gravity_m_s2": scene.get("time", {}).get("gravity_m_s2")}


def render(sweep: Sweep, content: Content) -> str:
    counts = Counter(claim.verdict for claim in content.claims)
    maps = (DAMAGE_COLOURS, STRESS_COLOURS)
    return rendered(
        "report.html.j2", {"local": lambda text: local(text, sweep), "in_script": in_script},
        name=sweep.path.resolve().name,
        sweep=sweep,
        content=content,
        verdicts=[(verdict, counts[verdict]) for verdict in VERDICTS],
        assumptions=assumptions(sweep),
        warnings=dict.fromkeys(line for run in sweep.runs for line in run.summary.warnings),
        maps=[map_table(name) for name in maps],
        scales=[css_gradient(name) for name in maps],
    )


def in_script(json_text: str) -> Markup:
    """JSON for inside a script element: text in it, which may come from any run.json, cannot end the element."""
    return Markup(json_text.replace("<", "\\u003c"))  # noqa: S704 - as htmlsafe_json_dumps does


def local(text: str, sweep: Sweep) -> str:
    """Return a text without the place of the runs on this machine, so that a page can be passed on."""
    for path in (sweep.path, sweep.path.resolve()):
        if path.is_absolute() and path.parent != path:
            text = text.replace(f"{path.parent}/", "")
    return text


def numbers(results: SweepResults, recognises: bool) -> list[Number]:
    """Return the numbers of the first screen."""
    runs = results.runs
    ends = sorted({0, len(runs) - 1})
    at = " and ".join(f"{100 * results.ratios[i]:.0f} %" for i in ends) if len(ends) > 1 else ""

    def span(values: list[str], unit: str, words: str) -> Number:
        return f"{' to '.join(values)} {unit}".strip(), f"{words}, at {at} gangue" if at else words

    found = [_held_out(results)] if recognises else []
    found.append(span([digits(1e-3 * runs[i].peak("force_N")) for i in ends], "kN", "largest force on the plate"))
    if results.plate_moves and len(found) < 2:
        found.append(span([digits(runs[i].peak("a_m_s2")) for i in ends], "m/s²",
                          "largest acceleration of the plate's centre of mass"))
    if all(run.summary.n_bonds for run in runs):
        found.append(span([f"{runs[i].summary.n_bonds_broken}" for i in ends], "",
                          f"bonds broken of {runs[0].summary.n_bonds} ({results.of(Breakage).draws_in_words})"))
    return found


def digits(value: float) -> str:
    """Three digits, without an exponent where a reader needs none."""
    return f"{float(f'{value:.3g}'):g}"


def _held_out(results: SweepResults) -> Number:
    """Return the error of the method that answers most runs, trained on the other ratios."""
    words, found = "mean error of the ratio, trained on the other ratios", results.of(Recognition)
    try:
        error = np.abs(found.errors_points(HELD_OUT, found.leading_of((*LEADING_METHODS, *MODEL_METHODS))))
    except MISSING_RESULT as reason:
        return "-", f"{words}: {reason}"
    if not error.size:
        return "-", f"{words}: no answer"
    return f"{error.mean():.1f} points", f"{words}, worst {error.max():.1f}"


def rises(results: SweepResults) -> list[Rise]:
    """Return whether the main quantities rise with the ratio, as far as the runs have them; nothing for few ratios."""
    if len(set(results.ratios)) < LEAST_TREND:
        return []
    quantities = [("largest total force", 1e-3 * results.sweep.peaks("force_N"), "kN")]
    if results.plate_moves:
        quantities += [("largest kinetic energy of the plate", results.sweep.peaks("kinetic_J"), "J"),
                       ("RMS of the plate's acceleration", results.rms_m_s2, "m/s²")]
    return [Rise(name, spearman(results.ratios, values), falling_steps(results.ratios, values), digits(values[0]),
                 f"{digits(values[-1])} {unit}") for name, values, unit in quantities]


def assumptions(sweep: Sweep) -> list[str]:
    """Return the assumptions of the scenes as lines, each once and in order: `plate.tilt_deg` as `plate.tilt_deg =
    20.0`, and what is no single value of the scene as it is."""
    lines: dict[str, None] = {}
    for run in sweep.runs:
        values = {key: value for key, value in dotted(run.scene.as_json()) if not isinstance(value, list)}
        found = run.summary.assumptions
        found = [f"{key}: {value}" for key, value in found.items()] if isinstance(found, dict) else found
        lines |= dict.fromkeys(f"{line} = {values[line]}" if line in values else line for line in found)
    return list(lines)
