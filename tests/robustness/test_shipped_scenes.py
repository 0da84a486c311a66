"""Every scene that is shipped sweeps to a report, large ones at small size; one of stones given one by one is run."""

import json
import tomllib

import pytest

from common.scene.scene import read_scene
from tests.robustness.small import SCENES, run

NAMES = sorted(file.stem for file in SCENES.glob("*.toml") if "stones" in tomllib.loads(file.read_text()))
SPHERES = ("elastic_plate", "hertz_coal", "hertz_gangue")
FAST = SPHERES[:2]  # the two of Hertz differ in the material alone
STEPS_OF_DRAWN = 10


def made_small(scene):
    """Changes by key: small stones for a short time, streams on a plate of few modes; contacts and shapes stay."""
    stones = scene.stones
    if scene.name in (*SPHERES, "small"):
        return {}
    changes = {}
    if stones.agglomerate is not None:
        changes["stones.agglomerate.subspheres"] = 200 if stones.agglomerate.contact == "smooth" else 100
    if not stones.is_stream:
        until_s = 0.023 if stones.each else 0.01  # the last stone of sizes.toml arrives at 0.02 s
        return changes | {"time.duration_s": min(until_s, scene.time.duration_s)}
    rate = "rate_1_s" if stones.drawn.rate_1_s else "rate_kg_s"
    return changes | {"plate.max_frequency_Hz": 800.0, "time.duration_s": 0.06, f"stones.drawn.{rate}": 100.0,
                      "stones.drawn.arrival_s": "[0.0, 0.05]"}


def swept(name, out):
    """Sweep the scene, or run one whose stones are given one by one, and make the report. Returns the scene, the
    summaries of its runs, and the exit codes and errors of both."""
    file = SCENES / f"{name}.toml"
    scene = read_scene(file)
    changes = [word for key, value in made_small(scene).items() for word in ("--set", f"{key}={value}")]
    words = ["sweep", file, "--out", out, "--jobs", "2"] if scene.stones.shares_gangue else [
        "run", file, "--out", out / "ratio_000"]
    done = [run("dem", *words, *changes), run("report", out)]
    summaries = [json.loads(file.read_text()) for file in sorted(out.glob("ratio_*/run.json"))]
    return scene, summaries, [code for code, _, _ in done], [errors for _, _, errors in done]


def expected_ratios(stones):
    """By number of each stone; of drawn stones by mass, which whole stones meet at both ends only."""
    if stones.count:
        return [k / stones.count for k in range(stones.count + 1)]
    if stones.each:
        return [pytest.approx(sum(one.material == "gangue" for one in stones.each) / len(stones.each))]
    return [pytest.approx(0.0), *(STEPS_OF_DRAWN - 1) * [pytest.approx(0.5, abs=0.5)], pytest.approx(1.0)]


@pytest.mark.slow
@pytest.mark.parametrize("name", [*FAST, *(pytest.param(name, marks=pytest.mark.validate)
                                           for name in sorted(set(NAMES) - set(FAST)))])
def test_a_shipped_scene_sweeps_to_a_report(tmp_path, name):
    out = tmp_path / "runs of this scene"
    scene, runs, codes, errors = swept(name, out)
    assert codes == [0, 0] and "Traceback" not in "".join(errors), errors
    assert [summary["status"] for summary in runs] == ["finished"] * len(runs)
    assert max(abs(summary["energy"]["closure"]) for summary in runs) < 0.01
    ratios = [summary["gangue_ratio"] for summary in runs]
    assert ratios == expected_ratios(scene.stones) and ratios == sorted(ratios)
    assert (out / "report.html").stat().st_size > 10_000


def test_stones_given_one_by_one_are_not_swept(tmp_path):
    code, _, errors = run("dem", "sweep", SCENES / "sizes.toml", "--out", tmp_path / "out")
    assert code == 2 and "stones.each" in errors and errors.count("\n") == 1 and not (tmp_path / "out").exists()
