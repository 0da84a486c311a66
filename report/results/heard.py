"""What `listen` heard of a stream, beside what fell."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.readers import read_table
from analysis.runs import Run
from recognition.stream.stones import sliding_ratio
from report.results.missing import MissingResult

DIRECTORY = "heard"  # in a directory of runs, as `make recognise` names it
WINDOW_S, STEP_S = 0.2, 0.01


@dataclass(frozen=True)
class HeardStream:
    """heard: a table of `sliding_ratio`; truth: t_s, mass_ratio. stones_heard, stones: how many."""

    heard: pd.DataFrame
    truth: pd.DataFrame
    stones_heard: int
    stones: int


def read_heard(sweep: Path, run: Run) -> HeardStream:
    """The stones that were heard of a run. Raises MissingResult where nothing was, or where `listen` gave no ratio."""
    directory = sweep / DIRECTORY
    if not (directory / "ratio.parquet").is_file():
        raise MissingResult(f"no {DIRECTORY}/ratio.parquet; `make recognise` makes one")
    if read_table(directory / "ratio.parquet")["ratio"].isna().all():
        raise MissingResult("`listen` did not trust the record and gave no ratio")
    stones, fell = read_table(directory / "stones.parquet"), read_table(run.path / "stones.parquet")
    fell = fell[fell["first_contact_s"].notna()]
    end_s = float(run.signals["t_s"].iloc[-1])
    heard = sliding_ratio(stones, WINDOW_S, STEP_S, end_s)
    shares = [_share(fell, t_s, run.scene.stones.gangue) for t_s in heard["t_s"]]
    return HeardStream(heard, pd.DataFrame({"t_s": heard["t_s"], "mass_ratio": shares}), len(stones), len(fell))


def _share(fell: pd.DataFrame, t_s: float, gangue: str) -> float:
    """Share of gangue by mass of the stones of the last window; not a number where none fell."""
    last = fell[fell["first_contact_s"].between(t_s - WINDOW_S, t_s, inclusive="right")]
    mass = last["mass_kg"].to_numpy()
    return float(mass @ (last["material"] == gangue).to_numpy() / mass.sum()) if len(last) else np.nan
