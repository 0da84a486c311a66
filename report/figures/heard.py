"""The figure of a stream that was listened to."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from report.figures.style import ACCENT, COAL, RATIO_LABEL, canvas, styled


@styled
def ratio_over_time(heard: pd.DataFrame, truth: pd.DataFrame) -> Figure:
    """Draw the mixing ratio by mass with its interval, and the truth.

    heard: a table of `sliding_ratio`; truth: t_s, mass_ratio.
    """
    figure, axes = canvas(1, height_in=2.6)
    axis = axes[0, 0]
    time_s = heard["t_s"].to_numpy()
    low, middle, high = (100 * heard[f"mass_{name}"].to_numpy() for name in ("low", "ratio", "high"))
    axis.fill_between(time_s, low, high, color=ACCENT, alpha=0.25, linewidth=0, label="90 % interval")
    axis.plot(time_s, middle, color=ACCENT, label="recognised")
    axis.plot(truth["t_s"], 100 * truth["mass_ratio"], "--", color=COAL, label="truth")
    axis.set_xlabel("time, s")
    axis.set_ylabel(RATIO_LABEL)
    axis.set_ylim(-3, 103)
    axis.legend(loc="best")
    return figure
