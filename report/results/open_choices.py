"""What other choices would have given where the paper leaves one open: fusion, form of fit, limit of R^2, judge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.estimation.window import LEAST_RATIOS
from recognition.paper.function_space import EXPONENTIAL, FORMS, LOGARITHMIC, POWER, Rule
from recognition.paper.fusion import FUSIONS, Fusion
from recognition.paper.pipeline import FusionPipeline
from recognition.paper.strategy import Strategy
from report.results.methods import MODIFIED_STRATEGY, STRATEGY_AS_PUBLISHED
from report.results.sweep_results import SweepResults


def _modified_by(rule: Rule) -> Strategy:
    return Strategy(rule, least_share=0.5, judge="truncated")


#: {name of the choice: (fusion, unfitted strategy)}.
OPEN_CHOICES: dict[str, tuple[str, Callable[[], Strategy]]] = {
    "as published: R² ≥ 0.99, mean": ("energy", STRATEGY_AS_PUBLISHED),
    "R² ≥ 0.9999": ("energy", lambda: _modified_by(Rule(min_r2=0.9999))),
    "modified: degree 2, truncated mean": ("energy", MODIFIED_STRATEGY),
    "degree 1": ("energy", lambda: _modified_by(Rule(degree=1))),
    "degree 3": ("energy", lambda: _modified_by(Rule(degree=3))),
    "exponential": ("energy", lambda: _modified_by(Rule((EXPONENTIAL,)))),
    "logarithmic": ("energy", lambda: _modified_by(Rule((LOGARITHMIC,)))),
    "power": ("energy", lambda: _modified_by(Rule((POWER,)))),
    "best form at each moment": ("energy", lambda: _modified_by(Rule(FORMS))),
    "degree 2, mean of usable points": ("energy", lambda: Strategy(Rule(degree=2), judge="mean")),
    "degree 2, median": ("energy", lambda: Strategy(Rule(degree=2), judge="median")),
    "degree 2, RMS": ("energy", lambda: Strategy(Rule(degree=2), judge="rms")),
    "degree 2, no least share": ("energy", lambda: Strategy(Rule(degree=2), least_share=0.0)),
    **{f"modified, {kind} fusion": (kind, MODIFIED_STRATEGY) for kind in FUSIONS if kind != "energy"},
}


@dataclass(frozen=True)
class ChoiceOutcome:
    """What one choice gives.

    errors_points (answered,): recognised less true ratio of the runs that were answered. reason: why no strategy
    could be fitted, else empty.
    """

    name: str
    errors_points: np.ndarray
    reason: str = ""


def compare_open_choices(results: SweepResults) -> list[ChoiceOutcome]:
    """Return the outcome of every choice, each ratio held out. Raises RecognitionError for too few ratios."""
    ratios = results.ratios
    if np.unique(ratios).size < LEAST_RATIOS:
        raise RecognitionError(f"{len(results.runs)} runs; needs at least {LEAST_RATIOS} different mixing ratios")
    outcomes = []
    for name, (kind, strategy) in OPEN_CHOICES.items():
        try:
            errors = _held_out_errors_points(kind, strategy, results.recognition.fusion_inputs(kind), ratios)
            outcomes.append(ChoiceOutcome(name, errors))
        except RecognitionError as reason:
            outcomes.append(ChoiceOutcome(name, np.array([]), str(reason)))
    return outcomes


def _held_out_errors_points(
    kind: str, strategy: Callable[[], Strategy], responses: np.ndarray, ratios: np.ndarray
) -> np.ndarray:
    """Return the error of each run, recognised by a strategy fitted to all other ratios; unanswered runs are left out.

    responses: shape (runs, m, samples), as the fusion takes them. Raises RecognitionError if no fit is possible.
    """
    errors = []
    for i, ratio in enumerate(ratios):
        others = ratios != ratio
        pipeline = FusionPipeline(Fusion(kind), strategy()).fit(responses[others], ratios[others])
        try:
            errors.append(100 * (pipeline.recognise(responses[i]).ratio - ratio))
        except NotRecognised:
            continue
    return np.array(errors)
