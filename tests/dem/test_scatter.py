"""Stones that each have something of their own, and what counts as gangue (docs/stones.md)."""

from dataclasses import replace
from operator import attrgetter

import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import SCENES, changed

from common.hertz import contact_modulus_Pa, largest_approach_m, stiffness_N_m32
from common.scene.distribution import Distribution
from common.tables import InputError
from dem.batch.dataset import plan_dataset
from dem.run.run import run_scene
from dem.stones.arrangement import gangue_ratio, stones_of
from dem.stones.assembly import assemble, stone_parts
from dem.stones.bonds import bond_network
from dem.stones.contact_patch import stone_surface
from dem.stones.packing import pack_sphere
from dem.stones.stone import substances_of

NATURAL = {"stones.agglomerate.subspheres": 200}
OWN = ("radius_m", "density_factor", "substance.youngs_modulus_factor", "strength_factor", "substance.restitution", "velocity_m_s", "place_m",
       "arrival_s")


@pytest.mark.parametrize("cv", [0.05, 0.22, 0.4])
def test_a_factor_has_the_mean_and_the_variation_that_it_was_given(cv):
    """But for what the cut at three standard deviations takes: 0.3 % of the values."""
    values = Distribution(lognormal_cv=cv).draw(200_000, np.random.default_rng(1))
    assert values.mean() == pytest.approx(1, rel=0.005) and values.std() == pytest.approx(cv, rel=0.035)
    assert values.min() > 0 and np.log(values).std() == pytest.approx(np.sqrt(np.log(1 + cv**2)), rel=0.02)


def test_each_stone_has_its_own_and_the_ratio_changes_none_of_it():
    few, many = (stones_of(changed("natural", {"stones.gangue_ratio": ratio}), "natural") for ratio in (0.2, 0.8))
    for name in OWN:
        values = list(map(attrgetter(name), few))
        assert values == list(map(attrgetter(name), many)) and len(set(values)) == 10
    assert all(0.6 <= stone.substance.restitution <= 0.9 and 0 <= stone.arrival_s <= 5e-3 for stone in few)
    ring = np.array([stone.place_m for stone in stones_of(changed("paper", {}), "paper")])
    places = np.array([stone.place_m for stone in few])
    assert np.linalg.norm(places - ring, axis=1).max() <= 0.02
    other = stones_of(changed("natural", {"scatter.seed": 5}), "natural")
    assert not {s.radius_m for s in other} & {s.radius_m for s in few} and [s.seed for s in other] == [s.seed for s in few]
    slow = stones_of(changed("natural", {"scatter.speed_factor": 0.5}), "natural")
    assert [s.radius_m for s in slow] == [s.radius_m for s in few] and {s.velocity_m_s[2] for s in slow} == {-1.5}


def test_stones_of_the_wide_scene_lie_anywhere_on_the_plate_and_apart():
    places = []
    for seed in range(40):
        stones = stones_of(changed("wide", {"scatter.seed": seed}), "wide")
        assert all(np.abs(stone.place_m).max() <= 0.25 - stone.radius_m for stone in stones)
        places += [np.array(stone.place_m) / (0.25 - stone.radius_m) for stone in stones]
    assert np.mean(places, axis=0) == pytest.approx([0, 0], abs=0.12)
    assert np.std(places, axis=0) == pytest.approx([3**-0.5] * 2, rel=0.1)  # of an even spread over -1..1


@pytest.mark.parametrize("restitution", [1.0, 0.7])
def test_a_stone_of_its_own_meets_the_plate_as_hertz_says_for_it(tmp_path, restitution):
    """Radius, density, modulus, speed and restitution that differ from the scene's: the force by its closed form where
    it is elastic, and the rebound."""
    own = {"radius_factor": 1.2, "density_factor": 0.9, "youngs_modulus_factor": 1.7, "speed_factor": 0.8}
    scene = changed("hertz_coal", {f"scatter.{key}": value for key, value in own.items()}
                    | {"scatter.restitution": restitution, "time.duration_s": 6e-4})
    summary = run_scene(scene, "hertz", tmp_path / "run", show_progress=False)
    coal = scene.materials["coal"].model_copy(update={"youngs_modulus_Pa": 1.7 * scene.materials["coal"].youngs_modulus_Pa})
    radius, speed = 1.2 * 0.025, 0.8 * 3.0
    mass = 0.9 * 1380.0 * 4 / 3 * np.pi * radius**3
    stiffness = stiffness_N_m32(contact_modulus_Pa(coal, scene.plate), radius)
    if restitution == 1:
        assert summary["peak_force_N"] == pytest.approx(stiffness * largest_approach_m(stiffness, mass, speed) ** 1.5, rel=1e-3)
    assert summary["rebound_speed_m_s"][0] == pytest.approx(restitution * speed, rel=5e-3)
    row = pd.read_parquet(tmp_path / "run" / "stones.parquet").iloc[0]
    assert [row.radius_m, row.density_kg_m3, row.youngs_modulus_Pa, row.restitution, row.mass_kg] == pytest.approx(
        [radius, 0.9 * 1380.0, coal.youngs_modulus_Pa, restitution, mass])
    assert summary["stones"]["youngs_modulus_Pa"] == [row.youngs_modulus_Pa] and row.kind == "coal"


def test_compliances_go_with_one_over_the_modulus_and_are_kept_once(tmp_path):
    scene = changed("natural", NATURAL)
    stone = stones_of(scene, "natural")[0]
    found = stone_parts(scene, stone, tmp_path).surface
    kept = sorted(tmp_path.rglob("*surface*"))
    bond, factor = stone.substance.bond, stone.substance.youngs_modulus_factor
    packing = pack_sphere(stone.radius_m, 200, stone.seed)
    center = np.average(packing.center_m, axis=0, weights=packing.radius_m**3)
    packing = replace(packing, center_m=packing.center_m - center)
    expected = stone_surface(packing, bond_network(packing), bond)
    assert found.compliance_m_N == pytest.approx(expected.compliance_m_N, rel=1e-6)
    plain = changed("paper", NATURAL | {"materials.coal": scene.materials["coal"].model_dump(exclude_none=True)})
    other = stone_parts(plain, stones_of(plain, "paper")[0], tmp_path).surface  # the same packing, read
    assert sorted(tmp_path.rglob("*surface*")) == kept
    size = stone.radius_m / 0.025
    assert found.compliance_m_N * factor * size == pytest.approx(other.compliance_m_N, rel=1e-12)


FIVE = [{"material": name, "radius_m": 0.02, "place_m": [0.05 * k - 0.1, y], "velocity_m_s": 2.0}
        for y, names in ((0.1, ["coal"] * 5), (-0.1, [f"rock{k}" for k in range(5)])) for k, name in enumerate(names)]


def five_rocks(kind, **more):
    gangue = changed("small", {}).materials["gangue"].model_dump()
    rocks = {f"materials.rock{k}": gangue | {"density_kg_m3": 2000.0 + 100 * k, "kind": kind} for k in range(5)}
    volley = ("count", "radius_m", "speed_m_s", "positions_m", "gangue_order", "gangue_ratio")
    return changed("small", {f"stones.{key}": None for key in volley} | {"stones.each": FIVE} | rocks | more)


@pytest.mark.slow
def test_stones_with_tables_of_their_own_count_by_their_kind_and_need_no_contacts_of_their_own():
    scene = five_rocks("gangue")
    stones = stones_of(scene, "scene")
    mass = assemble(scene, stones).stone_mass_kg
    assert gangue_ratio(scene, stones, mass) == 0.5
    assert gangue_ratio(scene, stones, mass, "mass") == pytest.approx(11000 / (11000 + 5 * 1380))
    assert scene.contact_of("rock3", "plate") == scene.contacts["gangue_plate"]
    assert scene.contact_of("rock3", "coal") == scene.contacts["coal_gangue"]
    own = five_rocks("gangue", **{"contacts.rock3_plate": {"restitution": 0.3, "friction": 0.1}})
    assert own.contact_of("rock3", "plate").restitution == 0.3
    with pytest.raises(InputError, match="materials.rock0.kind = None: must be given"):
        five_rocks(None)


def test_two_stones_meet_with_what_both_have_gained_on_the_plate():
    scene = changed("paper", {})  # 0.9 on the plate, 0.5 among themselves
    coal, gangue = substances_of(scene).values()
    pair = replace(coal, restitution=0.6).contact_with(replace(gangue, restitution=0.8))
    assert pair.restitution == pytest.approx(0.5 * (0.6 / 0.9 * 0.8 / 0.9) ** 0.5) and pair.friction == 0.6
    assert coal.contact_with(gangue) == scene.contacts["coal_gangue"]


def test_groups_of_a_data_set_draw_their_own_stones(tmp_path):
    file = tmp_path / "plan.toml"
    file.write_text(f'scene = "{SCENES}/natural.toml"\nseed = 7\npackings = 2\n[families.natural]\ngroups = 4\n'
                    "runs_per_group = 2\npacking = true\n")
    runs = plan_dataset(file)
    groups = {run.directory.parent.name: {r.scene.scatter.seed for r in runs if r.directory.parent == run.directory.parent}
              for run in runs}
    assert all(len(seeds) == 1 for seeds in groups.values()) and len(set.union(*groups.values())) == 4


def test_drawn_stones_take_what_their_own_table_does_not_say(tmp_path):
    drawn = {"size_m": 0.04, "speed_m_s": 2.0}
    changes = {"stones.drawn": drawn, "stones.count": 6, **{f"stones.{key}": None for key in (
        "radius_m", "speed_m_s", "positions_m", "gangue_order")}}
    scene = changed("paper", changes | {"scatter.youngs_modulus_factor": {"lognormal_cv": 0.2}})
    assert len({stone.substance for stone in stones_of(scene, "scene")}) == 6
    with pytest.raises(InputError, match="scatter.radius_factor = .*must be left out where stones.drawn is given"):
        changed("paper", changes | {"scatter.radius_factor": {"lognormal_cv": 0.2}})


@pytest.mark.parametrize("key, value, said", [
    ("radius_factor", {"lognormal_cv": 0.9}, "scatter.radius_factor.lognormal_cv = 0.9"),
    ("radius_factor", {"lognormal_cv": 1e-200}, "scatter.radius_factor.lognormal_cv = 1e-200"),
    ("radius_factor", [-1.0, 1.0], "scatter.radius_factor = .*must be from 0.05 to 20"),
    ("restitution", [0.5, 1.1], "scatter.restitution = .*must be from 0.051 to 1"),
    ("density", 2.0, "scatter.density = 2.0: unknown key"),
    ("place_m", 0.0, "scatter.place_m = 0.0"),
    ("arrival_s", {"normal": 1.0}, "scatter.arrival_s.normal"),
])
def test_a_wrong_scatter_is_refused_in_one_line(key, value, said):
    with pytest.raises(InputError, match=said) as refused:
        changed("natural", {f"scatter.{key}": value})
    assert "\n" not in str(refused.value)


def test_stones_that_find_no_place_are_refused():
    with pytest.raises(InputError, match="scatter.place_m = 0.001: stone . finds no place"):
        stones_of(changed("natural", {"scatter.place_m": 1e-3, "scatter.radius_factor": 1.5, "scatter.arrival_s": 0.0}), "s")


def test_more_moduli_than_the_engine_takes_are_refused():
    each = [{"material": "coal", "radius_m": 1e-4, "place_m": [4e-4 * k - 0.2, 0.0], "velocity_m_s": 1.0} for k in range(501)]
    volley = ("count", "radius_m", "speed_m_s", "positions_m", "gangue_order", "gangue_ratio")
    scene = changed("paper", {f"stones.{key}": None for key in volley} | {
        "stones.each": each, "scatter.youngs_modulus_factor": {"lognormal_cv": 0.1}})
    with pytest.raises(InputError, match="scatter: 501 stones .*must be at most 500"):
        stones_of(scene, "scene")
