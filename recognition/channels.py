"""Which signals of a record a method takes, as one row of numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from recognition.errors import RecognitionError

#: Sets of signals by name; a name that ends in * stands for all columns that begin so, in order.
CHANNELS = {
    "centre": ("v_m_s", "a_m_s2"),
    "accelerometers": ("acc_*",),
    "rods": ("rod_*",),
    "plate": ("v_m_s", "acc_*", "rod_*"),
    "all": ("v_m_s", "a_m_s2", "acc_*", "rod_*"),
}

#: Those that one likelihood over all moments takes.
LIKELIHOOD_CHANNELS = ("centre", "accelerometers", "rods", "all")


@dataclass(frozen=True)
class Channels:
    """A set of CHANNELS: `prepare` takes a record to one row."""

    kind: str

    def __post_init__(self):
        if self.kind not in CHANNELS:
            raise ValueError(f"channels {self.kind!r}; allowed are {', '.join(CHANNELS)}")

    def names(self, columns) -> list[str]:
        """The columns taken. RecognitionError where the record has none of a kind."""
        found = []
        for name in CHANNELS[self.kind]:
            here = sorted(c for c in columns if c.startswith(name[:-1])) if name.endswith("*") else [name]
            if not here or not set(here) <= set(columns):
                raise RecognitionError(f"no column {name!r} in the record; needs it for {self.kind}")
            found += here
        return found

    def prepare(self, signals: pd.DataFrame) -> np.ndarray:
        """Shape (channels, samples). RecognitionError for a missing column or a value that is not finite."""
        names = self.names(signals.columns)
        values = signals[names].to_numpy(dtype=float).T
        if not np.all(np.isfinite(values)):
            bad = names[int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])]
            raise RecognitionError(f"column {bad!r} of the record has a value that is not finite")
        return values
