"""From runs to a table: a row a run with the keys of the scene that vary and the results, or a row a stone."""

import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.files.readers import read_table
from analysis.signals.records import RecordError
from common.files.export import export, refuse_export
from common.result import Result, plain
from common.run_summary import read_summary
from common.tables import inline_toml

RESULTS = ("peak_force_N", "impulse_N_s", "momentum_change_kg_m_s", "n_bonds", "n_bonds_broken", "n_particles",
           "n_modes", "dt_s", "steps")
UNNAMED = ("name",)  # of a scene: names, not what it says
DEPTH = 3  # of runs below the directory: FAMILY/GROUP/ratio_030


@dataclass(frozen=True)
class TableResult(Result):
    """Rows of a table, each a value by column, None where there is none; directories that hold no finished run, and
    why."""

    rows: tuple[Mapping[str, Any], ...]
    passed_over: tuple[str, ...]
    table: Path | None

    def words(self) -> Iterator[str]:
        text = io.StringIO()
        pd.DataFrame(list(self.rows)).to_string(text, index=False, na_rep="", float_format=lambda value: f"{value:.6g}")
        yield from text.getvalue().splitlines()
        for reason in self.passed_over:
            yield f"passed over: {reason}"
        if self.table is not None:
            yield f"written to {self.table}"


def table(directory: Path, stones: bool = False, out: Path | None = None) -> TableResult:
    """The runs in a directory, that of a sweep, a campaign, a data set or one run; with `stones` a row for each of
    their stones. Written to `out`: .csv, or .xlsx with both tables. Raises RecordError where no run is finished,
    InputError."""
    if out is not None:
        refuse_export(out)
    runs, passed_over = run_table(directory)
    of_stones = stone_table(runs, directory) if stones or out is not None and out.suffix == ".xlsx" else pd.DataFrame()
    wanted = of_stones if stones else runs
    if out is not None:
        export({"stones": of_stones, "runs": runs} if stones else {"runs": runs, "stones": of_stones}, out)
    rows = wanted.astype(object).where(wanted.notna(), None).to_dict("records")
    return TableResult(tuple(plain(row) for row in rows), passed_over, out)


def run_table(directory: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """A row a finished run below a directory, by their names: `run`, the dotted keys of the scene that are not the same
    in all runs, gangue_ratio, RESULTS, energy_closure, max_... of the plate and wall_time_s; and why others are passed
    over. Raises RecordError where there is none."""
    files = sorted(file for depth in range(DEPTH + 1) for file in directory.glob("/".join([*"*" * depth, "run.json"])))
    scenes, results, passed_over = list[dict[str, Any]](), list[dict[str, Any]](), list[str]()
    for file in files:
        summary = read_summary(file)
        if summary is None or summary.status != "finished":
            passed_over.append(f"{file.parent}: not finished")
            continue
        content = summary.as_json()
        scenes.append({key: inline_toml(value) if isinstance(value, list) else value
                       for key, value in dotted(content.get("scene", {})) if value is not None})
        results.append({"run": file.parent.relative_to(directory).as_posix(), "gangue_ratio": summary.gangue_ratio,
                        **{name: content.get(name) for name in RESULTS},
                        "energy_closure": (summary.energy or {}).get("closure"), **(summary.plate or {}),
                        "wall_time_s": sum(summary.wall_time_s.values())})
    if not scenes:
        raise RecordError(f"{directory}: no finished run; needs the directory of a run, a sweep or a campaign")
    keys = [key for key in dict.fromkeys(key for scene in scenes for key in scene)
            if key not in (*UNNAMED, "stones.gangue_ratio") and len({scene.get(key) for scene in scenes}) > 1]
    rows = [{"run": result.pop("run"), **{key: scene.get(key) for key in keys}, **result}
            for scene, result in zip(scenes, results, strict=True)]
    return pd.DataFrame(rows), tuple(passed_over)


def stone_table(runs: pd.DataFrame, directory: Path) -> pd.DataFrame:
    """A row a stone of the runs of `run_table`: `run`, and what stones.parquet says. Raises RecordError."""
    tables = [read_table(directory / run / "stones.parquet").assign(run=run) for run in runs["run"]]
    found = pd.concat(tables, ignore_index=True)
    return found[["run", *found.columns.drop("run")]]


def dotted(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """The values of nested tables by dotted key."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from dotted(value, f"{above}{name}.")
        else:
            yield above + name, value
