"""Whether stones on this plate explain a record; where they do not, no ratio is given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.stream.listen import Listener

HUM_Hz = (50.0, 60.0)


@dataclass(frozen=True)
class Limits:
    """The most that a record may have, docs/listening.md says from which records."""

    unexplained: float = 0.15
    gain: float = 0.15


@dataclass(frozen=True)
class Checks:
    """unexplained: share of the innovations' energy above that of noise that no stone explains. gain (c,): of each
    channel, relative to what the stones make of all channels."""

    unexplained: float
    gain: Floats

    @classmethod
    def of(cls, listener: Listener) -> Checks:
        whole, left = (values[:, :listener.end] for values in (listener.whole, listener.left))
        explained = whole - left
        gain = np.sum(whole * explained, axis=1) / np.maximum(np.sum(explained**2, axis=1), 1e-300)
        return cls(listener.unexplained(listener.end), gain)

    def reason(self, limits: Limits = Limits()) -> str:
        """Which limits are exceeded, "" if none is."""
        found = [(f"{self.unexplained:.0%} of what happened is unexplained", self.unexplained, limits.unexplained),
                 ("a channel's gain is off", float(np.max(np.abs(self.gain - 1))), limits.gain)]
        return "; ".join(f"{text}, limit {limit:g}" for text, value, limit in found if value > limit)


def without_offset_and_hum(values: Floats, rate_Hz: float) -> Floats:
    """Channels (c, samples) less a constant and the mains' hum: no mode of a plate is as low."""
    t = np.arange(values.shape[1]) / rate_Hz
    columns = [np.ones_like(t)]
    for f in HUM_Hz:
        columns += [np.cos(2 * np.pi * f * t), np.sin(2 * np.pi * f * t)]
    basis = np.array(columns)
    factors = np.linalg.lstsq(basis @ basis.T, basis @ values.T, rcond=None)[0]
    return np.asarray(values - factors.T @ basis)
