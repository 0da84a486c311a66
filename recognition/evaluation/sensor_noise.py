"""Noise of sensors on a record."""

from __future__ import annotations

import numpy as np
import pandas as pd


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
