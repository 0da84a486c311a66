"""Families of streams in the plan of a data set: a group is one draw of a stream, and one run."""

from __future__ import annotations

from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from common.scene.distribution import Spread
from common.scene.stones import MOST_STONES
from common.tables import Positive, Refused, Table

Share = Annotated[float, Field(ge=0, le=1)]


class StreamFamily(Table):
    """What its groups vary; a key that is absent leaves the scene as it is. Every group has a seed of its own, so that
    sizes, places, times and packings differ."""

    scene: str  # file, beside the plan: one with a rate in stones.drawn
    groups: Annotated[int, Field(ge=1)]
    stones: Annotated[int, Field(ge=1, le=MOST_STONES)]  # of a run; the stream lasts as long as its rate makes it
    rate_1_s: tuple[Positive, Positive]  # evenly between these in its logarithm
    gangue_ratio: tuple[Share, Share] = (0.0, 1.0)  # by mass, evenly between these, in whole percent
    speed_m_s: tuple[Positive, Positive] | None = None  # of all stones of a run, evenly between these
    sizes_m: Annotated[tuple[Spread, ...] | None, Field(min_length=1)] = None  # a run has one of these distributions
    rings_s: Positive = 0.1  # that the record goes on after the stream
    # Dotted keys of the scene, for all runs of the family.
    changes: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _ascend(self) -> Self:
        for key in ("rate_1_s", "gangue_ratio", "speed_m_s"):
            value = getattr(self, key)
            if value is not None and value[1] < value[0]:
                raise Refused(key, value, "must ascend")
        return self


def draw_stream(family: StreamFamily, rng: np.random.Generator) -> dict[str, Any]:
    """The changes of one group, by dotted key of the scene."""
    rate = float(np.exp(rng.uniform(*np.log(family.rate_1_s))))
    begin, duration = 0.01, family.stones / rate
    low, high = (round(100 * share) for share in family.gangue_ratio)
    changes: dict[str, Any] = {
        "stones.seed": int(rng.integers(100_000, 1_000_000_000)),
        "stones.gangue_ratio": int(rng.integers(low, high + 1)) / 100,
        "stones.drawn.rate_1_s": rate, "stones.drawn.rate_kg_s": None, "stones.drawn.gangue_by": "mass",
        "stones.drawn.arrival_s": {"uniform": [begin, begin + duration]},
        "time.duration_s": begin + duration + family.rings_s}
    if family.speed_m_s is not None:
        changes |= {"stones.drawn.speed_m_s": float(rng.uniform(*family.speed_m_s)),
                    "stones.drawn.drop_height_m": None}
    if family.sizes_m is not None:
        size = family.sizes_m[rng.integers(len(family.sizes_m))]
        changes["stones.drawn.size_m"] = size.model_dump(exclude_none=True)
    return changes
