"""The figure of the evaluation on runs that were not trained on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from report.figures.style import ACCENT, COAL, GANGUE, PALE, canvas, styled

Kind = Literal["paper", "baseline", "interval", "other"]
COLOURS: dict[Kind, str] = {"paper": ACCENT, "baseline": COAL, "interval": GANGUE, "other": PALE}
LEAST_points = 0.1  # smaller errors are drawn here
TICKS = (LEAST_points, 0.2, 0.5, 1, 2, 5, 10, 20, 50)


@dataclass(frozen=True)
class PlottedMethod:
    """A method in the figure.

    name: as in the column `method`. label: as a reader sees it. kind: gives the colour. mark: of matplotlib.
    filled: whether the mark is drawn filled.
    """

    name: str
    label: str
    kind: Kind
    mark: str
    filled: bool = False


@styled
def errors_by_case(table: pd.DataFrame, methods: list[PlottedMethod], noises: dict[str, float | None]) -> Figure:
    """Draw the mean absolute error of each method in each case, one panel a noise.

    table: rows of evaluation.csv. noises: {title: ratio of signal to noise in dB, or None for no noise}.
    """
    cases = list(dict.fromkeys(table["case"]))
    figure, axes = canvas(len(noises), height_in=len(noises) * (0.25 * len(cases) + 0.5) + 1.5, sharex=True)
    for axis, (title, noise_db) in zip(axes[:, 0], noises.items(), strict=True):
        rows = table[table["noise_db"].isna() if noise_db is None else table["noise_db"] == noise_db]
        for method in methods:
            _plot_errors(axis, rows[rows["method"] == method.name], method, cases)
        axis.set_title(title)
        axis.set_xscale("log")
        axis.set_xticks(TICKS, [f"≤ {LEAST_points:g}", *(f"{tick:g}" for tick in TICKS[1:])])
        axis.minorticks_off()
        axis.grid(axis="both", color=PALE, linewidth=0.3)
        axis.set_yticks(range(len(cases)), cases)
        axis.invert_yaxis()
    axes[-1, 0].set_xlabel("mean error, points of mixing ratio")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=7)
    return figure


def _plot_errors(axis: Axes, rows: pd.DataFrame, method: PlottedMethod, cases: list[str]) -> None:
    rows = rows[rows["mean_abs_error_points"].notna()]
    colour, error = COLOURS[method.kind], rows["mean_abs_error_points"].clip(lower=LEAST_points)
    axis.plot(error, [cases.index(c) for c in rows["case"]], method.mark, color=colour,
              markerfacecolor=colour if method.filled else "none", markersize=5, label=method.label)  # fmt: skip
