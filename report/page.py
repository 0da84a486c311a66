"""The report of a sweep: report.html with everything inside it, and claims.csv beside it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import jinja2

from analysis import Sweep, read_sweep
from common.resources import resource
from report import tables as report_tables
from report.chapters.mechanics import BREAKAGE, RESPONSE, THEORY
from report.chapters.picture import Picture, Plan, realise
from report.chapters.signals import RECOGNITION, SIGNALS, UNSEEN
from report.claims import mechanics as claims_mechanics
from report.claims import signals as claims_signals
from report.claims.trends import falling_steps, spearman
from report.claims.verdicts import VERDICTS, Claim, judge, to_csv
from report.study import Study
from report.tables import Table

TEMPLATES = resource("templates")

CHAPTERS: list[tuple[str, list[Plan]]] = [
    ("Theory", THEORY),
    ("Breakage", BREAKAGE),
    ("Response of the plate", RESPONSE),
    ("Signals", SIGNALS),
    ("Recognition", RECOGNITION),
    ("Runs not trained on", UNSEEN),
]


TABLES = {
    "Theory": [report_tables.materials],
    "Signals": [report_tables.emd_rules, report_tables.standardised],
    "Runs not trained on": [report_tables.unseen],
    "Recognition": [report_tables.deviations, report_tables.recognised, report_tables.choices],
}


@dataclass(frozen=True)
class Chapter:
    title: str
    pictures: list[Picture]
    tables: list[Table]


@dataclass(frozen=True)
class Rise:
    """Does a quantity rise with the ratio? falls_at: pairs of neighbouring ratios where it falls."""

    name: str
    spearman: float
    falls_at: list[tuple[float, float]]
    first: str
    last: str

    @property
    def verdict(self) -> str:
        if self.spearman >= 0.9:
            return "rises" if not self.falls_at else "rises as a whole"
        return "rises weakly" if self.spearman >= 0.5 else "does not rise"


def write_report(directory) -> Path:
    """Write report.html and claims.csv into a directory of runs, each whole or not at all.

    Returns the path of the report. Raises RecordError or RecognitionError, one line, where
    the runs cannot be used.
    """
    sweep = read_sweep(directory)
    study = Study(sweep)
    claims = judge(study, claims_mechanics.STATEMENTS + claims_signals.STATEMENTS)
    out = Path(directory) / "report.html"
    _write(out.with_name("claims.csv"), to_csv(claims))
    _write(out, render(sweep, study, claims))
    return out


def _write(path: Path, text: str) -> None:
    beside = path.with_name(path.name + ".part")
    beside.write_text(text, encoding="utf-8")
    beside.replace(path)


def render(sweep: Sweep, study: Study, claims: list[Claim]) -> str:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    counts = Counter(claim.verdict for claim in claims)
    return environment.get_template("report.html.j2").render(
        sweep=sweep,
        rises=rises(study),
        claims=claims,
        verdicts=[(verdict, counts[verdict]) for verdict in VERDICTS],
        chapters=chapters(study),
        errors=report_tables.realise(report_tables.errors, study),
        runs=report_tables.realise(report_tables.runs, study),
        assumptions=assumptions(sweep),
    )


def chapters(study: Study) -> list[Chapter]:
    return [
        Chapter(
            title,
            [realise(plan, study) for plan in plans],
            [report_tables.realise(build, study) for build in TABLES.get(title, [])],
        )
        for title, plans in CHAPTERS
    ]


def rises(study: Study) -> list[Rise]:
    """What the reader asks first; nothing of a single run."""
    if len(study.runs) < 2:
        return []
    rows = [
        ("peak total force", 1e-3 * study.peaks["force_N"], "kN"),
        ("peak kinetic energy of the plate", study.peaks["kinetic_J"], "J"),
        ("RMS of the plate's acceleration", study.parameters["rms"], "m/s²"),
    ]
    return [
        Rise(
            name,
            spearman(study.ratios, values),
            falling_steps(study.ratios, values),
            f"{values[0]:.4g}",
            f"{values[-1]:.4g} {unit}",
        )
        for name, values, unit in rows
    ]


def assumptions(sweep: Sweep) -> list[str]:
    """The scene's assumptions as lines, each once, in order; keys of the scene with their values."""
    lines: dict[str, None] = {}
    for run in sweep.runs:
        found = run.info.get("assumptions", [])
        found = [f"{key}: {value}" for key, value in found.items()] if isinstance(found, dict) else found
        scene = run.info.get("scene", {})
        lines.update(dict.fromkeys(_with_value(str(line), scene) for line in found))
    return list(lines)


def _with_value(line: str, scene: dict) -> str:
    """`plate.length_m` as `plate.length_m = 0.5`; a line that is no single value of the scene as it stands."""
    value = scene
    for key in line.split("."):
        if not isinstance(value, dict) or key not in value:
            return line
        value = value[key]
    return line if isinstance(value, (dict, list)) else f"{line} = {value}"
