"""The chapter of runs that were not trained on; the paper has none."""

from __future__ import annotations

from report.chapters.figure_spec import Drawn, FigureSpec
from report.figures.evaluation import PlottedMethod, errors_by_case
from report.results.evaluation import Evaluation
from report.results.methods import BASELINE, EVALUATED_METHODS, METHODS_WITH_INTERVAL, PAPER_METHODS
from report.results.sweep_results import SweepResults

PAPER_MARKS, INTERVAL_MARKS = "xs+", "DoP^*<>d"


def plotted_methods() -> list[PlottedMethod]:
    """Return all evaluated methods with their marks; the best one alone is filled."""
    paper_marks = dict(zip(PAPER_METHODS, PAPER_MARKS, strict=True))
    interval_marks = dict(zip(METHODS_WITH_INTERVAL, INTERVAL_MARKS, strict=False))
    methods = []
    for name, label in EVALUATED_METHODS.items():
        if name in METHODS_WITH_INTERVAL:
            mark, best = interval_marks.get(name, "."), name == METHODS_WITH_INTERVAL[0]
            methods.append(PlottedMethod(name, label, "interval", mark, filled=best))
        elif name in paper_marks:
            methods.append(PlottedMethod(name, label, "paper", paper_marks[name]))
        elif name == BASELINE:
            methods.append(PlottedMethod(name, label, "baseline", "v"))
        else:
            methods.append(PlottedMethod(name, label, "other", "."))
    return methods


def errors_by_case_and_noise(results: SweepResults) -> Drawn:
    noises = {"no noise": None, "noise of 20 dB": 20.0}
    evaluation = results.evaluation
    drawn = [method for method in plotted_methods() if (evaluation.table["method"] == method.name).any()]
    return errors_by_case(evaluation.table, drawn, noises), how_to_make(evaluation)


def how_to_make(evaluation: Evaluation) -> str:
    """Return where a kept evaluation comes from and how to make it anew; "" for one that was made here."""
    return f"{evaluation.kept}; `make dataset` makes all of it anew." if evaluation.kept else ""


EVALUATION_FIGURES = [
    FigureSpec(
        key="fig-unseen",
        title="Runs that were not trained on",
        in_paper="Not in the paper.",
        caption=(
            "Mean absolute error on runs of a data set; whole arrangements, packings, speeds, dampings"
            " held out."
        ),
        draw=errors_by_case_and_noise,
    ),
]
