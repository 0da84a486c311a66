"""Which signals of a record a method takes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

from common.channels import ACCELEROMETERS, RODS
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError

#: Sets of signals by name; a name that ends in * stands for all columns that begin so, in alphabetic order, and one in
#: brackets for columns that may be absent.
CHANNELS = {
    "centre": ("v_m_s", "a_m_s2"),
    "accelerometers": (f"{ACCELEROMETERS}*",),
    "rods": (f"{RODS}*",),
    "plate": (f"{ACCELEROMETERS}*", f"[{RODS}*]"),  # sensors that a plate can have
    "all": ("v_m_s", "a_m_s2", f"{ACCELEROMETERS}*", f"{RODS}*"),
}


def channel_names(columns: Iterable[str], kind: str) -> list[str]:
    """Columns of a set of CHANNELS. RecognitionError where the record lacks one."""
    columns, found = list(columns), []
    for entry in CHANNELS[kind]:
        name = entry.strip("[]")
        here = sorted(c for c in columns if c.startswith(name[:-1])) if name.endswith("*") else [name]
        if name == entry and not (here and set(here) <= set(columns)):
            raise RecognitionError(f"no column {name!r} in the record; needs it for {kind}")
        found += here
    return found


def channels_of(signals: pd.DataFrame, kind: str) -> Floats:
    """Signals of a set of CHANNELS, shape (channels, samples). RecognitionError for a missing column or a value that is
    not finite."""
    names = channel_names(signals.columns, kind)
    values = signals[names].to_numpy(dtype=float).T
    if not np.all(np.isfinite(values)):
        bad = names[int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])]
        raise RecognitionError(f"column {bad!r} of the record has a value that is not finite")
    return values
