"""What other choices would have given where the paper leaves one open: fusion, form of fit, limit of R^2, judge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.estimation.window import LEAST_RATIOS
from recognition.paper.function_space import EXPONENTIAL, FORMS, LOGARITHMIC, POWER, Rule
from recognition.paper.fusion import FUSIONS, Fusion
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

    @cache
    def curves(kind: str) -> list[tuple[np.ndarray, np.ndarray]]:
        return _held_out_curves(kind, results.recognition.fusion_inputs(kind), ratios)

    outcomes = []
    for name, (kind, strategy) in OPEN_CHOICES.items():
        try:
            errors = _held_out_errors_points(curves(kind), strategy, ratios)
            outcomes.append(ChoiceOutcome(name, errors))
        except RecognitionError as reason:
            outcomes.append(ChoiceOutcome(name, np.array([]), str(reason)))
    return outcomes


def _held_out_curves(kind: str, responses: np.ndarray, ratios: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return for each run the curves of a fusion fitted to all other ratios: theirs (others, samples) and its own.

    responses: shape (runs, m, samples), as the fusion takes them.
    """
    curves = []
    for own, ratio in zip(responses, ratios, strict=True):
        others = responses[ratios != ratio]
        fusion = Fusion(kind).fit(others)
        curves.append((fusion.transform(others), fusion.transform(own)))
    return curves


def _held_out_errors_points(
    curves: list[tuple[np.ndarray, np.ndarray]], strategy: Callable[[], Strategy], ratios: np.ndarray
) -> np.ndarray:
    """Return the error of each run, recognised by a strategy fitted to all other ratios; unanswered runs are left out.

    Raises RecognitionError if no fit is possible.
    """
    errors = []
    for (others, own), ratio in zip(curves, ratios, strict=True):
        fitted = strategy().fit(others, ratios[ratios != ratio])
        try:
            errors.append(100 * (fitted.recognise(own).ratio - ratio))
        except NotRecognised:
            continue
    return np.array(errors)
