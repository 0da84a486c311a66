"""Run directories: one simulated impact each, the sweep over the mixing ratio, and what fell in a stream.

A run directory holds `run.json`, `signals.parquet` (6667 Hz), `fast.parquet` (>= 100 kHz while anything touches),
`breakage.parquet` (one row per broken bond) and `stones.parquet` (a row a stone, which counts from its first touch of
the plate, `first_contact_s`). A sweep is a directory of them, one per gangue mixing ratio (`ratio_030`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.files.readers import read_table
from analysis.signals.records import Record, RecordError, sample_rate_Hz
from common.by_value import ByValue
from common.channels import RESPONSES, unit_of
from common.files.whole import read_json
from common.input_error import InputError, raised_as
from common.run_summary import RecordedScene, RunSummary, summary_from
from common.scene.stones import By

BREAKAGE_COLUMNS = ("t_s", "agglomerate", "x_m", "y_m", "z_m", "mode", "stress_Pa", "energy_J", "area_m2")
COLUMNS = ("material", "radius_m", "arrival_s", "mass_kg", "first_contact_s", "peak_force_N", "broken_area_m2",
           "left_mass_kg", "left_s")


@dataclass(frozen=True, eq=False)
class Run(ByValue):
    """One finished run. `info` is its run.json as it stands, `signals` signals.parquet; the larger tables are read when
    asked for.

    >>> run = read_run("runs/paper/ratio_030")
    >>> run.gangue_ratio, run.materials.count("gangue"), run.record("force_N").unit
    (0.3, 3, 'N')
    """

    path: Path
    info: dict[str, Any]
    signals: pd.DataFrame

    @cached_property
    def summary(self) -> RunSummary:
        """The checked run.json. RecordError, naming the key, where it holds a wrong value."""
        return _summary(self.info, self.path)

    @property
    def scene(self) -> RecordedScene:
        """The scene as far as run.json has it; what is absent is None."""
        return self.summary.scene

    @property
    def gangue_ratio(self) -> float:
        """Share of the stones that are gangue, 0..1."""
        return float(self.summary.gangue_ratio)

    @property
    def materials(self) -> list[str]:
        """Material of each agglomerate, "coal" or "gangue", in order, whatever the scene names them."""
        return [self.scene.kind_of(name) for name in self.summary.materials]

    @property
    def t_s(self) -> np.ndarray:
        return self.signals["t_s"].to_numpy(dtype=float)

    @cached_property
    def rate_Hz(self) -> float:
        return sample_rate_Hz(self.t_s, f"{self.path}/signals.parquet: t_s")

    def record(self, column: str) -> Record:
        """A column of `signals.parquet` as a Record."""
        if column not in self.signals.columns:
            known = ", ".join(self.signals.columns)
            raise RecordError(f"{self.path}/signals.parquet: no column {column!r}; has {known}")
        values = self.signals[column].to_numpy(dtype=float)
        name = f"{self.path.name}: {column}"
        return Record(values, self.rate_Hz, unit_of(column), name, float(self.t_s[0]))

    @cached_property
    def fast(self) -> pd.DataFrame | None:
        """The fast stream (it may have gaps where nothing touches), None if not written."""
        path = self.path / "fast.parquet"
        return read_table(path) if path.is_file() else None

    @property
    def finest(self) -> pd.DataFrame:
        """The fast stream, or the regular one of a run that kept no fast one."""
        return self.signals if self.fast is None else self.fast

    @cached_property
    def stones(self) -> pd.DataFrame | None:
        """One row per stone, None if not written."""
        path = self.path / "stones.parquet"
        return read_table(path) if path.is_file() else None

    @cached_property
    def breakage(self) -> pd.DataFrame:
        """One row per broken bond, in order of time."""
        table = _with_columns(self.path / "breakage.parquet", BREAKAGE_COLUMNS)
        return table.sort_values("t_s", kind="stable", ignore_index=True)

    def extremes(self, column: str) -> tuple[float, float]:
        """Largest and smallest value of a column, from the fast stream where it has it: a contact lasts about 1.5
        samples at 6667 Hz, so that the regular stream misses peaks."""
        values = [self.record(column).values]
        if self.fast is not None and column in self.fast.columns:
            values.append(self.fast[column].to_numpy(dtype=float))
        return float(max(np.nanmax(v) for v in values)), float(min(np.nanmin(v) for v in values))

    def peak(self, column: str) -> float:
        """Largest absolute value of a column, as `extremes`."""
        return max(abs(value) for value in self.extremes(column))


def read_run(path: str | Path) -> Run:
    """Read a run directory. RecordError if it is not one, or not of a finished run.

    >>> read_run("runs/paper/ratio_030").signals[["t_s", "force_N"]].shape
    (267, 2)
    """
    path = Path(path)
    info = _read_info(path)
    if info.get("status") != "finished":
        raise RecordError(f"{path}/run.json: status = {info.get('status')!r}; needs 'finished'")
    rigid = _summary(info, path).scene.plate.is_rigid
    needed = ("t_s", "force_N") if rigid else ("t_s", *RESPONSES, "force_N")  # a rigid plate has no responses
    return Run(path, info, _with_columns(path / "signals.parquet", needed))


def _with_columns(file: Path, columns: Sequence[str]) -> pd.DataFrame:
    """A table of a run. Raises RecordError where it lacks one of the columns."""
    table = read_table(file)
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise RecordError(f"{file}: no column {missing[0]!r}; needs {', '.join(columns)}")
    return table


def _read_info(path: Path) -> dict[str, Any]:
    try:
        info = read_json(path / "run.json")
    except (InputError, OSError) as error:
        raise RecordError(str(error)) from None
    if info is None:
        raise RecordError(f"{path}: no run.json; needs a run directory")
    return info


def _summary(info: dict[str, Any], path: Path) -> RunSummary:
    with raised_as(RecordError):
        return summary_from(info, f"{path}/run.json")


@dataclass(frozen=True)
class Sweep:
    """Runs in order of their ratio, the ratios that are missing, and what was passed over and why.

    >>> read_sweep("runs/paper").stack("a_m_s2").shape
    (11, 267)
    """

    path: Path
    runs: list[Run]
    missing: list[float]
    passed_over: list[str]

    @property
    def ratios(self) -> np.ndarray:
        """Gangue mixing ratio of each run, shape (n,), 0..1."""
        return np.array([run.gangue_ratio for run in self.runs])

    def stack(self, column: str) -> np.ndarray:
        """A column of all runs, shape (n_runs, n_samples); RecordError if their times differ."""
        first = self.runs[0]
        for run in self.runs[1:]:
            if run.t_s.shape != first.t_s.shape or not np.allclose(run.t_s, first.t_s, rtol=0, atol=1e-7):
                raise RecordError(f"{run.path}/signals.parquet: t_s differs from {first.path.name}'s; needs the same "
                                  "times in all runs")
        return np.stack([run.record(column).values for run in self.runs])

    def peaks(self, column: str) -> np.ndarray:
        """Largest absolute value of a column in each run, shape (n,)."""
        return np.array([run.peak(column) for run in self.runs])


def read_sweep(path: str | Path, expected: tuple[float, ...] | None = None) -> Sweep:
    """Read every finished run `ratio_*` below a directory, or the one that the directory is itself.

    Ratios of `expected` without a run are listed as missing; by default those of the campaign that the directory is a
    group of, or else those that the stones of its scene can give. Directories that are no finished run are passed over
    and named. RecordError if no run is left.

    >>> sweep = read_sweep("runs/paper")
    >>> sweep.missing, float(sweep.ratios[3])
    ([], 0.3)
    """
    path = Path(path)
    if not path.is_dir():
        raise RecordError(f"{path}: no such directory; needs a run, or a directory of runs ratio_*")
    if (path / "run.json").is_file():
        return Sweep(path, [read_run(path)], [], [])
    runs, passed_over = [], []
    for directory in sorted(p for p in path.glob("ratio_*") if p.is_dir()):
        try:
            runs.append(read_run(directory))
        except RecordError as error:
            passed_over.append(str(error))
    if not runs:
        found = f" ({passed_over[0]})" if passed_over else ""
        raise RecordError(f"{path}: no finished run ratio_*, nor a run.json of its own{found}")
    runs.sort(key=lambda run: run.gangue_ratio)
    have = {round(run.gangue_ratio, 6) for run in runs}
    wanted = _expected(path, runs) if expected is None else expected
    return Sweep(path, runs, [ratio for ratio in wanted if round(ratio, 6) not in have], passed_over)


def _expected(path: Path, runs: list[Run]) -> list[float]:
    plan = path.resolve().parent / "plan.csv"
    if plan.is_file():  # of a campaign
        rows = pd.read_csv(plan, dtype=str)
        own = rows[rows["place"].str.startswith(f"{path.resolve().name}/")]
        return sorted({float(ratio) for ratio in own.get("stones.gangue_ratio", [])})
    stones = runs[0].scene.stones
    count = stones.count if stones.radius_m else None  # of a volley
    return [k / count for k in range(count + 1)] if count and len(runs) > 1 else []


def is_stream(run: Run) -> bool:
    """Do stones come and go in a run, so that it has a table of what left?"""
    return (run.path / "left.parquet").is_file()


def fallen(run: Run) -> pd.DataFrame:
    """stones.parquet of a run, with `is_gangue` beside its columns. Raises RecordError where it is not there."""
    table = _with_columns(run.path / "stones.parquet", COLUMNS)
    return table.assign(is_gangue=table["material"].map(run.scene.kind_of) == "gangue")


def true_ratio(stones: pd.DataFrame, begin_s: float, end_s: float, by: By = "mass") -> float:
    """Share of gangue, 0..1, among the stones (of `fallen`) that first touched the plate in begin_s <= t < end_s, by
    mass or by number. Raises RecordError where there were none."""
    first_s = stones["first_contact_s"].to_numpy()
    here = stones[(first_s >= begin_s) & (first_s < end_s)]
    if here.empty:
        raise RecordError(f"no stone touched the plate first from {begin_s:g} to {end_s:g} s; the ratio needs one")
    weight = here["mass_kg"].to_numpy() if by == "mass" else np.ones(len(here))
    return float(weight[here["is_gangue"].to_numpy()].sum() / weight.sum())
