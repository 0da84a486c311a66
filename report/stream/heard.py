"""What `listen` heard of a stream beside what fell: numbers, picture and caption."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from analysis import RecordError
from analysis.files.readers import read_table
from analysis.sweep.runs import true_ratio
from recognition.stream.stones import sliding_ratio
from report.drawing.figure_spec import Drawn, FigureSpec
from report.drawing.style import ACCENT, COAL, GANGUE, RATIO_LABEL, canvas, styled
from report.missing import MissingResult
from report.stream.results import StreamResults

DIRECTORY = "heard"  # beside the run, as `make recognise` names it
WINDOW_S, STEP_S = 0.2, 0.01


@dataclass(frozen=True)
class HeardStream:
    """heard: a table of `sliding_ratio`; truth: t_s, mass_ratio. heard_s, fell_s: when stones were heard, and when they
    touched the plate first; alarm_s: when drawing should have stopped."""

    heard: pd.DataFrame
    truth: pd.DataFrame
    heard_s: np.ndarray
    fell_s: np.ndarray
    alarm_s: np.ndarray

    @property
    def covered(self) -> float:
        """Share of the times with a ratio and a truth at which the truth is within the interval."""
        truth, heard = self.truth["mass_ratio"], self.heard
        within = truth.between(heard["mass_low"], heard["mass_high"])
        return float(within[truth.notna() & heard["mass_ratio"].notna()].mean())


def was_heard(results: StreamResults) -> bool:
    """Whether `listen` left its stones beside the run."""
    return (results.run.path.parent / DIRECTORY).is_dir()


def read_heard(results: StreamResults) -> HeardStream:
    """The stones that were heard of a run. Raises MissingResult where nothing was, or where `listen` gave no ratio."""
    directory = results.run.path.parent / DIRECTORY
    if not (directory / "ratio.parquet").is_file():
        raise MissingResult(f"no {DIRECTORY}/ratio.parquet; `make recognise` makes one")
    if read_table(directory / "ratio.parquet")["ratio"].isna().all():
        raise MissingResult("`listen` did not trust the record and gave no ratio")
    stones = read_table(directory / "stones.parquet")
    heard = sliding_ratio(stones, WINDOW_S, STEP_S, results.end_s)
    truth = [_share(results.touched, t_s) for t_s in heard["t_s"]]
    return HeardStream(heard, pd.DataFrame({"t_s": heard["t_s"], "mass_ratio": truth}),
                       stones["t_s"].to_numpy(), results.touched["first_contact_s"].to_numpy(),
                       stones["t_s"][stones.get("alarm", stones["t_s"] < 0)].to_numpy())


def _share(touched: pd.DataFrame, end_s: float) -> float:
    """Share of gangue by mass of the stones of the last window; not a number where none fell."""
    try:
        return true_ratio(touched, end_s - WINDOW_S, end_s)
    except RecordError:
        return np.nan


@styled
def ratio_over_time(found: HeardStream) -> Figure:
    """Draw the mixing ratio by mass with its interval, the truth, and a tick for each stone that was heard or fell."""
    figure, axes = canvas(1, height_in=3.2)
    axis, heard, truth = axes[0, 0], found.heard, found.truth
    for t_s, height, colour, label in ((found.heard_s, 107, ACCENT, "a stone is heard"),
                                       (found.fell_s, -7, COAL, "a stone falls")):
        axis.plot(t_s, np.full(len(t_s), height), "|", color=colour, markersize=6, label=label)
    time_s = heard["t_s"].to_numpy()
    low, middle, high = (100 * heard[f"mass_{name}"].to_numpy() for name in ("low", "ratio", "high"))
    axis.fill_between(time_s, low, high, color=ACCENT, alpha=0.25, linewidth=0, label="90 % interval")
    axis.plot(time_s, middle, color=ACCENT, label="recognised")
    axis.plot(truth["t_s"], 100 * truth["mass_ratio"], "--", color=COAL, label="truth")
    for k, t_s in enumerate(found.alarm_s):
        axis.axvline(t_s, color=GANGUE, linewidth=1, label=None if k else "alarm")
    axis.set_xlabel("time, s")
    axis.set_ylabel(RATIO_LABEL)
    axis.set_ylim(-14, 170)  # room for the legend
    axis.set_yticks(range(0, 101, 25))
    axis.legend(ncols=2, loc="upper left")
    return figure


def heard(results: StreamResults) -> Drawn:
    found = read_heard(results)
    return ratio_over_time(found), (f"{len(found.heard_s)} stones were heard, {len(found.fell_s)} touched the plate. "
                                    f"The truth is within the interval at {found.covered:.0%} of the times.")


HEARD_FIGURES = [
    FigureSpec("stream-heard", "What was heard",
               f"Mixing ratio by mass of the stones of the last {WINDOW_S:g} s, from accelerometers with noise. The "
               "interval is that of the stones that were heard; it knows nothing of those that were missed.", heard),
]
