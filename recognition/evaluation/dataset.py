"""A data set of many runs, as `gangue dataset` leaves it: DIRECTORY/FAMILY/GROUP/ratio_050."""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from analysis import RecordError, read_run
from analysis.sweep.runs import Run
from recognition.estimation.arrays import Floats, Integers
from recognition.estimation.errors import RecognitionError
from recognition.estimation.window import Window

#: Conditions that a record does not tell.
CONDITIONS = ("speed_m_s", "damping_ratio")


@dataclass(frozen=True)
class DataSet:
    """runs, their signals cut to one window, and what distinguishes them.

    table: a row a run with family, group ("family/000": one draw of all that varies), kin (the same in groups that have
    the order of gangue or the packings in common, if only by way of other groups), gangue_ratio, speed_m_s,
    damping_ratio. passed_over: directories that hold no finished run, and why.
    """

    runs: list[Run]
    table: pd.DataFrame
    passed_over: list[str]

    @cached_property
    def window(self) -> Window:
        return Window.of(self.runs)

    @cached_property
    def signals(self) -> list[pd.DataFrame]:
        return [self.window.cut(run.signals, str(run.path)) for run in self.runs]

    @property
    def ratios(self) -> Floats:
        return self.table["gangue_ratio"].to_numpy()

    def of(self, *families: str) -> Integers:
        """Numbers of the runs of some families."""
        return np.flatnonzero(self.table["family"].isin(families))

    def calibration(self) -> "DataSet":
        """The runs of the plate, the materials and the agglomerates that most runs have; the others are passed over."""
        kinds = pd.Series([_kind(run) for run in self.runs])
        same = (kinds == kinds.mode()[0]).to_numpy()
        others = [f"{self.runs[k].path}: another plate, other materials or other agglomerates"
                  for k in np.flatnonzero(~same)]
        runs = [run for run, one in zip(self.runs, same, strict=True) if one]
        return DataSet(runs, self.table[same].reset_index(drop=True), self.passed_over + others)


def _kind(run: Run) -> str:
    scene = run.scene.as_json()
    plate = {key: value for key, value in scene["plate"].items() if key != "damping_ratio"}
    return json.dumps([plate, scene.get("materials"), scene["stones"].get("agglomerate")], sort_keys=True)


def read_dataset(path: str | Path) -> DataSet:
    """Every finished run below a directory. RecordError if there is none."""
    path = Path(path)
    runs, rows, passed_over = [], [], []
    for directory in sorted(p for p in path.glob("*/*/ratio_*") if p.is_dir() and p.suffix != ".partial"):
        try:
            run = read_run(directory)
            rows.append(_row(run, directory))
        except (RecordError, RecognitionError) as error:
            passed_over.append(str(error))
            continue
        runs.append(run)
    if not runs:
        what = "no finished run" if path.is_dir() else "no such directory"
        raise RecordError(f"{path}: {what}; needs FAMILY/GROUP/ratio_* of `gangue dataset` or, for `gangue fit` alone, "
                          "ratio_* of `gangue sweep`")
    table = pd.DataFrame(rows)
    table.insert(2, "kin", _kin(table["group"], table.pop("order"), table.pop("packing")))
    return DataSet(runs, table, passed_over)


def _kin(group: pd.Series, *shared: pd.Series) -> Integers:
    """Number of the class of each run: runs that have a group, or any of `shared`, in common are in one class."""
    nodes = np.stack([pd.factorize(one)[0] for one in (group, *shared)])
    nodes += np.cumsum([0, *(nodes.max(axis=1) + 1)])[:-1, None]  # of all kinds numbered through
    n, first = int(nodes.max()) + 1, np.repeat(nodes[:1], len(nodes) - 1, axis=0)
    graph = coo_array((np.ones(first.size), (first.ravel(), nodes[1:].ravel())), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1][nodes[0]])


def _speed_m_s(run: Run) -> float | None:
    """That of a volley, or the mean of stones that were drawn."""
    if run.scene.stones.speed_m_s is not None or run.stones is None:
        return run.scene.stones.speed_m_s
    velocity = run.stones[["velocity_x_m_s", "velocity_y_m_s", "velocity_z_m_s"]].to_numpy(dtype=float)
    return float(np.linalg.norm(velocity, axis=1).mean())


def _row(run: Run, directory: Path) -> dict[str, Any]:
    conditions = {"speed_m_s": _speed_m_s(run), "damping_ratio": run.scene.plate.damping_ratio}
    for name, value in conditions.items():
        if value is None:
            raise RecognitionError(f"{directory}/run.json: scene has no {name!r}")
    family = directory.parent.parent.name
    group, stones = f"{family}/{directory.parent.name}", run.scene.stones
    order = group if not stones.gangue_order else str(list(stones.gangue_order))
    packing = str(run.scene.as_json()["stones"].get("seed", group))
    return {"family": family, "group": group, "order": order, "packing": packing, "gangue_ratio": run.gangue_ratio,
            **conditions}
