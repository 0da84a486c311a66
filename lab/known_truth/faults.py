"""Faults of four channels: what each makes of a record (channels, samples)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from recognition.estimation.arrays import Floats

#: The record and its sample rate in Hz give the faulty one.
Fault = Callable[[Floats, float], Floats]


def factors(*of_channels: float) -> Fault:
    """Gains of the channels."""
    return lambda values, rate_Hz: values * np.array(of_channels)[:, None]


def _changed(channel: int, change: Callable[[Floats, Floats], Floats]) -> Fault:
    """One channel, by its values and the times in s."""
    def fault(values: Floats, rate_Hz: float) -> Floats:
        other = values.copy()
        other[channel] = change(values[channel], np.arange(values.shape[1]) / rate_Hz)
        return other
    return fault


def _peak(x: Floats) -> float:
    return float(abs(x).max())


FAULTS: dict[str, Fault] = {
    "gains +5, -5, +5, -5 %": factors(1.05, 0.95, 1.05, 0.95),
    "one gain 0.8": factors(1.0, 0.8, 1.0, 1.0),
    "wrong sign": factors(1.0, -1.0, 1.0, 1.0),
    "two sensors swapped": lambda values, rate_Hz: values[[1, 0, 2, 3]],
    "offset of 5 % of the peak": _changed(1, lambda x, t_s: x + 0.05 * _peak(x)),
    "50 Hz of 5 % of the peak": _changed(2, lambda x, t_s: x + 0.05 * _peak(x) * np.sin(2 * np.pi * 50 * t_s)),
    "clipped at 40 %": _changed(0, lambda x, t_s: np.clip(x, -0.4 * _peak(x), 0.4 * _peak(x))),
    "dead channel": factors(1.0, 1.0, 1.0, 1e-3),
}
