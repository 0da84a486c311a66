"""The protocol that every method of recognition keeps, and the entry by which a registry names it.

Methods are estimators of scikit-learn: `clone`, `cross_val_score`, `GridSearchCV` and pipelines take them, and they
pass `sklearn.utils.estimator_checks.check_estimator`, which for X of three dimensions checks little more than that a
copy can be made. `ArrangementLikelihood` is no estimator: its records are objects.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.exceptions import NotFittedError

from analysis.sweep.runs import Run
from recognition.estimation.answer import Answer, answers_within
from recognition.estimation.arrays import Floats, finite, training
from recognition.estimation.calibration import held_out_width

#: A value for each run; runs of one draw of arrangement and packing share it.
Groups = Sequence[Any] | NDArray[Any]


class Method(Protocol):
    """A record becomes features, features train the method, and the trained method answers.

    A method is a dataclass, which the model file holds. `fit` sets its fields ending in an underscore:
    `error_` is the mean error of the ratio on runs held out of the training, where the method knows it.
    """

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Any:
        """Features of one record: a table with t_s and the plate's responses in SI units, cut to the window.

        run: the simulated run that the signals are from, where the method may be trained on it; its files may say more
        than the record does. RecognitionError names a column that is missing.
        """

    def fit(self, X: Sequence[Any], y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> Self:
        """Train on the features X of n runs of ratio y (n,), 0..1, and return the method itself.

        groups (n,): runs that share a value are held out together. nuisance: a row for each run, a column for each
        condition that varied and that a record does not tell. RecognitionError where the runs do not allow it.
        """

    def answer(self, X: Sequence[Any]) -> list[Answer]:
        """Answers to records by their features."""

    def summary(self) -> str:
        """What was learnt, in a few words."""


@dataclass(frozen=True)
class MethodEntry:
    """A method in a registry.

    title: as a reader sees it. make: gives an unfitted one. seeks_impact: it does not take the moment of the impact for
    known. told: an evaluation tells it where and when the stones of a run fall.
    """

    title: str
    make: Callable[[], Method]
    seeks_impact: bool = False
    told: bool = False


#: Methods by name.
Registry = Mapping[str, MethodEntry]


class Fitted(BaseEstimator):
    """What `fit` sets ends in an underscore, and scikit-learn's NotFittedError says where it is not set."""

    def __getattr__(self, name: str) -> Any:
        if name.endswith("_") and not name.startswith("_"):
            raise NotFittedError(f"{type(self).__name__} is not fitted yet; call fit first")
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")


@dataclass(eq=False)
class RecordEstimator(RegressorMixin, Fitted):
    """A method that learns from features of records (`learn`), arrays of one shape, and finds a ratio by those of one
    (`ratio_of`). X has three dimensions or more: runs, a record and its `noisy_copies`, features.

    Its parameters are those of its constructor, which stores them as they are given; `score` is R^2."""

    width_: float = field(init=False, repr=False)

    def fit(self, X: Sequence[Floats] | Floats, y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> Self:
        """y: ratios (runs,), 0..1. Groups tell the width of the intervals, conditions play no part."""
        every, ratios = training(X, y, 3)
        features = every[:, 0]
        self.width_ = held_out_width(clone(self), features, ratios, groups)
        return self.learn(features, ratios)

    def learn(self, features: Floats, ratios: Floats) -> Self:
        """From features (runs, ...) and ratios (runs,), without intervals."""
        raise NotImplementedError

    def ratio_of(self, features: Floats) -> float:
        """Mixing ratio of one record, not clipped. Raises NotRecognised."""
        raise NotImplementedError

    def predict(self, X: Sequence[Floats] | Floats) -> Floats:
        """Mixing ratio of each record, shape (runs,). Raises NotRecognised."""
        return np.array([self.ratio_of(x[0]) for x in finite("X", X, 3)])

    def answer(self, X: Sequence[Floats] | Floats) -> list[Answer]:
        """Ratios, with intervals by the errors on what was held out of the training, and by each record's noise."""
        return answers_within(self.width_, self.ratio_of, finite("X", X, 3))

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True  # a law of impacts fits no made-up data
        tags.input_tags.two_d_array, tags.input_tags.three_d_array = False, True
        return tags
