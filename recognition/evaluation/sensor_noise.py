"""Noise of sensors on a record."""

from __future__ import annotations

import numpy as np
import pandas as pd


def same_per_hertz(noise_db: float | None, rate_factor: int) -> float | None:
    """Of noise that is noise_db below a signal's rms, the level at so many times the sample rate where white noise has
    the same power in each hertz."""
    return None if noise_db is None else noise_db - 10 * float(np.log10(rate_factor))


def with_noise(signals: pd.DataFrame, noise_db: float | None, rng: np.random.Generator) -> pd.DataFrame:
    """The record with white Gaussian noise on every signal but the time, noise_db below each signal's rms.

    None: as it is.
    """
    if noise_db is None:
        return signals
    values = signals.drop(columns="t_s")
    rms = np.sqrt(np.mean(np.square(values.to_numpy(dtype=float)), axis=0))
    noisy = values + rms * 10 ** (-noise_db / 20) * rng.standard_normal(values.shape)
    noisy.insert(0, "t_s", signals["t_s"])
    return noisy
