"""The part of a record that a model takes: which signals, and how much of them."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
import pandas as pd

from analysis import RecordError
from analysis.signals.records import READ_AS_S, sample_rate_Hz
from analysis.sweep.runs import Run
from common.channels import ACCELEROMETERS, RODS
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError

#: The window of the paper: 0..0.04 s at 1.5e-4 s.
WINDOW_S = 0.04

#: Of a model's rate, that a record must have to be resampled to it.
LEAST_SHARE = 0.1
#: Different ratios that a model needs.
LEAST_RATIOS = 4


@dataclass(frozen=True)
class Window:
    """The first n_samples of a record sampled at rate_Hz, behind an anti-alias filter or as it is."""

    rate_Hz: float
    n_samples: int
    anti_alias: bool = False

    @classmethod
    def of(cls, runs: list[Run]) -> Self:
        """The paper's 0.04 s, or as much of it as all runs have."""
        if not runs:
            raise RecognitionError(f"no runs; needs at least {LEAST_RATIOS} different mixing ratios")
        rate_Hz, anti_alias = runs[0].rate_Hz, runs[0].scene.time.anti_alias
        for run in runs:
            if (other := run.scene.time.anti_alias) != anti_alias:
                raise RecognitionError(f"{run.path}/run.json: scene.time.anti_alias = {other}; must be as in "
                                       f"{runs[0].path}, {anti_alias}")
        wanted = int(np.floor(WINDOW_S * rate_Hz * (1 + 1e-9))) + 1
        return cls(rate_Hz, min(wanted, *(run.t_s.size for run in runs)), anti_alias)

    def cut(self, signals: pd.DataFrame, source: str) -> pd.DataFrame:
        """The window of a record. RecordError if it is too short or has another sample rate."""
        if "t_s" not in signals.columns:
            raise RecordError(f"{source}: no column 't_s'; needs the time of each sample")
        rate_Hz = sample_rate_Hz(signals["t_s"].to_numpy(dtype=float), f"{source}: t_s")
        if not np.isclose(rate_Hz, self.rate_Hz, rtol=1e-3):
            how = READ_AS_S if rate_Hz < LEAST_SHARE * self.rate_Hz else "--resample goes to it"
            raise RecordError(f"{source}: {rate_Hz:.6g} Hz; the model needs {self.rate_Hz:.6g} Hz; {how}")
        if len(signals) < self.n_samples:
            raise RecordError(f"{source}: {len(signals)} samples; the model needs {self.n_samples} from the impact on")
        return signals.iloc[: self.n_samples]


def channel_names(columns: Iterable[str], rods: bool = False) -> list[str]:
    """Columns of accelerometers, sorted, and then of what rods there are. RecognitionError for no accelerometer."""
    every = sorted(columns)
    accelerometers = [name for name in every if name.startswith(ACCELEROMETERS)]
    if not accelerometers:
        raise RecognitionError(f"no column '{ACCELEROMETERS}*' in the record; needs it for "
                               f"{'plate' if rods else 'accelerometers'}")
    return accelerometers + [name for name in every if rods and name.startswith(RODS)]


def channels_of(signals: pd.DataFrame, rods: bool = False) -> Floats:
    """Signals of `channel_names`, shape (channels, samples). RecognitionError for one missing or not finite."""
    names = channel_names(signals.columns, rods)
    values = signals[names].to_numpy(dtype=float).T
    if not np.all(np.isfinite(values)):
        bad = names[int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])]
        raise RecognitionError(f"column {bad!r} of the record has a value that is not finite")
    return values
