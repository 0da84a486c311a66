"""Every scene that is shipped sweeps to a report, large ones at small size; one of stones given one by one is run."""

import json
import tomllib

import pytest

from common.scene import read_scene
from tests.robustness.small import SCENES, run

NAMES = sorted(file.stem for file in SCENES.glob("*.toml") if "stones" in tomllib.loads(file.read_text()))
FAST = ("elastic_plate", "hertz_coal", "hertz_gangue")
STEPS_OF_DRAWN = 10


def made_small(scene):
    """Changes by key: small stones for a short time, streams on a plate of few modes; contacts and shapes stay."""
    stones = scene.stones
    if scene.name in (*FAST, "small"):
        return {}
    changes = {"stones.agglomerate.subspheres": 200 if stones.agglomerate.contact == "smooth" else 100}
    if stones.stream is None:
        until_s = 0.023 if stones.each else 0.01  # the last stone of sizes.toml arrives at 0.02 s
        return changes | {"time.duration_s": min(until_s, scene.time.duration_s)}
    rate = "rate_1_s" if stones.stream.rate_1_s else "rate_kg_s"
    return changes | {"plate.max_frequency_Hz": 800.0, "time.duration_s": 0.06, f"stones.stream.{rate}": 100.0,
                      "stones.stream.begin_s": 0.0, "stones.stream.duration_s": 0.05}


def shown(out):
    """Run the report, and return the summaries of its runs."""
    code, _, errors = run("report", out)
    assert code == 0 and "Traceback" not in errors, errors
    assert (out / "report.html").stat().st_size > 10_000
    runs = [json.loads(file.read_text()) for file in sorted(out.glob("ratio_*/run.json"))]
    assert all(run["status"] == "finished" and abs(run["energy"]["closure"]) < 0.01 for run in runs)
    return runs


def sweeps_to_a_report(name, tmp_path):
    file, out = SCENES / f"{name}.toml", tmp_path / "runs of this scene"
    scene = read_scene(file)
    changes = [word for key, value in made_small(scene).items() for word in ("--set", f"{key}={value}")]
    code, _, errors = run("dem", "sweep", file, "--out", out, "--jobs", "2", *changes)
    if not scene.stones.shares_gangue:
        assert code == 2 and "stones.each" in errors and errors.count("\n") == 1 and not out.exists()
        code, _, errors = run("dem", "run", file, "--out", out / "ratio_000", *changes)
    assert code == 0, errors
    ratios = [summary["gangue_ratio"] for summary in shown(out)]
    if scene.stones.shares_gangue:
        steps = scene.stones.count or STEPS_OF_DRAWN
        assert len(ratios) == steps + 1 and ratios == sorted(ratios)
        assert (ratios[0], ratios[-1]) == pytest.approx((0.0, 1.0))
    if scene.stones.count:
        assert ratios == [k / scene.stones.count for k in range(scene.stones.count + 1)]


@pytest.mark.parametrize("name", FAST)
def test_a_shipped_scene_sweeps_to_a_report(tmp_path, name):
    sweeps_to_a_report(name, tmp_path)


@pytest.mark.validate
@pytest.mark.parametrize("name", sorted(set(NAMES) - set(FAST)))
def test_a_larger_shipped_scene_sweeps_to_a_report(tmp_path, name):
    sweeps_to_a_report(name, tmp_path)
