"""Campaigns of real, tiny runs: one sphere on a rigid plate, for which Hertz gives the peak force."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from common.scene.scene import read_scene, scene_hash
from common.tables import InputError, inline_toml
from dem.__main__ import main
from dem.batch.campaign import plan_campaign, read_campaign_runs, write_campaign_runs
from tests.campaign.private_slurm import missing, private_slurm

ROOT = Path(__file__).resolve().parents[2]
STONE = ROOT / "scenes" / "hertz_coal.toml"
COAL_N, GANGUE_N = 4261.6, 7646.3  # at 3 m/s


def campaign_file(directory, scene=STONE, **vary):
    lines = "".join(f'"{key}" = {inline_toml(value)}\n' for key, value in vary.items())
    file = directory / "campaign.toml"
    file.write_text(f'scene = "{scene}"\n[vary]\n{lines}')
    return file


def run_campaign(file, out, *arguments, environment=None):
    command = [sys.executable, "-m", "dem", "campaign", str(file), "--out", str(out), *arguments]
    environment = dict(environment or os.environ)
    environment["PYTHONPATH"] = f"{ROOT}:{environment.get('PYTHONPATH', '')}"
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def assert_hertz(out):
    """Every run of the plan is there, and its peak force goes with the 6/5th power of the speed."""
    for directory in read_campaign_runs(out):
        info = json.loads((out / directory / "run.json").read_text())
        peak = GANGUE_N if info["gangue_ratio"] else COAL_N
        speed = info["scene"]["stones"]["speed_m_s"]
        assert info["status"] == "finished"
        assert info["peak_force_N"] == pytest.approx(peak * (speed / 3.0) ** 1.2, rel=1e-3)


@pytest.mark.slow
def test_a_campaign_runs_what_is_missing_and_each_group_is_laid_out_as_a_sweep(tmp_path):
    """Whatever program, scene and directory are called, also in YAML, in the braces of Python and in the shell."""
    pytest.importorskip("snakemake")
    here = tmp_path / "a: b #1 {x} $HOME 'q\"" / "-r"
    here.mkdir(parents=True)
    (here / "stone.toml").write_text(STONE.read_text())
    (tmp_path / "e nv").symlink_to(sys.prefix)

    def run(*ratios):
        campaign_file(here, "stone.toml", **{"stones.gangue_ratio": list(ratios)})
        command = [tmp_path / "e nv" / "bin" / "python", "-m", "dem", "campaign", "campaign.toml", "--out=-out"]
        return subprocess.run(command, cwd=here, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True,
                              text=True, check=False)
    first = run(0.0)
    assert first.returncode == 0 and "1 runs, 1 to run" in first.stdout, first.stderr
    (first_run,) = (here / "-out").glob("*/*/run.json")
    before = first_run.stat().st_mtime_ns
    again = run(1.0, 0.0)
    assert again.returncode == 0 and "2 runs, 1 to run" in again.stdout, again.stderr
    assert_hertz(here / "-out")
    assert sorted(p.name for p in first_run.parents[1].glob("ratio_*")) == ["ratio_000", "ratio_100"]
    assert first_run.stat().st_mtime_ns == before


def test_a_plan_holds_every_combination_once_and_repeats(tmp_path):
    file = campaign_file(tmp_path, **{"stones.speed_m_s": [1.0, 2.0, 2.0], "stones.gangue_ratio": [0.0, 1.0],
                                      "stones.positions_m": [[[0.0, 0.0]], [[0.1, 0.0]]]})
    runs = plan_campaign(file)
    assert {run["scene"] for run in runs} == {str(STONE.resolve())}
    assert len(runs) == len({run["place"] for run in runs}) == 2 * 2 * 2
    assert plan_campaign(file) == runs
    write_campaign_runs(runs, tmp_path)
    assert list(pd.read_csv(tmp_path / "plan.csv")["stones.speed_m_s"].unique()) == [1.0, 2.0]
    # What `--set` reads is what was planned.
    np_ranks, arguments = read_campaign_runs(tmp_path)[runs[5]["place"]]
    assert np_ranks == 1
    assert main(["deck", *arguments, "--out", str(tmp_path / "deck")]) == 0
    assert f"velocity        all set 0 0 {-float(runs[5]['stones.speed_m_s'])}" in (
        tmp_path / "deck" / "deck" / "deck.liggghts").read_text()


def test_a_changed_scene_gets_other_directories(tmp_path):
    vary = {"stones.gangue_ratio": [0.0]}
    before = {run["place"] for run in plan_campaign(campaign_file(tmp_path, **vary))}
    changed = tmp_path / "changed.toml"
    changed.write_text(STONE.read_text().replace("duration_s = 3e-4", "duration_s = 4.5e-4"))
    file = campaign_file(tmp_path, **vary)
    file.write_text(file.read_text().replace(str(STONE), str(changed)))
    after = {run["place"] for run in plan_campaign(file)}
    assert before.isdisjoint(after)
    assert scene_hash(read_scene(changed)) != scene_hash(read_scene(STONE))


@pytest.mark.parametrize("vary, words", [
    ({"stones.sped_m_s": [1.0]}, ["stones.sped_m_s", "unknown key"]),
    ({"stones.speed_m_s": []}, ["stones.speed_m_s", "at least one"]),
    ({"stones.speed_m_s": [-1.0]}, ["stones.speed_m_s", "-1.0"]),
    ({"stones.speed_m_s.x": [1.0]}, ["stones.speed_m_s.x", "no table"]),
    ({"stones.gangue_ratio": [0.5]}, ["stones.gangue_ratio", "0.5", "multiple"]),
    ({"stones.speed_m_s": list(range(1, 1200)), "stones.seed": list(range(1200))}, ["1438800", "1000000"]),
])  # fmt: skip
def test_a_wrong_campaign_is_refused_before_anything_is_written(tmp_path, vary, words):
    with pytest.raises(InputError) as error:
        plan_campaign(campaign_file(tmp_path, **vary))
    assert all(word in str(error.value) for word in words) and "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["stones.speed_m_s", "stones.speed_m_s=", "stones.speed_m_s=1\nx=2", "a=$(id)", "=1"])
def test_a_wrong_set_is_refused(tmp_path, capsys, text):
    assert main(["deck", str(STONE), "--set", text, "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1 and not list(tmp_path.iterdir())


@pytest.mark.validate
def test_two_hundred_runs_through_slurm(tmp_path):
    """A real one-node Slurm."""
    if missing():
        pytest.skip(f"not installed: {', '.join(missing())} (Debian: slurm-wlm, munge; `make validate` installs them)")
    speeds = [round(float(v), 4) for v in np.linspace(0.5, 4.0, 100)]
    file = campaign_file(tmp_path, **{"stones.gangue_ratio": [0.0, 1.0], "stones.speed_m_s": speeds})
    with private_slurm(tmp_path / "slurm", cpus=2) as environment:
        done = run_campaign(file, tmp_path / "out", "--profile", "slurm", "--jobs", "50", environment=environment)
    assert done.returncode == 0, done.stderr[-3000:]
    assert len(read_campaign_runs(tmp_path / "out")) == 200
    assert_hertz(tmp_path / "out")
