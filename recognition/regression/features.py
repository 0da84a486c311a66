"""Features of a record for regressions: energies in windows of time and bands of frequency.

All accelerometers are taken together, so that the features hardly depend on the arrangement of the stones. A greater
energy of the impact raises all of them, damping changes the later windows, a higher impact speed the upper bands.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pandas as pd

from recognition.estimation.arrays import Floats
from recognition.estimation.channels import channels_of
from recognition.estimation.errors import RecognitionError

#: Ends of windows in shares of the record, ends of bands in shares of half its sample rate.
WINDOWS = (0.0, 0.025, 0.125, 0.375, 1.0)
BANDS = (0.0, 0.1, 0.25, 0.5, 1.0)


def log_rms(signals: Floats, windows: tuple[float, ...] = WINDOWS, bands: tuple[float, ...] = BANDS) -> Floats:
    """Logarithm of the rms of all signals (m, n) together in each window, then of their spectrum in each band."""
    ends = np.round(np.array(windows) * signals.shape[1]).astype(int)
    parts = [np.sqrt(np.mean(signals[:, a:b] ** 2)) for a, b in pairwise(ends)]
    spectrum = np.abs(np.fft.rfft(signals, axis=1)) ** 2
    ends = np.round(np.array(bands) * spectrum.shape[1]).astype(int)
    parts += [np.sqrt(np.sum(spectrum[:, a:b])) for a, b in pairwise(ends)]
    if min(parts) <= 0:
        raise RecognitionError("the record is silent in a window or a band")
    return np.log(parts)


def _without_errors(features: Floats) -> Floats:
    """The noise of the sensors hardly changes an rms of many samples."""
    return np.stack([features, np.zeros_like(features)])


def energies_sensors(signals: pd.DataFrame) -> Floats:
    """Windows and bands of the accelerometers."""
    return _without_errors(log_rms(channels_of(signals, "accelerometers")))


#: name -> features of a record and their standard errors by the noise of the sensors, shape (2, p).
FEATURES: dict[str, Callable[[pd.DataFrame], Floats]] = {"energies_sensors": energies_sensors}
