"""Whether stones on this plate explain a record; where they do not, no ratio is given."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import NotRecognised
from recognition.sensors.channel_check import channel_faults

HUM_Hz = (50.0, 60.0)
TOGETHER_S = 0.2e-3  # stones that arrive within it of each other are not told apart well


@dataclass(frozen=True)
class Checks:
    """unexplained: share of the innovations' energy above that of noise that no stone explains. gain (c,): of each
    channel, relative to what the stones make of all channels. none: share of what was heard that is no stone. beyond:
    how far the stones are from the radii and speeds that were told, in standard deviations. misplaced: share of known
    stones that seem to be of the other material. together: share of stones that arrive within TOGETHER_S of another; at
    200 a second it is 8 %. change: of the noise in the quiet beginning (coloured_noise.py). unheard: share of
    the stones of the radii and speeds told that are too weak; of those around them more are lost beside others."""

    unexplained: float
    gain: Floats
    together: float
    change: float
    unheard: float
    none: float = 0.0
    beyond: float = 0.0
    misplaced: float = 0.0

    def reason(self) -> str:
        """Which limits are exceeded, "" if none is. They lie between good records and those with a wrong ratio
        (docs/listening.md); a gain that is 5 % off does no harm."""
        off = np.abs(self.gain - 1)
        found = [(f"{self.unexplained:.0%} of what happened is unexplained", self.unexplained, 0.08),
                 (f"a channel's gain is off by {off.max():.0%}, that of channel {off.argmax() + 1}", off.max(), 0.1),
                 (f"{self.none:.0%} of what was heard is no stone as the others", self.none, 0.3),
                 (f"the stones are {self.beyond:.1f} standard deviations off --radius and --speed", self.beyond, 3.5),
                 (f"{self.misplaced:.0%} of the known stones seem to be of the other material", self.misplaced, 0.34),
                 (f"{self.together:.0%} of the stones arrive at once with another (`volley` is for those)",
                  self.together, 0.3),
                 (f"{self.unheard:.0%} of the stones of --radius and --speed are too weak to be heard in this noise",
                  self.unheard, 0.1),
                 ("the beginning is not quiet, or its noise changes", self.change, 1.8)]
        return "; ".join(f"{text}, limit {limit:{'.0%' if '%' in text else 'g'}}" for text, value, limit in found
                         if value > limit)


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
    mains = Mains(len(values), rate_Hz)
    mains.learn(values, 0)
    return np.asarray(values - mains.at(0, values.shape[1]))


class Mains:
    """Offset and hum of channels, by least squares over what was learnt."""

    def __init__(self, channels: int, rate_Hz: float) -> None:
        self.rate_Hz, size = rate_Hz, 1 + 2 * len(HUM_Hz)
        self.squares, self.products = np.zeros((size, size)), np.zeros((size, channels))

    def learn(self, values: Floats, first: int, memory: float = 1.0) -> None:
        """From channels (c, samples) from sample `first` on; what was learnt counts by `memory` of what it did."""
        basis = self._basis(first, values.shape[1])
        self.squares = memory * self.squares + basis @ basis.T
        self.products = memory * self.products + basis @ values.T
        self.factors = np.linalg.lstsq(self.squares, self.products, rcond=None)[0]

    def at(self, first: int, count: int) -> Floats:
        """(c, count): their sum from sample `first` on."""
        return np.asarray(self.factors.T @ self._basis(first, count))

    def _basis(self, first: int, count: int) -> Floats:
        turn = 2 * np.pi * np.outer(HUM_Hz, np.arange(first, first + count) / self.rate_Hz)
        return np.vstack([np.ones(count), np.cos(turn), np.sin(turn)])
