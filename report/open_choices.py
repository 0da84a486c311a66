"""The choices that the paper leaves open, side by side: fusion, form of fit, limit of R^2, judge, xi."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.estimation.window import LEAST_RATIOS
from recognition.paper.function_space import EXPONENTIAL, FORMS, LOGARITHMIC, POWER, Rule
from recognition.paper.fusion import FUSIONS, Fusion
from recognition.paper.pipeline import FusionPipeline, as_published, modified
from recognition.paper.strategy import Strategy


def _modified_by(rule: Rule) -> Strategy:
    return Strategy(rule, least_share=0.5, judge="truncated")


#: name -> (fusion, unfitted strategy).
CHOICES = {
    "as published: R² ≥ 0.99, mean": ("energy", as_published),
    "R² ≥ 0.9999": ("energy", lambda: _modified_by(Rule(min_r2=0.9999))),
    "modified: degree 2, truncated mean": ("energy", modified),
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
    **{f"modified, {kind} fusion": (kind, modified) for kind in FUSIONS if kind != "energy"},
}


@dataclass(frozen=True)
class Outcome:
    """errors_points: recognised less true ratio of the runs answered; reason: why none could be fitted."""

    name: str
    errors_points: np.ndarray
    reason: str = ""


def held_out(kind: str, strategy, responses: np.ndarray, ratios: np.ndarray) -> np.ndarray:
    """Errors in points, each run recognised by a pipeline fitted to all other ratios.

    responses: (runs, m, n) of the fusion; runs without an answer are left out. Raises
    RecognitionError where a pipeline cannot be fitted.
    """
    errors = []
    for i, ratio in enumerate(ratios):
        rest = ratios != ratio
        pipeline = FusionPipeline(Fusion(kind), strategy()).fit(responses[rest], ratios[rest])
        try:
            errors.append(100 * (pipeline.recognise(responses[i]).ratio - ratio))
        except NotRecognised:
            continue
    return np.array(errors)


def compare(study) -> list[Outcome]:
    """Every choice on one sweep, ratios held out. RecognitionError for too few ratios."""
    if np.unique(study.ratios).size < LEAST_RATIOS:
        raise RecognitionError(
            f"{len(study.runs)} runs; needs at least {LEAST_RATIOS} different mixing ratios"
        )
    outcomes = []
    for name, (kind, strategy) in CHOICES.items():
        try:
            outcomes.append(Outcome(name, held_out(kind, strategy, study.responses(kind), study.ratios)))
        except RecognitionError as reason:
            outcomes.append(Outcome(name, np.array([]), str(reason)))
    return outcomes
