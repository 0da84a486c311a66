"""A data set's plan: draws that follow from the seed alone, places and arrivals as asked for, a build that goes on."""

import json

import numpy as np
import pytest
from scenes_of_tests import SCENES, changed

from common.messages import show_messages
from common.scene import read_scene
from common.tables import InputError
from dem.batch.dataset import build, plan_dataset
from dem.stones.arrangement import stones_of
from dem.stones.assembly import assemble
from dem.stones.stone import places_m

COARSE = {"stones.agglomerate.subspheres": 40, "stones.agglomerate.contact": "sub_spheres"}
PLAN = """scene = "{scenes}/paper.toml"
seed = 7
[changes]
"stones.agglomerate.subspheres" = 40
"stones.agglomerate.contact" = "sub_spheres"
[families.ring]
groups = 3
runs_per_group = 11
arrangement = true
packing = true
[families.free]
groups = 22
runs_per_group = 1
free_positions = true
speed_m_s = [2.0, 4.0]
damping_ratio = [0.005, 0.02]
arrival_spread_s = 2e-4
strength_scatter = 0.15
"""


def plan(tmp_path, text=PLAN, name="plan.toml"):
    file = tmp_path / name
    file.write_text(text.format(scenes=SCENES))
    return file


def test_a_group_is_one_draw_and_a_seed_gives_the_same_again(tmp_path):
    runs = {str(run.directory): run.scene for run in plan_dataset(plan(tmp_path))}
    assert len(runs) == 33 + 22
    ring = [runs[f"ring/001/ratio_{10 * k:03d}"] for k in range(11)]
    assert len({scene.stones.seed for scene in ring}) == len({scene.stones.gangue_order for scene in ring}) == 1
    assert [scene.stones.gangue_ratio for scene in ring] == [k / 10 for k in range(11)]
    assert runs["ring/002/ratio_050"].stones.gangue_order != ring[0].stones.gangue_order
    fewer = PLAN[:PLAN.index("[families.ring]")] + PLAN[PLAN.index("[families.free]"):].replace("groups = 22", "groups = 11")
    for run in plan_dataset(plan(tmp_path, fewer, "fewer.toml")):
        assert runs[str(run.directory)] == run.scene


def test_ranges_are_kept_and_ratios_come_equally_often(tmp_path):
    free = [run.scene for run in plan_dataset(plan(tmp_path)) if run.directory.parts[0] == "free"]
    ratios = [scene.stones.gangue_ratio for scene in free]
    assert all(ratios.count(k / 10) == 2 for k in range(11))
    for value, low, high in [([s.stones.speed_m_s for s in free], 2, 4), ([s.plate.damping_ratio for s in free], 0.005, 0.02),
                             (np.array([s.stones.arrival_s for s in free]), 0, 2e-4)]:
        assert low <= np.min(value) < low + 0.15 * (high - low) and high - 0.15 * (high - low) < np.max(value) <= high
    spread = np.log([s.stones.strength_factor for s in free]).std()
    assert spread == pytest.approx(0.15, rel=0.15)
    for scene in free:
        place = places_m(stones_of(scene, ""))
        assert np.all(np.abs(place) <= 0.25 - 0.025)
        apart = np.linalg.norm(place[:, None] - place, axis=2)[np.triu_indices(10, 1)]
        assert apart.min() >= 0.05


def test_a_stone_that_arrives_later_lies_higher():
    scene = changed("paper", COARSE | {"stones.arrival_s": [0.0, 1e-3, *[2e-4] * 8],
                                       "stones.strength_factor": [1.0, 2.0, *[0.5] * 8]})
    one = assemble(scene, stones_of(scene, ""))
    lowest = np.array([(one.center_m[:, 2] - one.radius_m)[one.agglomerate == k].min() for k in range(10)])
    t = np.array(scene.stones.arrival_s)
    assert lowest == pytest.approx(np.where(t > 0, 3.0 * t - 0.5 * 9.8 * t**2, 2e-5), abs=1e-12)  # the path traced back
    plain = changed("paper", COARSE)
    ratio = one.bond_strength_factor / assemble(plain, stones_of(plain, "")).bond_strength_factor
    stone = one.agglomerate[one.bond_first]
    assert ratio == pytest.approx(np.array(scene.stones.strength_factor)[stone], rel=1e-12)


@pytest.mark.parametrize("old, new, words", [
    ("groups = 3", "groups = 0", ["families.ring.groups = 0", "greater than or equal to 1"]),
    ("arrangement = true", "arangement = true", ["families.ring.arangement", "unknown key"]),
    ("speed_m_s = [2.0, 4.0]", "speed_m_s = [2.0, -4.0]", ["families.free.speed_m_s", "-4.0"]),
    ("strength_scatter = 0.15", "position_scatter_m = 0.01", ["position_scatter_m", "free_positions"]),
    ('"stones.agglomerate.subspheres"', '"stone.agglomerate.subspheres"', ["paper.toml", "stone = ", "unknown key"]),
    ("paper.toml", "none.toml", ["none.toml", "cannot be read"]),
])
def test_a_wrong_plan_is_refused_in_one_line(tmp_path, old, new, words):
    assert old in PLAN
    with pytest.raises(InputError) as refused:
        plan_dataset(plan(tmp_path, PLAN.replace(old, new, 1)))
    assert "\n" not in str(refused.value) and all(word in str(refused.value) for word in words)


@pytest.mark.parametrize("key, values, word", [("arrival_s", [0.0] * 9, "9 values"), ("strength_factor", [0.0] * 10, "0.0"),
                                               ("arrival_s", [-1e-3] * 10, "-0.001")])
def test_values_of_single_stones_are_checked(key, values, word):
    with pytest.raises(InputError, match=f"stones.{key}.*{word}"):
        changed("paper", {f"stones.{key}": values})


def test_a_build_goes_on_where_it_was_stopped(tmp_path, capsys):
    rigid = (SCENES / "hertz_coal.toml").read_text()
    single = (SCENES.parent / "tests" / "single.toml").read_text()
    scene = single[:single.index("[plate]")] + rigid[rigid.index("[plate]"):]
    (tmp_path / "small.toml").write_text(scene)
    text = """scene = "small.toml"
seed = 1
[changes]
"stones.agglomerate.subspheres" = 40
"stones.agglomerate.contact" = "sub_spheres"
"time.duration_s" = 3e-4
[families.one]
groups = {groups}
runs_per_group = 2
packing = true
"""
    file, out = tmp_path / "plan.toml", tmp_path / "out"
    file.write_text(text.format(groups=1))
    show_messages()
    assert build(file, out, jobs=2) == 0
    runs = sorted(out.glob("*/*/ratio_*"))
    assert [run.name for run in runs] == ["ratio_000", "ratio_100"]
    assert all({"run.json", "signals.parquet"} <= {f.name for f in run.iterdir()} and not (run / "deck").exists() for run in runs)
    before = [(run / "run.json").stat().st_mtime_ns for run in runs]
    file.write_text(text.format(groups=2))
    capsys.readouterr()
    assert build(file, out, jobs=1) == 0
    assert "4 runs, 2 to run" in capsys.readouterr().out
    assert [(run / "run.json").stat().st_mtime_ns for run in runs] == before
    seeds = {json.loads((run / "run.json").read_text())["scene"]["stones"]["seed"] for run in out.glob("*/*/ratio_*")}
    assert len(seeds) == 2 and read_scene(tmp_path / "small.toml").stones.seed not in seeds
