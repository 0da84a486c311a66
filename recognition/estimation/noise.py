"""Noise of the sensors of a record: how loud it is, and records with more of it."""

from zlib import crc32

import numpy as np
import pandas as pd

from recognition.estimation.arrays import Floats

COPIES = 8
LEAST_SAMPLES = 4  # that have a third difference


def noise_of(signals: Floats) -> Floats:
    """Standard deviation (m,) of white noise on smooth signals (m, n): of their third differences, over the last
    quarter, where the plate's high modes have died away. At 6667 Hz what is left of them counts as noise of 1 %."""
    late = signals[:, -max(LEAST_SAMPLES, signals.shape[1] // 4):]
    return np.asarray(np.sqrt(np.mean(np.diff(late, 3, axis=1) ** 2, axis=1) / 20))


def with_noise(signals: pd.DataFrame, noise_db: float | None, rng: np.random.Generator) -> pd.DataFrame:
    """The record with white Gaussian noise on every signal but the time, noise_db below each signal's rms.

    None: as it is.
    """
    if noise_db is None:
        return signals
    values = _values(signals)
    rms = np.sqrt(np.mean(np.square(values.to_numpy(dtype=float)), axis=0))
    return _plus(signals, values, rms * 10 ** (-noise_db / 20), rng)


def noisy_copies(signals: pd.DataFrame) -> list[pd.DataFrame]:
    """The record, and COPIES with its noise once more: they change an answer by about as much as the noise did."""
    values = _values(signals)
    numbers = values.to_numpy(dtype=float)
    noise, rng = noise_of(numbers.T), np.random.default_rng(crc32(numbers.tobytes()))
    return [signals, *(_plus(signals, values, noise, rng) for _ in range(COPIES))]


def _plus(signals: pd.DataFrame, values: pd.DataFrame, noise: Floats, rng: np.random.Generator) -> pd.DataFrame:
    """The record with noise on its `values`. As arrays, which pandas takes faster than a table."""
    noisy = values.to_numpy(dtype=float) + noise * rng.standard_normal(values.shape)
    return signals.assign(**dict(zip(values.columns, noisy.T, strict=True)))


def _values(signals: pd.DataFrame) -> pd.DataFrame:
    """All but the time, and what is no number."""
    return signals.select_dtypes("number").drop(columns="t_s", errors="ignore")
