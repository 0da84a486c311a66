"""Types of arrays, and checks of them. A field of a fitted method that is one of these goes into the model file."""

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recognition.estimation.errors import RecognitionError

Floats: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
Booleans: TypeAlias = NDArray[np.bool_]


def finite(name: str, values: ArrayLike, dimensions: int) -> Floats:
    """Numbers in at least so many dimensions, none of them empty. RecognitionError for others."""
    try:
        if np.iscomplexobj(values):
            raise TypeError
        numbers = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise RecognitionError(f"{name}: must be real numbers in one shape") from None
    if numbers.ndim < dimensions or numbers.size == 0:
        raise RecognitionError(f"{name} has shape {numbers.shape}; needs {dimensions} dimensions, none of them empty")
    if not np.isfinite(numbers).all():
        raise RecognitionError(f"{name}: every value must be finite")
    return numbers


def training(X: ArrayLike, y: ArrayLike, dimensions: int) -> tuple[Floats, Floats]:
    """What is learnt of runs: numbers X of each, ratios y (runs,), 0 to 1. RecognitionError where they disagree."""
    numbers, ratios = finite("X", X, dimensions), finite("y", y, 1)
    if ratios.shape != numbers.shape[:1]:
        raise RecognitionError(f"y has shape {ratios.shape}; needs a ratio for each of {len(numbers)} runs")
    if ratios.min() < 0 or ratios.max() > 1:
        raise RecognitionError(f"y: {ratios.min():g} to {ratios.max():g}; mixing ratios are from 0 to 1")
    return numbers, ratios
