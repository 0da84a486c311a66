"""What a method says of one record."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot, isnan, nan, sqrt
from typing import Self

from recognition.estimation.arrays import Floats
from recognition.estimation.errors import NotRecognised

#: An interval that reaches farther than this to either side of the ratio calls for a warning.
WIDE_points = 5.0
NINE_IN_TEN = 1.645  # standard deviations of a normal law to either side


@dataclass(frozen=True)
class Answer:
    """Mixing ratio of one record.

    ratio: not clipped to 0..1, NaN where there is none, and then `reason` says why. low, high: ends of the 90 %
    interval, or NaN. out_of_distribution: why the record is unlike those of the training, "" if it is not.

    >>> Answer(0.31, low=0.28, high=0.34).text
    '31.0 %, 90 % interval 28.0 to 34.0'
    """

    ratio: float
    low: float = nan
    high: float = nan
    out_of_distribution: str = ""
    reason: str = ""

    @classmethod
    def between(cls, low: float, ratio: float, high: float) -> Self:
        """A ratio between the ends of its interval."""
        return cls(ratio, low, high)

    @property
    def has_interval(self) -> bool:
        return not (isnan(self.low) or isnan(self.high))

    @property
    def warning(self) -> str:
        """What is printed of an interval that is so wide that the ratio alone would mislead, "" of any other."""
        reach_points = 100 * max(self.ratio - self.low, self.high - self.ratio)
        if not reach_points > WIDE_points + 1e-9:  # ratios are rounded
            return ""
        return f"WARNING: uncertain, the 90 % interval reaches {reach_points:.1f} points from the ratio"

    @property
    def text(self) -> str:
        """Ratio and interval in per cent."""
        return f"{100 * self.ratio:.1f} %, 90 % interval {100 * self.low:.1f} to {100 * self.high:.1f}"


def answers_within(width: float, ratio_of: Callable[[Floats], float], X: Sequence[Floats] | Floats) -> list[Answer]:
    """The ratio of each record, whose features are followed by those of its `noisy_copies`, within `width` to either
    side and what the copies change, 1 where they have no ratio; no answer where `ratio_of` raises NotRecognised."""
    def answer(x: Floats) -> Answer:
        try:
            ratio = ratio_of(x[0])
        except NotRecognised as reason:
            return Answer(nan, reason=f"no answer: {reason}")
        reach = hypot(width, NINE_IN_TEN * sqrt(sum(change(copy, ratio)**2 for copy in x[1:]) / max(1, len(x) - 1)))
        return Answer(ratio, ratio - reach, ratio + reach)

    def change(copy: Floats, ratio: float) -> float:
        try:
            return ratio_of(copy) - ratio
        except NotRecognised:
            return 1.0

    return [answer(x) for x in X]
