"""Another sample rate, with the anti-alias filter or without.

The paper's signals are at 6667 Hz without any filter, so that vibration above 3333 Hz folds back below it. The filter
takes such vibration away instead, and the peaks of a contact (about 0.2 ms) become lower.
"""

from dataclasses import replace
from fractions import Fraction

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import firwin, resample_poly

from analysis.signals.records import Record, RecordError, Signal, as_record

#: Rates are taken as the nearest ratio of whole numbers up to MAX_FACTOR, which may be NEAR off: no clock is as exact
#: as its nominal rate.
MAX_FACTOR, NEAR = 1000, 1e-3

#: Points between two samples, from which cubic splines take what lies between: within 1e-3 of a tone up to 0.8 of half
#: the rate.
FINER = 8

#: Samples that a record may get: 0.8 GB.
MAX_SAMPLES = 100_000_000


def resample(signal: Signal, rate_Hz: float, *, anti_alias: bool = True) -> Record:
    """Return a record, or what `as_record` makes one of, at another rate, its first sample at the same time.

    With `anti_alias` a low pass of linear phase and no delay (scipy's polyphase filter) comes before the samples are
    taken, in a ratio of whole numbers: `rate_Hz` of the result is what that gives, at most NEAR off. Without it every
    k-th sample is kept, or what lies between samples is taken. Raises RecordError for less than 1 / MAX_FACTOR or more
    than MAX_FACTOR times the rate, and more than MAX_SAMPLES samples.

    >>> resample(Record(np.ones(300), rate_Hz=51_200.0), 20_000.0).values.size
    118
    """
    record = as_record(signal)
    if not 0 < rate_Hz <= MAX_FACTOR * record.rate_Hz:
        raise RecordError(f"{record.name}: a rate of {rate_Hz:.6g} Hz; must be above 0, and at most {MAX_FACTOR} times "
                          f"that of the record, {record.rate_Hz:.6g} Hz")
    samples = record.values.size * rate_Hz / record.rate_Hz
    if samples > MAX_SAMPLES:
        raise RecordError(f"{record.name}: {rate_Hz:.6g} Hz gives {samples:.3g} samples; at most {MAX_SAMPLES:.0e}")
    if not anti_alias:
        return replace(record, values=_sampled(record, rate_Hz), rate_Hz=rate_Hz)
    ratio = rate_ratio(record.rate_Hz, rate_Hz)
    if abs(float(ratio) * record.rate_Hz / rate_Hz - 1) > NEAR:
        rates = f"{record.rate_Hz:.6g} Hz to {rate_Hz:.6g} Hz"
        raise RecordError(f"{record.name}: {rates} is no ratio of whole numbers up to {MAX_FACTOR}")
    # The ends are continued by their own values: a record need not begin or end at zero.
    values = resample_poly(record.values, ratio.numerator, ratio.denominator, padtype="edge")
    return replace(record, values=np.array(values), rate_Hz=record.rate_Hz * float(ratio))


def rate_ratio(from_Hz: float, to_Hz: float) -> Fraction:
    """Samples that `resample` makes of one."""
    return Fraction(to_Hz / from_Hz).limit_denominator(MAX_FACTOR)


class Resampler:
    """As `resample` with the filter, of channels (c, samples) as they come. RecordError as there."""

    def __init__(self, from_Hz: float, to_Hz: float, channels: int, name: str) -> None:
        resample(Record(np.zeros(2 * MAX_FACTOR), from_Hz, name=name), to_Hz)  # which refuses what it cannot do
        ratio = rate_ratio(from_Hz, to_Hz)
        self.up, self.down = ratio.numerator, ratio.denominator
        self.about = 0 if ratio == 1 else -(-10 * max(self.up, self.down) // self.up)  # samples that the filter sees
        self.before = -(-self.about // self.down) * self.down  # the same, in whole periods
        self.values = np.zeros((channels, 0))  # from `before` samples ahead of what comes next

    def more(self, values: np.ndarray) -> np.ndarray:
        """What is certain with further samples."""
        begins = not self.values.shape[1]
        self.values = np.hstack([np.repeat(values[:, :1], self.before, axis=1) if begins else self.values, values])
        periods = max(self.values.shape[1] - self.before - self.about, 0) // self.down
        return self._taken(periods * self.down, periods * self.up)

    def end(self) -> np.ndarray:
        """The rest."""
        left = self.values.shape[1] - self.before
        if left <= 0 or not self.before:
            return self.values[:, :0]
        self.values = np.hstack([self.values, np.repeat(self.values[:, -1:], self.about, axis=1)])
        return self._taken(left, -(-left * self.up // self.down))

    def _taken(self, samples: int, count: int) -> np.ndarray:
        part, self.values = self.values[:, :self.before + samples + self.about], self.values[:, samples:]
        if self.up == self.down:
            return np.array(part)
        first = self.before * self.up // self.down
        return np.array(resample_poly(part, self.up, self.down, axis=1)[:, first:first + count])


def low_pass(factor: int) -> tuple[np.ndarray, int]:
    """The filter before every factor-th sample is taken, (2 k + 1,), and k, the samples that it looks ahead."""
    ahead = 10 * factor if factor > 1 else 0
    return np.asarray(firwin(2 * ahead + 1, 1 / factor, window=("kaiser", 5.0)) if ahead else np.ones(1)), ahead


def _sampled(record: Record, rate_Hz: float) -> np.ndarray:
    """Every k-th sample, or what lies between samples."""
    times = record.rate_Hz / rate_Hz
    if abs(times / max(round(times), 1) - 1) < 1e-6:
        return record.values[:: round(times)].copy()
    fine = resample_poly(record.values, FINER, 1, padtype="edge")
    wanted = np.arange(int((record.values.size - 1) / times * (1 + 1e-9)) + 1) * times
    return np.asarray(CubicSpline(np.arange(fine.size) / FINER, fine)(wanted), float)
