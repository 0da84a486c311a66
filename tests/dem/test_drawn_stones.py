"""Stones drawn from distributions: what is drawn has the law that was asked for, and the list is what falls."""

import numpy as np
import pytest
from scenes_of_tests import SCENES
from scipy import stats

from common.scene.distribution import Distribution
from common.scene.scene import changed_scene
from common.tables import InputError
from dem.deck.render import write_deck
from dem.run.prepare import prepare
from dem.run.run import run_scene
from dem.stones.arrangement import gangue_ratio, stones_of
from dem.stones.assembly import assemble

NO_VOLLEY = {f"stones.{key}": None for key in (
    "count", "radius_m", "speed_m_s", "positions_m", "gangue_order", "arrival_s")}
DRAWN = {"size_m": [0.01, 0.03], "speed_m_s": [1.0, 3.0]}
STREAM = {"size_m": 0.02, "speed_m_s": 3.0, "arrival_s": [0.0, 1.0], "rate_1_s": 10.0}
SIZE = np.pi / 6  # volume over the cube of the diameter
N = 20_000


def scene_of(base="small", way="drawn", table=None, **changes):
    table = table or DRAWN
    keys = NO_VOLLEY | ({"stones.gangue_ratio": None} if way == "each" else {}) | {f"stones.{way}": table}
    if way == "drawn" and not {"rate_1_s", "rate_kg_s"} & table.keys():
        keys["stones.count"] = 40
    return changed_scene(SCENES / f"{base}.toml", keys | changes)


def test_a_lognormal_law_by_its_closed_form():
    drawn = Distribution(lognormal_cv=0.4).draw(N, np.random.default_rng(1))
    sigma = np.sqrt(np.log(1 + 0.4**2))
    expected = stats.truncnorm(-3, 3, loc=-sigma**2 / 2, scale=sigma)
    assert stats.kstest(np.log(drawn), expected.cdf).pvalue > 0.01


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_stream_of_one_material_has_no_other_share(share):
    """Whatever the masses: a sum that is rounded in another order may come out above 1."""
    scene = scene_of(table={"size_m": [0.01, 0.03], "speed_m_s": 3.0, "arrival_s": [0.0, 1.0], "rate_1_s": 30.0},
                     **{"stones.gangue_ratio": share})
    stones, rng = stones_of(scene, "scene"), np.random.default_rng(1)
    shares = {gangue_ratio(scene, stones, rng.lognormal(size=len(stones))) for _ in range(1000)}
    assert shares == {share}


def test_rosin_rammler_is_a_law_by_mass():
    """The mass above a size, drawn by number, against exp(-(d/size)^n) between the bounds."""
    law = Distribution(rosin_rammler_m=0.04, exponent=1.5, within=(0.02, 0.08))
    d = law.draw(N, np.random.default_rng(1))
    assert 0.02 <= d.min() and d.max() <= 0.08
    retained = lambda x: np.exp(-(x / 0.04) ** 1.5)  # noqa: E731
    for x in (0.03, 0.04, 0.05, 0.065):
        above = (d[d > x] ** 3).sum() / (d**3).sum()
        assert above == pytest.approx((retained(x) - retained(0.08)) / (retained(0.02) - retained(0.08)), abs=0.012)


@pytest.mark.parametrize("many", [{}, {"rate_1_s": 400.0}], ids=["by number", "by mass"])
def test_the_share_of_gangue_is_the_nearest_that_whole_stones_allow(many):
    table = {"size_m": [0.01, 0.03], "speed_m_s": [1.0, 3.0], "footprint_m": [[-0.2, 0.2], [-0.2, 0.2]]} | many
    scenes = [scene_of(table=table, **{"stones.gangue_ratio": ratio, "stones.drawn.arrival_s": [0.0, 0.1]})
              for ratio in (0.0, 0.3, 0.6, 1.0)]
    lists = [stones_of(scene, "scene") for scene in scenes]
    for scene, stones in zip(scenes, lists):
        mass = np.array([s.radius_m**3 * scene.materials[s.material].density_kg_m3 for s in stones])
        assert gangue_ratio(scene, stones, mass) == pytest.approx(scene.stones.gangue_ratio, abs=1 / 80)
    for less, more in zip(lists, lists[1:]):  # the same stones; only materials change
        assert [(s.radius_m, s.place_m, s.seed) for s in less] == [(s.radius_m, s.place_m, s.seed) for s in more]


def test_a_stream_has_its_rate_and_its_mass():
    stream = {"size_m": [0.02, 0.04], "speed_m_s": 3.0, "arrival_s": [0.5, 2.5]}
    stones = stones_of(scene_of(table=stream | {"rate_1_s": 50.0}), "scene")
    arrival = np.array([s.arrival_s for s in stones])
    assert len(stones) == 100 and np.all(np.diff(arrival) > 0) and 0.5 <= arrival[0] and arrival[-1] <= 2.5
    scene = scene_of(table=stream | {"rate_kg_s": 2.0}, **{"stones.gangue_ratio": 0.3})
    stones = stones_of(scene, "scene")
    mass = np.array([SIZE * (2 * s.radius_m) ** 3 * scene.materials[s.material].density_kg_m3 for s in stones])
    assert mass.sum() == pytest.approx(4.0, abs=1.5 * mass.max())
    assert gangue_ratio(scene, stones, mass) == pytest.approx(0.3, abs=mass.max() / mass.sum())


def test_a_drop_height_needs_gravity():
    with pytest.raises(InputError, match="drop_height_m.*time.gravity_m_s2"):
        scene_of(table={"size_m": 0.02, "drop_height_m": 0.5}, **{"stones.count": 5, "time.gravity_m_s2": 0.0})


def test_a_drop_height_is_a_speed():
    scene = scene_of(table={"size_m": 0.02, "drop_height_m": 0.5}, **{"stones.count": 5})
    assert stones_of(scene, "scene")[0].velocity_m_s == pytest.approx((0, 0, -np.sqrt(2 * 9.8 * 0.5)))


EACH = [{"material": "coal", "radius_m": 0.02, "place_m": [0.1, 0.0], "velocity_m_s": 2.0},
        {"material": "gangue", "radius_m": 0.01, "place_m": [-0.1, 0.0], "velocity_m_s": [0.5, 0.0, -1.0],
         "spin_rad_s": [0.0, 30.0, 0.0], "arrival_s": 1e-3, "attitude": [0.6, 0.8, 0.0, 0.0]},
        {"material": "shale", "radius_m": 0.015, "place_m": [0.0, 0.1], "velocity_m_s": [0.0, 0.3, -3.0]}]


def each_scene():
    base = changed_scene(SCENES / "small.toml", {})
    shale = base.materials["coal"].model_dump() | {"density_kg_m3": 2000.0, "kind": "coal"}
    pair = {"restitution": 0.4, "friction": 0.3}
    contacts = {f"contacts.{key}": pair for key in ("shale_plate", "coal_shale", "gangue_shale", "shale_shale")}
    return scene_of(way="each", table=EACH, **{"materials.shale": shale, "time.duration_s": 3e-3}, **contacts)


@pytest.mark.slow
def test_stones_one_by_one_are_as_they_were_given(tmp_path):
    """Mass, size, velocity, kinetic energy and momentum at the start, and three materials in one run whose ledger
    closes."""
    scene = each_scene()
    one = assemble(scene, stones_of(scene, "scene"))
    assert one.stone_materials == ["coal", "gangue", "shale"] and [s.name for s in one.substances] == ["coal", "gangue", "shale"]
    mass = [density * 4 / 3 * np.pi * e["radius_m"] ** 3 for density, e in zip((1380.0, 2400.0, 2000.0), EACH)]
    assert one.stone_mass_kg == pytest.approx(mass)
    velocity, omega = one.start_motion()
    momentum = np.array([(one.mass_kg[:, None] * velocity)[one.agglomerate == k].sum(axis=0) for k in range(3)])
    assert momentum[1] == pytest.approx(mass[1] * np.array([0.5, 0.0, -1.0 + 9.8e-3]), abs=1e-12)
    assert np.allclose(omega[one.agglomerate == 1], [0, 30, 0]) and np.allclose(omega[one.agglomerate != 1], 0)
    m, r, x = (values[one.agglomerate == 1] for values in (one.mass_kg, one.radius_m, one.center_m))
    arm = x - m @ x / m.sum()
    inertia = m @ (arm[:, 0] ** 2 + arm[:, 2] ** 2 + 0.4 * r**2)  # about y
    spun = one.kinetic_start_J[1] - 0.5 * mass[1] * (0.5**2 + (1 - 9.8e-3) ** 2)
    assert spun == pytest.approx(0.5 * inertia * 30**2, rel=1e-6)
    summary = run_scene(scene, "scene", tmp_path / "run")
    assert abs(summary["energy"]["closure"]) < 0.01
    assert summary["materials"] == ["coal", "gangue", "shale"] and summary["gangue_ratio"] == pytest.approx(1 / 3)


@pytest.mark.slow
def test_the_volley_of_the_paper_said_stone_by_stone_is_the_same_deck(tmp_path):
    """To the last byte of every file that the engine reads, so that the results are the same."""
    coarse = {"stones.agglomerate.subspheres": 40, "stones.agglomerate.contact": "sub_spheres", "stones.seed": 20011,
              "plate.max_frequency_Hz": 800.0}
    volley = changed_scene(SCENES / "paper.toml", coarse | {"stones.gangue_ratio": 0.3})
    each = [{"material": s.material, "radius_m": s.radius_m, "place_m": [s.place_m[0], s.place_m[1]],
             "velocity_m_s": -s.velocity_m_s[2]} for s in stones_of(volley, "volley")]
    for name, scene in (("volley", volley), ("each", scene_of("paper", "each", each, **coarse))):
        prepared = prepare(scene, name, tmp_path)
        write_deck(tmp_path / name, prepared.scene, prepared.assembly, prepared.step, prepared.modes)
    files = sorted(file.name for file in (tmp_path / "each").iterdir())
    assert "atoms.data" in files and len(each) == 10
    for file in files:
        assert (tmp_path / "each" / file).read_bytes() == (tmp_path / "volley" / file).read_bytes(), file


def test_a_turned_stone_is_the_same_stone_turned():
    scene = each_scene()
    stones = stones_of(scene, "scene")
    upright = assemble(scene, [stones[0]])
    half_turn = assemble(scene, [type(stones[0])(**{**vars(stones[0]), "attitude": (0.0, 0.0, 0.0, 1.0)})])
    about = np.array([0.1, 0.0, 0.0])
    assert np.allclose((half_turn.center_m - about)[:, :2], -(upright.center_m - about)[:, :2], atol=1e-12)
    assert np.allclose(half_turn.bond_vector_m[:, :2], -upright.bond_vector_m[:, :2])


def test_a_smaller_stone_is_the_larger_one_to_scale():
    """By similarity: sub-spheres and bonds go with the size, the compliance of the surface with its inverse."""
    smooth = {"stones.agglomerate.contact": "smooth", "stones.agglomerate.subspheres": 100, "stones.count": 1,
              "stones.positions_m": [[0.0, 0.0]], "stones.gangue_ratio": 0.0}
    scenes = [changed_scene(SCENES / "small.toml", smooth | {"stones.radius_m": r}) for r in (0.02, 0.04)]
    small, large = (assemble(s, stones_of(s, "scene")) for s in scenes)
    assert np.allclose(2 * small.bond_vector_m, large.bond_vector_m)
    assert np.allclose(8 * small.mass_kg, large.mass_kg)
    assert small.surfaces[0].compliance_m_N == pytest.approx(2 * large.surfaces[0].compliance_m_N)


@pytest.mark.parametrize("way, table, changes, said", [
    ("drawn", DRAWN | {"size_m": [0.03, 0.01]}, {}, "stones.drawn.size_m.within"),
    ("drawn", DRAWN | {"size_m": "large"}, {}, "stones.drawn.size_m = 'large': must be a number, a pair, or a table"),
    ("drawn", DRAWN | {"size_m": -1.0}, {}, "stones.drawn.size_m = -1.0: must be from"),
    ("drawn", DRAWN | {"speed": 1.0}, {}, "stones.drawn.speed = 1.0: unknown key"),
    ("each", [EACH[0] | {"strength_factor": 2.0}], {}, "unknown key; use scatter.strength_factor, or a material of its own;"),
    ("drawn", DRAWN, {"output.view_interval_s": 0.0}, "unknown key; use time.view_interval_s"),
    ("drawn", DRAWN, {"materials.coal.bond.pressure_threshold_Pa": 1e6}, "unknown key; use pressure_strengthening"),
    ("drawn", DRAWN | {"size_m": {"rosin_rammler_m": 0.02, "exponent": 2.0, "within": [0.0, 1.0]}}, {},
     "size_m.within = .*from above 0"),
    ("drawn", DRAWN | {"size_m": {"uniform": [0.01, 0.03]}}, {}, r"unknown key; use \[least, most\] alone"),
    ("drawn", DRAWN, {"stones.radius_m": 0.02}, "stones.radius_m = 0.02: must be left out where stones.drawn"),
    ("drawn", DRAWN, {"stones.gangue_ratio": None}, "stones.gangue_ratio"),
    ("drawn", DRAWN | {"size_m": 0.2}, {}, "find no place"),
    ("drawn", DRAWN, {"stones.count": None}, "stones.count = None: one of this, drawn.rate_1_s and drawn.rate_kg_s"),
    ("drawn", STREAM, {"stones.count": 40}, "stones.count = 40: one of this, drawn.rate_1_s and drawn.rate_kg_s"),
    ("drawn", STREAM | {"rate_kg_s": 1.0}, {}, "stones.drawn.rate_kg_s = 1.0: must be left out where rate_1_s"),
    ("drawn", DRAWN | {"count": 4}, {}, "stones.drawn.count = 4: unknown key; use stones.count"),
    ("each", [EACH[0] | {"speed_m_s": 3.0}], {}, "stones.each.0.speed_m_s = 3.0: unknown key; use velocity_m_s = SPEED"),
    ("each", [EACH[0] | {"velocity_m_s": -3.0}], {}, "stones.each.0.velocity_m_s = -3.0: must be greater than or equal to 0"),
    ("each", [EACH[0] | {"velocity_m_s": [1.0, 2.0]}], {}, "stones.each.0.velocity_m_s"),
    ("drawn", STREAM | {"rate_1_s": 1e6}, {}, "1000000 stones"),
    ("drawn", STREAM | {"arrival_s": 1.0}, {}, "stones.drawn.arrival_s = .*must be .begin, end"),
    ("drawn", STREAM | {"arrival_s": [1.0, 1.0]}, {}, "stones.drawn.arrival_s = .*some time apart"),
    ("each", [EACH[0] | {"material": "slate"}], {}, "stones.each.0.material = 'slate': unknown material"),
    ("each", [EACH[0], EACH[0] | {"shape": "cube"}], {}, "stones.each.1.shape = 'cube': unknown shape"),
    ("each", [EACH[0], EACH[0]], {}, "stones 1 and 2 overlap"),
    ("each", [EACH[0] | {"place_m": [0.3, 0.0]}], {}, "stones.each.0.place_m = .*misses the plate"),
    ("each", [EACH[0] | {"velocity_m_s": [0.0, 0.0, 1.0]}], {}, "stones.each.0.velocity_m_s"),
    ("each", [EACH[0] | {"attitude": [1.0, 1.0, 0.0, 0.0]}], {}, "stones.each.0.attitude"),
])
def test_bad_input_is_refused_in_one_line(way, table, changes, said):
    table = [{k: v for k, v in one.items() if v is not None} for one in table] if way == "each" else table
    with pytest.raises(InputError, match=said) as refused:
        prepare(scene_of(way=way, table=table, **changes), "scene", None)
    assert "\n" not in str(refused.value)
