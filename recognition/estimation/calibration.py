"""Quantiles of what a method does on held-out records: widths of intervals, and limits of the distribution."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from sklearn.model_selection import GroupKFold

from recognition.estimation.arrays import Floats, Integers
from recognition.estimation.errors import NotRecognised, RecognitionError

#: A record is out of distribution where one of its distances exceeds this factor times the value that this share of the
#: held-out training records keep, or times 1, whichever is greater. The share is not 1, since a record from the end of
#: a range that was held out is itself far from the training.
LIMIT_FACTOR, REFERENCE_SHARE = 1.5, 0.95
LEAST_GROUPS = 3
COVERAGE, FOLDS = 0.9, 5  # of intervals, and of what is held out for them


def held_out_quantile(values: Floats, share: float) -> Floats:
    """The least of `values` (n, ...) that a further one does not pass with probability `share` (conformal prediction);
    the largest if n is too small for that."""
    rank = int(np.ceil(share * (len(values) + 1)))
    return np.sort(values, axis=0)[min(rank, len(values)) - 1]


def held_out(y: Floats, groups: Any) -> Iterator[tuple[Integers, Integers]]:
    """Numbers of the runs to train on and to hold out: groups (runs,), or ratios y (runs,) where there are fewer than
    three groups, as in the paper's eleven runs; intervals then know nothing of other arrangements. RecognitionError for
    fewer than three ratios."""
    keys = y if groups is None or np.unique(groups).size < LEAST_GROUPS else np.asarray(groups)
    if np.unique(keys).size < LEAST_GROUPS:
        raise RecognitionError(f"{np.unique(keys).size} different ratios; intervals need at least {LEAST_GROUPS}")
    yield from GroupKFold(min(FOLDS, np.unique(keys).size)).split(y, groups=keys)


def held_out_width(method: Any, X: Floats, y: Floats, groups: Any) -> float:
    """Half the width of 90 % intervals of ratios y (n,) by `method.ratio_of`, by its errors on what was held out of
    `method.learn` (conformal prediction by cross-validation, Vovk 2015, Ann. Math. Artif. Intell. 74:9); 1 where
    nothing is answered, or is too little to hold out."""
    errors = []
    try:
        for train, test in held_out(y, groups):
            method.learn(X[train], y[train])
            for k in test:
                with suppress(NotRecognised):
                    errors.append(abs(method.ratio_of(X[k]) - y[k]))
    except (RecognitionError, ValueError):  # of so few that no law is left
        return 1.0
    return min(1.0, float(held_out_quantile(np.array(errors), COVERAGE))) if errors else 1.0


def distance_limits(distances: Floats) -> Floats:
    """Limits (k,) from distances (n, k) of held-out records to their training, 1 being as expected."""
    return LIMIT_FACTOR * np.maximum(1.0, held_out_quantile(distances, REFERENCE_SHARE))


def reason_out_of_distribution(names: Sequence[str], distances: Floats, limits: Floats) -> str:
    """Which distances (k,) exceed their limits (k,), "" if none does."""
    return "; ".join(f"{name} {distance:.3g}, limit {limit:.3g}"
                     for name, distance, limit in zip(names, distances, limits, strict=True) if distance > limit)
