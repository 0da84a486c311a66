"""The part of a record that a model takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from analysis import RecordError
from analysis.signals.records import sample_rate_Hz
from analysis.sweep.runs import Run
from recognition.estimation.errors import RecognitionError

#: The window of the paper: 0..0.04 s at 1.5e-4 s.
WINDOW_S = 0.04

#: Different ratios that a model needs.
LEAST_RATIOS = 4


@dataclass(frozen=True)
class Window:
    """The first n_samples of a record sampled at rate_Hz, behind an anti-alias filter or as it is."""

    rate_Hz: float
    n_samples: int
    anti_alias: bool = False

    @classmethod
    def of(cls, runs: list[Run]) -> Window:
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
            raise RecordError(f"{source}: {rate_Hz:.6g} Hz; the model needs {self.rate_Hz:.6g} Hz, "
                              "to which --resample goes")
        if len(signals) < self.n_samples:
            raise RecordError(f"{source}: {len(signals)} samples; the model needs {self.n_samples} from the impact on")
        return signals.iloc[: self.n_samples]
