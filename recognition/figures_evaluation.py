"""Drawing of the evaluation on runs that were not trained on."""

from __future__ import annotations

import pandas as pd

from recognition.figures import ACCENT, COAL, GANGUE, PALE, canvas, styled

MARKS = dict(zip(("fusion_q", "energy_fusion_printed", "energy_fusion_mended", "rms_line"), "xs+v", strict=True))


@styled
def evaluation(table: pd.DataFrame, names: dict[str, str], best: tuple[str, ...], noises: dict[str, float | None]):
    """Mean absolute error of each method in each case, a panel a noise; rows of evaluation.csv.

    names: of the methods as a reader sees them, in order; best: those to draw in full colour; noises: {title: noise_db}.
    """
    cases = list(dict.fromkeys(table["case"]))
    figure, axes = canvas(1, columns=len(noises), height_in=0.34 * len(cases) + 1.6, sharey=True)
    for axis, (title, noise) in zip(axes[0], noises.items(), strict=True):
        here = table[table["noise_db"].isna() if noise is None else table["noise_db"] == noise]
        for method, label in names.items():
            rows = here[(here["method"] == method) & here["mean_abs_error_points"].notna()]
            colour = {**dict.fromkeys(best, GANGUE), "rms_line": COAL}.get(method, ACCENT if method in MARKS else PALE)
            axis.plot(rows["mean_abs_error_points"], [cases.index(c) for c in rows["case"]],
                      MARKS.get(method, "o" if method in best else "."), color=colour, markersize=5, label=label)
        axis.set_xscale("log")
        axis.set_title(title)
        axis.set_xlabel("mean error, points")
        axis.grid(axis="x", color=PALE, linewidth=0.4)
    axes[0, 0].set_yticks(range(len(cases)), cases)
    axes[0, 0].invert_yaxis()
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=7)
    return figure
