"""Records of taps at known places."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError

#: Where a record first exceeds so much of its largest sample, and so many standard deviations of its first samples (but
#: no more than the last share), the tap has begun.
ONSET_SHARE, ONSET_DEVIATIONS, ONSET_AT_MOST, FIRST_SAMPLES = 0.05, 6.0, 0.3, 40
SILENT = 1e-30  # no sample of a tap is as small, in any unit
LEAST_SILENCE = 30  # samples before the tap from which the sensors' noise is taken


@dataclass(frozen=True)
class Tap:
    """One tap. place_m (2,); acceleration (s, t), m/s^2 upwards, of each sensor; force_N (t,), downwards, sampled at
    the same instants, None where it was not measured. The plate is at rest when the record begins.

    Raises RecognitionError for records that are empty, not finite or do not fit each other.
    """

    place_m: Floats
    acceleration: Floats
    rate_Hz: float
    force_N: Floats | None = None
    name: str = "tap"

    def __post_init__(self) -> None:
        signals = [self.acceleration] + ([] if self.force_N is None else [self.force_N])
        if not all(np.isfinite(signal).all() for signal in signals):
            raise RecognitionError(f"{self.name}: a sample is not finite")
        if self.force_N is not None and self.force_N.shape != self.acceleration.shape[1:]:
            raise RecognitionError(f"{self.name}: {self.force_N.size} samples of force; needs those of acceleration")
        if not all((abs(np.atleast_2d(signal)).max(axis=1, initial=0) > SILENT).all() for signal in signals):
            raise RecognitionError(f"{self.name}: all samples of a sensor are zero; needs a tap")

    @cached_property
    def onset(self) -> int:
        """First sample of the tap, by the force where there is one."""
        signal = abs(self.acceleration if self.force_N is None else self.force_N[None])
        largest = signal.max(axis=1, keepdims=True)
        quiet = ONSET_DEVIATIONS * np.sqrt(np.mean(signal[:, :FIRST_SAMPLES] ** 2, axis=1, keepdims=True))
        level = np.clip(quiet, ONSET_SHARE * largest, ONSET_AT_MOST * largest)
        return int((signal > level).any(axis=0).argmax())

    @cached_property
    def noise(self) -> Floats:
        """(s,): standard deviation of each sensor's noise, from before the tap; zero where that is too short to say."""
        silence = self.acceleration[:, : self.onset * 4 // 5]
        return silence.std(axis=1) if silence.shape[1] >= LEAST_SILENCE else np.zeros(len(self.acceleration))

    @property
    def duration_s(self) -> float:
        return self.acceleration.shape[1] / self.rate_Hz


def check_taps(taps: Sequence[Tap], sensors: int) -> None:
    """Raises RecognitionError for taps that cannot be fitted together."""
    if not taps:
        raise RecognitionError("no taps; needs at least one")
    first = taps[0]
    for tap in taps:
        if tap.acceleration.shape[0] != sensors:
            raise RecognitionError(f"{tap.name}: {tap.acceleration.shape[0]} accelerometers; the plate has {sensors}")
        if not np.isclose(tap.rate_Hz, first.rate_Hz, rtol=1e-6):
            raise RecognitionError(f"{tap.name}: {tap.rate_Hz:g} Hz; needs {first.rate_Hz:g} as {first.name}")
