"""Tables of recognition."""

import numpy as np

from analysis.signals.features import BASE_PARAMETERS
from report.recognition.results import HELD_OUT, MODEL_METHODS, Recognition
from report.sweep_results import SweepResults
from report.tables import Cells, table

#: A space at which "3 of 11" does not break into two lines.
NO_BREAK = "\u00a0"


@table("table-2", "Standardised parameters", "By Eq. 39; the direction of each parameter is that of these runs.",
       ratios=4)
def standardised(results: SweepResults) -> Cells:
    values, falling = results.of(Recognition).standardised_base
    rows = [[name.replace("_", " ") + (" (falling)" if falls else ""), *(f"{v:.4f}" for v in column)]
            for name, falls, column in zip(BASE_PARAMETERS, falling, values.T, strict=True)]
    return ["", *_percent(results.ratios)], rows


@table("table-3", "Q and its quadratic", ratios=4)
def deviations(results: SweepResults) -> Cells:
    measured, calculated = results.of(Recognition).q, results.of(Recognition).q_quadratic(results.ratios)
    named = {"measured": measured, "calculated": calculated, "difference": calculated - measured}
    rows = [[name, *(f"{v:.5f}" for v in values)] for name, values in named.items()]
    return ["", *_percent(results.ratios)], rows


@table("table-recognised", "Recognised mixing ratio of each run",
       "In per cent, by models trained on the other ratios: 0 and 100 % are extrapolations, and nothing is clipped.",
       ratios=4)
def recognised(results: SweepResults) -> Cells:
    rows = [[true, *("no answer" if answers[method].reason else f"{100 * answers[method].ratio:.2f}"
                     for method in MODEL_METHODS)]
            for true, answers in zip(_percent(results.ratios), results.of(Recognition).answers[HELD_OUT], strict=True)]
    return ["true", *MODEL_METHODS.values()], rows


@table("table-errors", "Errors of recognition",
       "Points of mixing ratio. Trained on all: the run itself was in the training, so it tells how well a method "
       "describes its own data. That ratio held out: trained on the other ratios.", ratios=4)
def errors(results: SweepResults) -> Cells:
    found = results.of(Recognition)
    rows = [[name, training, *_error_cells(found.errors_points(training, method), len(results.runs))]
            for training in found.answers for method, name in MODEL_METHODS.items()]
    return ["method", "training", "answered", "mean", "worst"], rows


def _percent(ratios: np.ndarray) -> list[str]:
    return [f"{100 * r:.0f} %" for r in ratios]


def _error_cells(errors_points: np.ndarray, count: int) -> list[str]:
    """Return how many of `count` runs were answered, and the mean and the worst error."""
    size = np.abs(errors_points)
    numbers = [f"{size.mean():.2f}", f"{size.max():.2f}"] if size.size else ["-", "-"]
    return [f"{size.size}{NO_BREAK}of{NO_BREAK}{count}", *numbers]


RECOGNITION_TABLES = [standardised, deviations, errors, recognised]
