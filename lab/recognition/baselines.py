"""What the laboratory compares with the methods of a model: the impulse, which takes the mean velocity of the plate, and a
straight line."""

from __future__ import annotations

import numpy as np
import pandas as pd
from sklearn.linear_model import LinearRegression

from analysis.runs import Run
from lab.recognition.impulse import impulse
from recognition.estimation.arrays import Floats
from recognition.estimation.channels import channels_of
from recognition.estimation.method import MethodEntry, Registry
from recognition.methods import METHODS
from recognition.regression.feature_regression import EstimatorMethod, FeatureRegression


def rms_of_acceleration(signals: pd.DataFrame) -> Floats:
    """Root mean square of the centre of mass' acceleration, shape (1,)."""
    return np.asarray(np.sqrt(np.mean(channels_of(signals, "centre")[1:] ** 2, axis=1)))


class ImpulseRegression(FeatureRegression):
    """A Gaussian process on the stones' impulse and its standard error, shape (2, 1), which take other channels."""

    def __init__(self) -> None:
        super().__init__("rms")

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> Floats:
        found = impulse(signals)
        return np.array([[found.impulse_N_s], [found.standard_error_N_s]])


def _line() -> EstimatorMethod:
    return EstimatorMethod(rms_of_acceleration, LinearRegression())


BASELINES: Registry = {
    "impulse": MethodEntry("impulse from plate and rods", ImpulseRegression),
    "rms_line": MethodEntry("RMS and a straight line", _line),
}
EVALUATED: Registry = {**METHODS, **BASELINES}
