"""Tables of the report: Tables 1-3 of the paper from our data, recognition, and the runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis import RecordError
from analysis.features import BASE_PARAMETERS
from recognition.estimation.errors import RecognitionError
from recognition.methods import EVALUATED, METHODS
from recognition.paper.least_squares import fit_polynomial
from report.open_choices import compare
from report.study import Study


@dataclass(frozen=True)
class Table:
    """rows hold text, the first column being the name of the row."""

    key: str
    title: str
    note: str
    header: list[str]
    rows: list[list[str]]


def realise(build: Callable[[Study], Table], study: Study) -> Table:
    """The table, or an empty one that says why the runs do not give it."""
    try:
        return build(study)
    except (RecordError, RecognitionError) as reason:
        name = build.__name__
        return Table(f"table-{name}", name.capitalize(), f"Not given: {reason}", [], [])


def materials(study: Study) -> Table:
    """Table 1, from the scene."""
    setup = study.setup
    rows = [
        [name, f"{m.density_kg_m3:g}", f"{1e-9 * m.youngs_modulus_Pa:g}", f"{m.poisson_ratio:g}"]
        for name, m in {**setup.rocks, "plate": setup.plate}.items()
    ]
    return Table(
        "table-1", "Elastic parameters (Table 1)", "", ["", "density, kg/m³", "E, GPa", "Poisson"], rows
    )


def _percent(study: Study) -> list[str]:
    return [f"{100 * r:.0f} %" for r in study.ratios]


def standardised(study: Study) -> Table:
    """Table 2: the eight base parameters by Eq. 39."""
    scaler = study.fusion_q.scaler_
    values, falling = scaler.transform(study.base), scaler.direction < 0
    rows = [
        [name.replace("_", " ") + (" (falling)" if down else ""), *(f"{v:.4f}" for v in column)]
        for name, down, column in zip(BASE_PARAMETERS, falling, values.T, strict=True)
    ]
    note = "Standardised by Eq. 39; the direction of each parameter is that of these runs, not the paper's."
    return Table("table-2", "Standardised parameters (Table 2)", note, ["", *_percent(study)], rows)


def emd_rules(study: Study) -> Table:
    """Cost of the EMD stopping rules."""
    rows = [
        [cost.rule, str(cost.samples), str(cost.imfs), f"{1e3 * cost.seconds:.1f}", f"{100 * cost.error:.2f}"]
        for cost in study.rule_costs
    ]
    note = "Time and error of the first IMF, as in the picture; measured when this report was written."
    header = ["rule", "samples", "IMFs", "time, ms", "error, %"]
    return Table("table-rules", "Cost of the EMD stopping rules", note, header, rows)


def deviations(study: Study) -> Table:
    """Table 3: Q of each run against the quadratic."""
    calculated = fit_polynomial(study.ratios, study.q, 2)(study.ratios)
    rows = [
        [name, *(f"{v:.5f}" for v in values)]
        for name, values in (
            ("measured", study.q),
            ("calculated", calculated),
            ("difference", calculated - study.q),
        )
    ]
    note = "The paper's differences reach from 0.006 to 0.046, to both sides."
    return Table("table-3", "Q and its quadratic (Table 3)", note, ["", *_percent(study)], rows)


def recognised(study: Study) -> Table:
    """Recognised ratio of each run, both trainings."""
    header = ["true", *(f"{entry.title}, {trained}" for trained in study.answers for entry in METHODS.values())]
    rows = []
    for i, ratio in enumerate(study.ratios):
        cells = [answers[i][method] for answers in study.answers.values() for method in METHODS]
        rows.append(
            [
                f"{100 * ratio:.0f} %",
                *("no answer" if c.reason else f"{100 * c.ratio:.2f}" for c in cells),
            ]
        )
    note = "In per cent; not clipped to 0..100. Held out: 0 and 100 % are extrapolations."
    return Table("table-recognised", "Recognised mixing ratio of each run", note, header, rows)


def choices(study: Study) -> Table:
    """What other choices the paper leaves open would have given."""
    rows = []
    for outcome in compare(study):
        e = np.abs(outcome.errors_points)
        numbers = [f"{e.mean():.2f}", f"{e.max():.2f}"] if e.size else ["-", "-"]
        rows.append([outcome.name, f"{e.size}\u00a0of\u00a0{len(study.runs)}", *numbers, outcome.reason])
    note = (
        "Errors in points of mixing ratio, that ratio held out. Noise-free runs of one arrangement and speed."
    )
    header = ["choice", "answered", "mean", "worst", ""]
    return Table("table-choices", "Choices that the paper leaves open", note, header, rows)


def unseen(study: Study) -> Table:
    """evaluation.csv without noise and at 20 dB."""
    rows = []
    for r in study.evaluation.to_dict("records"):
        if r["noise_db"] == 40 or not r["answered"]:
            continue
        covered = "-" if np.isnan(r["coverage_90"]) else f"{100 * r['coverage_90']:.0f}"
        rows.append([
            r["case"], EVALUATED[r["method"]].title if r["method"] in EVALUATED else r["method"], "-" if np.isnan(r["noise_db"]) else f"{r['noise_db']:.0f}",
            f"{r['answered']}\u00a0of\u00a0{r['n']}", *(f"{r[name]:.2f}" for name in ("mean_abs_error_points", "p95_points",
                                                                                 "worst_points", "bias_points")),
            covered, f"{100 * r['flagged']:.0f}"])  # fmt: skip
    note = ("Points of mixing ratio, of the runs answered; covered: share of true ratios in the 90 % interval; flagged: as"
            " outside the calibration. What each case holds out and more noise: evaluation.csv.")
    header = ["case", "method", "noise, dB", "answered", "mean", "95 %", "worst", "bias", "covered, %", "flagged, %"]
    return Table("table-unseen", "Runs that were not trained on", note, header, rows)


def errors(study: Study) -> Table:
    """Mean and worst error of each method and training, in points of mixing ratio."""
    rows = []
    for trained in study.answers:
        for method, entry in METHODS.items():
            e = np.abs(study.errors_points(trained, method))
            numbers = [f"{e.mean():.2f}", f"{e.max():.2f}"] if e.size else ["-", "-"]
            rows.append([entry.title, trained, f"{e.size}\u00a0of\u00a0{len(study.runs)}", *numbers])
    return Table("table-errors", "Errors", "", ["method", "training", "answered", "mean", "worst"], rows)


def runs(study: Study) -> Table:
    rows = []
    for i, run in enumerate(study.runs):
        info = run.info
        rows.append([
            f"{100 * run.gangue_ratio:.0f} %",
            str(info.get("n_particles", "-")),
            str(info.get("n_bonds", "-")),
            str(info.get("n_bonds_broken", "-")),
            f"{1e-3 * study.peaks['force_N'][i]:.2f}",
            f"{study.peaks['kinetic_J'][i]:.4g}",
            f"{study.parameters['rms'][i]:.4g}",
            f"{sum(info.get('wall_time_s', {}).values()):.1f}",
        ])  # fmt: skip
    header = [
        "ratio",
        "particles",
        "bonds",
        "broken",
        "peak force, kN",
        "peak kinetic, J",
        "RMS, m/s²",
        "wall time, s",
    ]
    return Table("table-runs", "Runs", "", header, rows)
