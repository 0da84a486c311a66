"""The protocol that every method of recognition keeps, and the entry by which a registry names it.

Methods are estimators of scikit-learn: `clone`, `cross_val_score`, `GridSearchCV` and pipelines take them. They pass
`sklearn.utils.estimator_checks.check_estimator`, `FusionQ` but for the checks that
tests/recognition/test_scikit_learn.py lists. For X of three dimensions scikit-learn checks little more than that a copy
can be made. `ArrangementLikelihood` is no estimator: its records are objects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import pandas as pd
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, RegressorMixin

from analysis.sweep.runs import Run
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Floats

#: A value for each run; runs of one draw of arrangement and packing share it.
Groups = Sequence[Any] | NDArray[Any]


class Method(Protocol):
    """A record becomes features, features train the method, and the trained method answers.

    A method is a dataclass. Its fields ending in an underscore are set by `fit`; with the others they are what the
    model file holds.
    """

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Any:
        """Features of one record: a table with t_s and the plate's responses in SI units, cut to the window.

        run: the simulated run that the signals are from, where the method may be trained on it; its files may say more
        than the record does. RecognitionError names a column that is missing.
        """

    def fit(self, X: Sequence[Any], y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> Method:
        """Train on the features X of n runs of ratio y (n,), 0..1, and return the method itself.

        groups (n,): runs that share a value are held out together. nuisance: a row for each run, a column for each
        condition that varied and that a record does not tell. RecognitionError where the runs do not allow it.
        """

    def answer(self, X: Sequence[Any]) -> list[Answer]:
        """Answers to records by their features."""

    def summary(self) -> str:
        """What was learnt, in a few words."""


@runtime_checkable
class WithHeldOutError(Protocol):
    """A method that knows the mean error of the ratio, `error_`, that it makes on runs held out of its training."""

    error_: float


@dataclass(frozen=True)
class MethodEntry:
    """A method in a registry.

    title: as a reader sees it. make: gives an unfitted one. gives_interval: its intervals are each record's own, not of
    one width for all. seeks_impact: it does not take the moment of the impact for known. told: an evaluation tells it
    where and when the stones of a run fall.
    """

    title: str
    make: Callable[[], Method]
    gives_interval: bool = True
    seeks_impact: bool = False
    told: bool = False


#: Methods by name.
Registry = Mapping[str, MethodEntry]


class RatioEstimator(RegressorMixin, BaseEstimator):
    """A method whose X is an array of numbers and whose `predict` gives mixing ratios; `score` is R^2.

    Its parameters are those of its constructor, which stores them as they are given.
    """

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True  # a law of impacts fits no made-up data
        return tags


class RecordEstimator(RatioEstimator):
    """One whose X has three dimensions: runs, rows of a record, columns."""

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array, tags.input_tags.three_d_array = False, True
        return tags
