"""Whether stones on this plate explain a record; where they do not, no ratio is given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import NotRecognised
from recognition.innovations.bank import TIME
from recognition.sensors.channel_check import channel_faults
from recognition.stream.listen import Heard, Listener

HUM_Hz = (50.0, 60.0)
TOGETHER_S = 0.2e-3  # stones that arrive within it of each other are not told apart well
UNLIKE = -3.0  # log evidence of a stone, against all that is conceivable, below which it is none of those that are told


@dataclass(frozen=True)
class Limits:
    """The most that a record may have, between good records and those with a wrong ratio (docs/listening.md). gain:
    deviation from one; 5 % does no harm."""

    unexplained: float = 0.08
    gain: float = 0.1
    unlike: float = 0.05
    broken: float = 0.5
    together: float = 0.3
    change: float = 1.8


@dataclass(frozen=True)
class Checks:
    """unexplained: share of the innovations' energy above that of noise that no stone explains. gain (c,): of each
    channel, relative to what the stones make of all channels. unlike: share of stones that are none of the sizes,
    speeds and materials that there should be. broken: share of stones that seem to have broken, less the share that
    breaks at their speeds: stones of another size seem so. together: share of stones that arrive within TOGETHER_S of
    another; at 200 a second it is 8 %. change: of the noise in the quiet beginning (coloured_noise.py)."""

    unexplained: float
    gain: Floats
    unlike: float
    broken: float
    together: float
    change: float

    @classmethod
    def of(cls, listener: Listener, heard: Sequence[Heard], change: float) -> Checks:
        whole, left = (values[:, listener.begin:listener.end] for values in (listener.whole, listener.left))
        explained = whole - left
        gain = np.sum(whole * explained, axis=1) / np.maximum(np.sum(explained**2, axis=1), 1e-300)
        evidence = np.array([h.log_evidence.max() for h in heard])
        at_s = np.array([h.stone[TIME] for h in heard]) / listener.bank.rate_Hz
        broken = [h.more_broken[h.log_evidence.argmax()] for h in heard]
        return cls(listener.unexplained(listener.end), gain, float(np.mean(evidence < UNLIKE)) if heard else 0.0,
                   float(np.mean(broken)) if heard else 0.0,
                   together(at_s), change)

    def reason(self, limits: Limits = Limits()) -> str:
        """Which limits are exceeded, "" if none is."""
        found = [(f"{self.unexplained:.0%} of what happened is unexplained", self.unexplained, limits.unexplained),
                 ("a channel's gain is off", float(np.max(np.abs(self.gain - 1))), limits.gain),
                 (f"{self.unlike:.0%} of the stones have other sizes, speeds or materials than they should",
                  self.unlike, limits.unlike),
                 (f"{self.broken:.0%} more of the stones seem broken than should be: they may have another size",
                  self.broken, limits.broken),
                 (f"{self.together:.0%} of the stones arrive at once with another (`volley` is for those)",
                  self.together, limits.together),
                 ("the beginning is not quiet, or its noise changes", self.change, limits.change)]
        return "; ".join(f"{text}, limit {limit:g}" for text, value, limit in found if value > limit)


def together(time_s: Floats) -> float:
    """Share of arrivals (n,) that are within TOGETHER_S of another."""
    near = np.diff(np.sort(time_s)) < TOGETHER_S
    return float(np.mean(np.append(near, False) | np.append(False, near))) if len(time_s) else 0.0


def refuse_faulty(accelerations: Floats, names: Sequence[str]) -> None:
    """Raises NotRecognised, one line, for accelerometers (c, samples) that are dead or clipped."""
    if found := channel_faults(accelerations, names):
        raise NotRecognised("; ".join(found))


def without_offset_and_hum(values: Floats, rate_Hz: float) -> Floats:
    """Channels (c, samples) less a constant and the mains' hum: no mode of a plate is as low."""
    t = np.arange(values.shape[1]) / rate_Hz
    columns = [np.ones_like(t)]
    for f in HUM_Hz:
        columns += [np.cos(2 * np.pi * f * t), np.sin(2 * np.pi * f * t)]
    basis = np.array(columns)
    factors = np.linalg.lstsq(basis @ basis.T, basis @ values.T, rcond=None)[0]
    return np.asarray(values - factors.T @ basis)
