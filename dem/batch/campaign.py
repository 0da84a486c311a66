"""Campaigns: one scene with lists of values, and a run for every combination of them.

    scene = "paper.toml"                         # beside the campaign's file
    [vary]
    "stones.gangue_ratio" = [0.0, 0.5, 1.0]      # dotted keys of the scene
    "stones.speed_m_s" = [2.0, 3.0, 4.0]
    "stones.seed" = [20011, 20021]

The plan is a table; `gangue campaign` hands it to Snakemake (workflow/Snakefile), which runs on one machine or,
by a profile, on a cluster. Runs lie in DIR/GROUP/ratio_050, GROUP after what the scene says but for the ratio: a
changed scene gives new directories, an unchanged one is found finished, and each group is a sweep that analysis and
recognition read as they read any other.
"""

import itertools
import logging
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pandas as pd
from pydantic import Field

from common.files.output_directory import at_work_in
from common.files.whole import written_whole
from common.process.processes import run_group
from common.resources import resource
from common.scene.scene import changed_scene, ratio_name, scene_hash
from common.tables import InputError, Table, check, inline_toml, read_toml
from dem.commands import BatchResult
from dem.coupling.launch import check_engine
from dem.stones.arrangement import stones_of

WORKFLOW = resource("workflow")
PLAN = "plan.csv"
MOST_RUNS = 1_000_000
_log = logging.getLogger(__name__)


class CampaignPlan(Table):
    scene: str  # file, beside the campaign's
    vary: dict[str, list[Any]] = Field(min_length=1)


def plan_campaign(file: Path) -> list[dict[str, Any]]:
    """Return every run of a campaign, all checked: `place`, its directory below that of the campaign, `np`, its MPI
    ranks, `scene`, its file, and the value of each key varied, in TOML. Raises InputError."""
    table = check(CampaignPlan, read_toml(file), file)
    scene_file = file.parent / table.scene
    for key, values in table.vary.items():
        if not values:
            raise InputError(f"{file}: vary.{key} = []: must hold at least one value")
    keys, count = list(table.vary), 1
    for values in table.vary.values():
        count *= len(values)
    if count > MOST_RUNS:
        raise InputError(f"{file}: vary asks for {count} runs; a campaign may have {MOST_RUNS}")
    runs, seen = [], set()
    for values in itertools.product(*table.vary.values()):
        changes = dict(zip(keys, values))
        scene = changed_scene(scene_file, changes)
        stones_of(scene, str(scene_file))
        group = scene_hash(scene.model_copy(update={"stones": scene.stones.model_copy(update={"gangue_ratio": 0.0})}))
        directory = f"{group}/{ratio_name(scene.stones.gangue_ratio or 0.0)}"
        if directory not in seen:  # a value given twice
            runs.append({"place": directory, "np": scene.ranks, "scene": str(scene_file.resolve()),
                         **{key: inline_toml(value) for key, value in changes.items()}})
        seen.add(directory)
    return runs


def write_campaign_runs(runs: list[dict[str, Any]], out: Path) -> None:
    """Write OUT/plan.csv, a row a run."""
    out.mkdir(parents=True, exist_ok=True)
    with written_whole(out / PLAN) as beside:
        pd.DataFrame(runs).to_csv(beside, index=False)


def read_campaign_runs(out: Path) -> dict[str, tuple[int, list[str]]]:
    """Read OUT/plan.csv: by directory of a run its ranks, and its scene and `--set` arguments of `gangue run`."""
    table = pd.read_csv(out / PLAN, dtype=str, keep_default_na=False)
    keys = [name for name in table.columns if name not in ("place", "np", "scene")]
    return {row["place"]: (int(row["np"]), [row["scene"], *(f"--set={key}={row[key]}" for key in keys)])
            for row in table.to_dict("records")}


def campaign(file: str | Path, out: str | Path, jobs: int = 1, profile: str | None = None) -> BatchResult:
    """Plan a campaign and let Snakemake run what is missing. Raises InputError.

    >>> _ = Path("speeds.toml").write_text('''scene = "scenes/hertz_coal.toml"
    ... vary = { "stones.speed_m_s" = [1.0, 2.0] }''')
    >>> campaign(Path("speeds.toml"), Path("runs/speeds"), jobs=1).finished
    2
    """
    if find_spec("snakemake") is None:
        raise InputError("snakemake is not installed; `make campaign` or pip install '.[campaign]' does it")
    check_engine()
    file, out = Path(file), Path(out)
    runs = plan_campaign(file)
    with at_work_in(out, "campaign"):
        write_campaign_runs(runs, out)
        _log.info("%s: %d runs, %d to run", file, len(runs), len(_missing(out, runs)))
        chosen = WORKFLOW / "profiles" / profile if profile and (WORKFLOW / "profiles" / profile).is_dir() else profile
        code = run_group(
            [sys.executable, "-m", "snakemake", "--snakefile", str(WORKFLOW / "Snakefile"),
             "--directory", str(out.resolve()), "--nolock",  # `at_work_in` has locked it, until this process is gone
             "--jobs", str(jobs), "--profile", str(chosen or WORKFLOW / "profiles" / "local")])
    missing = _missing(out, runs)
    failed = {place: f"{out}/logs/{place}.log says why" for place in missing}
    if code and not missing:
        failed = {"snakemake": f"ended with code {code}"}
    return BatchResult(out, len(runs), len(runs) - len(missing), failed)


def _missing(out: Path, runs: list[dict[str, Any]]) -> list[str]:
    return [run["place"] for run in runs if not (out / run["place"] / "run.json").exists()]
