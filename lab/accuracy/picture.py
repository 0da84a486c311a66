"""The picture of `make accuracy`: error against processor time, one line a numerical setting."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from lab.accuracy.laws import worst_error

CHAOTIC = ("sub-spheres", "time step, breaking")


def draw(table: pd.DataFrame, file: Path) -> None:
    """`table` is work_precision.csv. The default of each setting that has one is ringed; failures have no error and are
    left out."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5.6), gridspec_kw={"width_ratios": [1.6, 1]}, layout="constrained")
    table = table[table["outcome"] == "finished"]
    left.set_prop_cycle(color=[plt.get_cmap("tab20")(k) for k in (*range(0, 20, 2), *range(1, 20, 2))])
    for varied, rows in table[~table["numerical_setting"].isin(CHAOTIC)].groupby("numerical_setting", sort=False):
        rows = rows.assign(worst=worst_error(rows)).sort_values("setting")
        line, = left.plot(rows["cpu_s"], rows["worst"], "o-", ms=4, lw=1, label=varied)
        if rows["default"].isna().any():
            continue
        nearest = rows.iloc[(rows["setting"] / rows["default"] - 1).abs().argmin()]
        left.plot(nearest["cpu_s"], nearest["worst"], "o", ms=11, mfc="none", color=line.get_color())
    left.axhline(0.01, color="0.6", lw=0.8, ls="--")
    left.set(xscale="log", yscale="log", xlabel="processor time, s", ylabel="largest deterministic error",
             title="each numerical setting by itself (rings: near the default)")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=8)
    for varied, rows in table[table["numerical_setting"].isin(CHAOTIC)].groupby("numerical_setting", sort=False):
        right.errorbar(rows["cpu_s"], rows["broken_area_cm2"], rows["broken_area_sem_cm2"], fmt="o-", ms=4, lw=1,
                       capsize=3, label=varied)
    right.set(xscale="log", xlabel="processor time a run, s", ylabel="broken area of a coal stone, cm2",
              title="five packings, standard error", ylim=(0, None))
    if right.get_legend_handles_labels()[0]:
        right.legend(fontsize=8)
    for axes in (left, right):  # less than two decades, in which the usual labels overlap
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    figure.savefig(file, dpi=110)
    plt.close(figure)
