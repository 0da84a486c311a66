"""What a method says of one record."""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan, nan


@dataclass(frozen=True)
class Answer:
    """Mixing ratio of one record.

    ratio: not clipped to 0..1, NaN where there is none, and then `reason` says why. low, high: ends of the 90 %
    interval, NaN from a method without intervals. out_of_distribution: why the record is unlike those of the training,
    "" if it is not.
    """

    ratio: float
    low: float = nan
    high: float = nan
    out_of_distribution: str = ""
    reason: str = ""

    @classmethod
    def none(cls, reason: str) -> Answer:
        """No ratio, and why."""
        return cls(nan, reason=reason)

    @property
    def has_interval(self) -> bool:
        return not (isnan(self.low) or isnan(self.high))
