"""A data set's plan: draws that follow from the seed alone, places and arrivals as asked for, a build that goes on."""

import json

import numpy as np
import pytest
from scenes_of_tests import SCENES, changed, one_by_one

from analysis import read_run
from analysis.sweep.runs import fallen, true_ratio
from common.process.messages import show_messages
from common.scene.scene import read_scene
from common.tables import InputError
from dem.batch.dataset import build, plan_dataset
from dem.stones.arrangement import stones_of
from dem.stones.assembly import assemble
from dem.stones.stone import places_m
from recognition.stream.recognise import QUIET_S

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
speed_m_s = [2.0, 4.0]
damping_ratio = [0.005, 0.02]
changes = {{ "scatter.arrival_s" = [0.0, 2e-4], "scatter.strength_factor" = {{ lognormal_cv = 0.15 }} }}
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


def test_groups_share_as_many_packings_as_asked_for_and_draw_the_rest_as_before(tmp_path):
    own = {str(run.directory): run.scene for run in plan_dataset(plan(tmp_path))}
    shared = {str(run.directory): run.scene for run in plan_dataset(plan(tmp_path, "packings = 2\n" + PLAN, "shared.toml"))}
    seeds = [shared[f"ring/{group:03d}/ratio_050"].stones.seed for group in range(3)]
    assert seeds[0] == seeds[2] != seeds[1]  # in turn
    for name, scene in shared.items():
        changed_back = scene.stones.model_copy(update={"seed": own[name].stones.seed})
        assert scene.model_copy(update={"stones": changed_back}) == own[name]
    free = [scene.stones.seed for name, scene in shared.items() if name.startswith("free")]
    assert set(free) == {own["free/000/ratio_" + name[-3:]].stones.seed for name in own if name.startswith("free/000")}


def test_ranges_are_kept_and_ratios_come_equally_often(tmp_path):
    free = [run.scene for run in plan_dataset(plan(tmp_path)) if run.directory.parts[0] == "free"]
    ratios = [scene.stones.gangue_ratio for scene in free]
    assert all(ratios.count(k / 10) == 2 for k in range(11))
    for value, low, high in [([s.stones.speed_m_s for s in free], 2, 4), ([s.plate.damping_ratio for s in free], 0.005, 0.02),
                             ([stone.arrival_s for s in free for stone in stones_of(s, "")], 0, 2e-4)]:
        assert low <= np.min(value) < low + 0.15 * (high - low) and high - 0.15 * (high - low) < np.max(value) <= high
    spread = np.log([stone.strength_factor for s in free for stone in stones_of(s, "")]).std()
    assert spread == pytest.approx(0.15, rel=0.15)
    for scene in free:
        place = places_m(stones_of(scene, ""))
        assert np.all(np.abs(place) <= 0.25 - 0.025)
        apart = np.linalg.norm(place[:, None] - place, axis=2)[np.triu_indices(10, 1)]
        assert apart.min() >= 0.05


def test_a_stone_that_arrives_later_lies_higher():
    t = np.array([0.0, 1e-3, *[2e-4] * 8])
    scene = one_by_one(changed("paper", COARSE | {"scatter.strength_factor": 2.0}), arrival_s=t)
    one = assemble(scene, stones_of(scene, ""))
    lowest = np.array([(one.center_m[:, 2] - one.radius_m)[one.agglomerate == k].min() for k in range(10)])
    assert lowest == pytest.approx(np.where(t > 0, 3.0 * t - 0.5 * 9.8 * t**2, 2e-5), abs=1e-12)  # the path traced back
    plain = changed("paper", COARSE)
    ratio = one.bond_strength_factor / assemble(plain, stones_of(plain, "")).bond_strength_factor
    assert ratio == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("old, new, words", [
    ("groups = 3", "groups = 0", ["families.ring.groups = 0", "greater than or equal to 1"]),
    ("arrangement = true", "arangement = true", ["families.ring.arangement", "unknown key"]),
    ("speed_m_s = [2.0, 4.0]", "speed_m_s = [2.0, -4.0]", ["families.free.speed_m_s", "-4.0"]),
    ('"stones.agglomerate.subspheres"', '"stone.agglomerate.subspheres"', ["paper.toml", "stone = ", "unknown key"]),
    ("paper.toml", "none.toml", ["none.toml", "cannot be read"]),
])
def test_a_wrong_plan_is_refused_in_one_line(tmp_path, old, new, words):
    assert old in PLAN
    with pytest.raises(InputError) as refused:
        plan_dataset(plan(tmp_path, PLAN.replace(old, new, 1)))
    assert "\n" not in str(refused.value) and all(word in str(refused.value) for word in words)


@pytest.mark.slow
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
    assert build(file, out, jobs=2).exit_code == 0
    runs = sorted(out.glob("*/*/ratio_*"))
    assert [run.name for run in runs] == ["ratio_000", "ratio_100"]
    assert all({"run.json", "signals.parquet"} <= {f.name for f in run.iterdir()} and not (run / "deck").exists() for run in runs)
    before = [(run / "run.json").stat().st_mtime_ns for run in runs]
    file.write_text(text.format(groups=2))
    capsys.readouterr()
    assert build(file, out, jobs=1).exit_code == 0
    assert "4 runs, 2 to run" in capsys.readouterr().out
    assert [(run / "run.json").stat().st_mtime_ns for run in runs] == before
    seeds = {json.loads((run / "run.json").read_text())["scene"]["stones"]["seed"] for run in out.glob("*/*/ratio_*")}
    assert len(seeds) == 2 and read_scene(tmp_path / "small.toml").stones.seed not in seeds


STREAMS = """seed = 7
[changes]
"stones.agglomerate.subspheres" = 24
"stones.agglomerate.contact" = "sub_spheres"
"plate.max_frequency_Hz" = 800.0
"time.view_interval_s" = 0.1
[streams.fast]
scene = "{scenes}/stream.toml"
groups = GROUPS
stones = 4
rate_1_s = [100.0, 400.0]
gangue_ratio = [0.2, 0.8]
speed_m_s = [2.0, 4.0]
sizes_m = [0.03, [0.03, 0.05]]
rings_s = 0.01
"""


def test_a_group_of_streams_is_one_stream(tmp_path):
    runs = plan_dataset(plan(tmp_path, STREAMS.replace("GROUPS", "40")))
    streams = [run.scene.stones.drawn for run in runs]
    rates = np.array([one.rate_1_s for one in streams])
    assert len(runs) == 40 == len({run.scene.stones.seed for run in runs}) and np.all((rates >= 100) & (rates <= 400))
    assert abs(np.median(rates) - 200) < 60  # evenly in its logarithm
    for run, one in zip(runs, streams, strict=True):
        assert len(stones_of(run.scene, "")) == 4 and one.rate_1_s * one.lasts_s == pytest.approx(4)
        assert 0.2 <= run.scene.stones.gangue_ratio <= 0.8 and 2 <= one.speed_m_s.bounds[0] == one.speed_m_s.bounds[1] <= 4
        assert run.scene.time.duration_s == pytest.approx(one.arrival_s.bounds[1] + 0.01)
        assert one.arrival_s.bounds[0] >= 2 * QUIET_S  # as `listen` needs
    assert {one.size_m.bounds for one in streams} == {(0.03, 0.03), (0.03, 0.05)}
    fewer = plan_dataset(plan(tmp_path, STREAMS.replace("GROUPS", "2"), "fewer.toml"))
    assert [run.scene for run in fewer] == [run.scene for run in runs[:2]]


@pytest.mark.slow
def test_streams_are_built_once_and_know_what_fell(tmp_path, capsys):
    file = plan(tmp_path, STREAMS.replace("GROUPS", "1"))
    show_messages()
    assert build(file, tmp_path / "out", 1).exit_code == 0
    run = read_run(tmp_path / "out" / plan_dataset(file)[0].directory)
    stones = fallen(run)
    assert stones["first_contact_s"].notna().all() and true_ratio(stones, 0, 1) == pytest.approx(run.gangue_ratio)
    assert (run.path / "fast.parquet").exists() and not (run.path / "deck").exists()
    assert build(file, tmp_path / "out", 1).exit_code == 0
    assert "1 runs, 0 to run" in capsys.readouterr().out


@pytest.mark.parametrize(("old", "new", "message"), [
    ("rate_1_s = [100.0, 400.0]", "rate_1_s = [400.0, 100.0]", "rate_1_s = .*must ascend"),
    ("stones = 4", "stones = 0", "streams.fast.stones = 0"),
    ("[streams.fast]", "[families]", "families"),
])
def test_a_wrong_family_of_streams_is_refused(tmp_path, old, new, message):
    text = STREAMS.replace("GROUPS", "1")
    assert old in text
    with pytest.raises(InputError, match=message):
        plan_dataset(plan(tmp_path, text.replace(old, new)))
