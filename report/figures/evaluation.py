"""Drawing of the evaluation on runs that were not trained on."""

from __future__ import annotations

import pandas as pd

from report.figures.style import ACCENT, COAL, GANGUE, PALE, canvas, styled

MARKS = {"fusion_q": "x", "energy_fusion_as_published": "s", "energy_fusion_modified": "+", "rms_line": "v"}  # what others are held against
BEST_MARKS = "DoP^*<>d"
TICKS = (0.2, 0.5, 1, 2, 5, 10, 20, 50)


@styled
def evaluation(table: pd.DataFrame, names: dict[str, str], best: tuple[str, ...], noises: dict[str, float | None]):
    """Mean absolute error of each method in each case, a panel a noise; rows of evaluation.csv.

    names: of the methods as a reader sees them, in order; best: those to draw in full colour; noises: {title: noise_db}.
    """
    cases = list(dict.fromkeys(table["case"]))
    marks = MARKS | dict(zip(best, BEST_MARKS, strict=False))
    figure, axes = canvas(len(noises), height_in=len(noises) * (0.25 * len(cases) + 0.5) + 1.5, sharex=True)
    for axis, (title, noise) in zip(axes[:, 0], noises.items(), strict=True):
        here = table[table["noise_db"].isna() if noise is None else table["noise_db"] == noise]
        for method, label in names.items():
            rows = here[(here["method"] == method) & here["mean_abs_error_points"].notna()]
            colour = GANGUE if method in best else COAL if method == "rms_line" else ACCENT if method in MARKS else PALE
            axis.plot(rows["mean_abs_error_points"], [cases.index(c) for c in rows["case"]], marks.get(method, "."), color=colour,
                      markerfacecolor=colour if method == best[0] else "none", markersize=5, label=label)
        axis.set_xscale("log")
        axis.set_title(title)
        axis.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
        axis.minorticks_off()
        axis.grid(axis="both", color=PALE, linewidth=0.3)
        axis.set_yticks(range(len(cases)), cases)
        axis.invert_yaxis()
    axes[-1, 0].set_xlabel("mean error, points of mixing ratio")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=7)
    return figure
