"""The picture of `make stability`: what is stable where."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

COLOURS = {"finished": "#2a7f62", "refused": "#c9a227"}
FAILED = "#b3261e"


def draw(table: pd.DataFrame, levels: dict[str, list], file: Path) -> None:
    """Above: a row a value that is changed alone, its levels from left to right. Below: the combined cases over
    stiffness and speed. `table` is cases.csv."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (alone, combined) = plt.subplots(1, 2, figsize=(13, 6.5), gridspec_kw={"width_ratios": [1.25, 1]},
                                             layout="constrained")
    settings = [json.loads(text) for text in table["settings"]]
    single = [(s, row) for s, (_, row) in zip(settings, table.iterrows(), strict=True) if len(s) == 1]
    keys = list(levels)
    for s, row in single:
        (key, value), = s.items()
        values = [json.loads(json.dumps(v)) for v in levels[key]]
        place = values.index(value) if value in values else len(values)
        alone.scatter(place, keys.index(key), s=420, marker="s", color=COLOURS.get(row["outcome"], FAILED))
        text = f"{value:g}" if isinstance(value, (int, float)) else str(value)
        alone.text(place, keys.index(key), text[:7], ha="center", va="center", fontsize=7, color="white")
    alone.set_yticks(range(len(keys)), [key.replace("_m_s", ", m/s").replace("_m3", "/m3").replace("_m", ", m").replace("_", " ") for key in keys])
    alone.set_xticks([])
    alone.set_ylim(len(keys) - 0.4, -0.6)
    alone.set_xlim(-0.6, 7.6)
    alone.set_title("one value changed")
    ranks: dict[tuple, int] = {}
    for s, (_, row) in zip(settings, table.iterrows(), strict=True):
        if not row["case"].startswith("combined"):
            continue
        point = levels["stiffness"].index(s["stiffness"]), levels["speed_m_s"].index(s["speed_m_s"])
        rank = ranks[point] = ranks.get(point, -1) + 1
        combined.scatter(point[0] + 0.2 * (rank % 4 - 1.5), point[1] + 0.2 * (rank // 4 - 1.0), s=45,
                         color=COLOURS.get(row["outcome"], FAILED))
    combined.set_xticks(range(len(levels["stiffness"])), [f"{v:g}" for v in levels["stiffness"]])
    combined.set_yticks(range(len(levels["speed_m_s"])), [f"{v:g}" for v in levels["speed_m_s"]])
    combined.set_xlabel("stiffness of the stones over the paper's")
    combined.set_ylabel("speed, m/s")
    combined.set_title("all values at random")
    for name, colour in {**COLOURS, "neither": FAILED}.items():
        combined.scatter([], [], color=colour, label=f"{name} ({_count(table, name)})")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def _count(table: pd.DataFrame, outcome: str) -> int:
    if outcome == "neither":
        return int((~table["outcome"].isin(list(COLOURS))).sum())
    return int((table["outcome"] == outcome).sum())
