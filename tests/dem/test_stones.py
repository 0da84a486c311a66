"""The list of what falls: each stone touches when and as fast as it was asked to."""

import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import SCENES, one_by_one

from common.scene.scene import changed_scene
from common.tables import InputError
from dem.run.run import run_scene
from dem.stones.arrangement import PACKINGS, stones_of
from dem.stones.stone import UPRIGHT, Stone, entry_of, path_before, substances_of

GRAVITY = (0.0, 0.0, -9.8)
ELASTIC = {"coal_plate": {"restitution": 1.0, "friction": 0.0}, "gangue_plate": {"restitution": 1.0, "friction": 0.0},
           "coal_coal": {"restitution": 1.0, "friction": 0.0}, "coal_gangue": {"restitution": 1.0, "friction": 0.0},
           "gangue_gangue": {"restitution": 1.0, "friction": 0.0}}


def stone(**changes):
    coal = substances_of(changed_scene(SCENES / "small.toml", {}))["coal"]
    values = {"substance": coal, "radius_m": 0.02, "place_m": (0.0, 0.0), "velocity_m_s": (0.3, 0.0, -3.0), "seed": 1,
              "gap_m": 2e-5}
    return Stone(**values | changes)


@pytest.mark.parametrize("gravity", [GRAVITY, (3.0, 0.0, -9.0), (0.0, 0.0, 0.0)])
@pytest.mark.parametrize("arrival_s", [0.01, 0.2, 5.0])
def test_a_path_traced_back_leads_to_the_touch(gravity, arrival_s):
    one = stone(arrival_s=arrival_s)
    entry = entry_of(one, gravity)
    flown, g, v = arrival_s - entry.entry_s, np.array(gravity), np.array(entry.velocity_m_s)
    assert np.allclose(entry.offset_m + v * flown + g * flown**2 / 2, 0, atol=1e-12)
    assert np.allclose(v + g * flown, one.velocity_m_s, atol=1e-12)
    assert entry.entry_s >= 0 and v[2] <= 1e-12 and entry.offset_m[2] > 0  # never on its way up


def test_a_stone_that_arrives_at_once_starts_above_the_plate_with_its_speed():
    entry = entry_of(stone(), GRAVITY)
    assert (entry.entry_s, entry.offset_m, entry.velocity_m_s) == (0.0, (0.0, 0.0, 2e-5), (0.3, 0.0, -3.0))


def test_half_a_path_is_the_path_of_half_the_time():
    whole, velocity = path_before((1.0, 2.0, -3.0), GRAVITY, 0.2)
    half, _ = path_before((1.0, 2.0, -3.0), GRAVITY, 0.1)
    back, _ = path_before(path_before((1.0, 2.0, -3.0), GRAVITY, 0.1)[1], GRAVITY, 0.1)
    assert np.allclose(whole, np.add(half, back)) and velocity[2] == pytest.approx(-3.0 + 0.98 * 2)


def test_equal_stones_hit_equally_hard_whenever_they_arrive(tmp_path):
    """Against Hertz's closed form for each, and the times that were asked for."""
    arrivals = [0.0, 0.002, 0.005]
    scene = one_by_one(changed_scene(SCENES / "hertz_coal.toml", {
        "stones.count": 3, "time.duration_s": 6e-3, "time.gravity_m_s2": 9.8,
        "stones.positions_m": [[0.1 * k, 0.0] for k in range(3)], "contacts": ELASTIC}), arrival_s=arrivals)
    summary = run_scene(scene, "scene", tmp_path / "run")
    fast = pd.read_parquet(tmp_path / "run" / "fast.parquet")
    for k, arrival_s in enumerate(arrivals):
        force = fast[f"force_{k + 1:02d}_N"].to_numpy()
        first_s = fast["t_s"].to_numpy()[np.flatnonzero(force > 0)[0]]
        assert first_s == pytest.approx(max(arrival_s, 2e-5 / 3), abs=1.1e-5)  # two rows of the fast stream
        assert force.max() == pytest.approx(4261.6, rel=1e-3)  # docs/validation.md
    assert abs(summary["energy"]["closure"]) < 1e-3


def test_what_cannot_arrive_is_refused():
    small = changed_scene(SCENES / "small.toml", {})
    inside = one_by_one(small, arrival_s=[0.0, 0.01], place_m=[(0.0, 0.0), (0.0, 0.0)])
    with pytest.raises(InputError, match="stones 1 and 2 overlap"):
        stones_of(inside, "scene")
    above = one_by_one(small, arrival_s=[0.0, 0.03], place_m=[(0.0, 0.0), (0.0, 0.0)])
    assert [one.arrival_s for one in stones_of(above, "scene")] == [0.0, 0.03]


def test_stones_may_touch_whatever_the_places_round_to():
    small = changed_scene(SCENES / "small.toml", {})
    assert 0.15 - 0.1 < 0.05 == 2 * small.stones.radius_m
    assert len(stones_of(one_by_one(small, place_m=[(0.1, 0.0), (0.15, 0.0)]), "scene")) == 2
    with pytest.raises(InputError, match="stones 1 and 2 overlap"):
        stones_of(one_by_one(small, place_m=[(0.1, 0.0), (0.1499, 0.0)]), "scene")


def test_many_stones_of_a_volley_share_packings_and_are_turned():
    """Up to ten have their own, upright; what a stone is does not hang on the mixing ratio."""
    def volley(count, **changes):
        places = [[0.055 * (k % 5) - 0.11, 0.055 * (k // 5) - 0.11] for k in range(count)]
        return stones_of(changed_scene(SCENES / "paper.toml", {
            "stones.count": count, "stones.positions_m": places,
            "stones.gangue_ratio": 0.0, **changes}), "scene")
    few, many = volley(10), volley(20)
    assert [one.seed - few[0].seed for one in few] == list(range(10)) and {one.attitude for one in few} == {UPRIGHT}
    assert 1 < len({one.seed for one in many}) <= PACKINGS and len({one.attitude for one in many}) == 20
    assert np.allclose(np.linalg.norm([one.attitude for one in many], axis=1), 1)
    gangue = volley(20, **{"stones.gangue_ratio": 0.5})
    assert [(one.seed, one.attitude) for one in gangue] == [(one.seed, one.attitude) for one in many]
    assert {one.attitude for one in volley(20, **{"stones.agglomerate": None})} == {UPRIGHT}
