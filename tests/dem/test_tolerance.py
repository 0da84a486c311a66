"""The tolerance of a scene: the laws it goes by, the settings it picks, what it refuses, and whether it is kept."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scenes_of_tests import changed, hertz

from common.scene.error_laws import Law, expected_error, law, least_tolerance
from common.tables import InputError
from dem.deck.time_step import accuracy_settings, step_limits, time_step
from dem.run.prepare import with_cut_off
from dem.run.run import run_scene
from dem.stones.arrangement import stones_of
from dem.stones.assembly import assemble

POWER = Law(np.array([0.1, 0.2, 0.8]), 3 * np.array([0.1, 0.2, 0.8]) ** 2)


@given(st.floats(0.1, 5.0))
def test_between_and_above_its_settings_a_law_is_a_power(setting):
    assert POWER.error(setting) == pytest.approx(3 * setting**2, rel=1e-9)


def test_below_its_finest_setting_a_law_promises_no_more_than_was_measured():
    assert POWER.error(0.01) == pytest.approx(0.03, rel=1e-12)


@given(st.floats(0.0301, 1.5))
def test_the_setting_of_an_error_has_that_error_or_less(error):
    assert POWER.error(POWER.setting(error)) <= error * (1 + 1e-12) and POWER.setting(error) in POWER.settings


@pytest.mark.parametrize("knob", ["time_step", "contact", "co_step", "co_step_spheres", "modes", "modes_spheres"])
def test_the_committed_laws_ascend(knob):
    assert np.all(np.diff(law(knob).settings) > 0) and np.all(np.diff(law(knob).errors) > 0)


WITHOUT_MODES = {"plate.max_frequency_Hz": None, "stones.agglomerate.subspheres": 30,
                 "stones.agglomerate.contact": "sub_spheres"}


def settings_of(tolerance):
    """What a tolerance picks for one bonded stone, and the error expected of it."""
    scene = changed("single", WITHOUT_MODES | {"tolerance": tolerance})
    assembly = assemble(scene, stones_of(scene, "scene"))
    step = time_step(scene, step_limits(scene, assembly, "scene"), "scene", 0.1)
    resolved = with_cut_off(scene, list(assembly.stones))
    return step, resolved.plate, expected_error(accuracy_settings(resolved, assembly, step))


def test_a_smaller_tolerance_picks_finer_settings_that_are_expected_to_keep_it():
    coarse, fine = 0.1, 1.01 * least_tolerance(bonded=True)
    (step_1, plate_1, error_1), (step_2, plate_2, error_2) = settings_of(coarse), settings_of(fine)
    assert plate_2.max_frequency_Hz > plate_1.max_frequency_Hz
    assert step_2.dt_s <= step_1.dt_s and step_2.co_step * step_2.dt_s <= step_1.co_step * step_1.dt_s
    assert error_2["total"] < error_1["total"] <= coarse and error_2["total"] <= fine
    assert error_1["total"] == pytest.approx(sum(v for k, v in error_1.items() if k != "total"))


@pytest.mark.parametrize("changes, key", [
    ({"tolerance": 0.02}, "plate.max_frequency_Hz = 20000.0"),
    ({"tolerance": 0.02, "plate.max_frequency_Hz": None, "time.co_step": 1}, "time.co_step = 1"),
    ({"tolerance": 1e-5, "plate.max_frequency_Hz": None}, "tolerance = 1e-05: must be at least"),
])
def test_two_words_on_one_thing_are_refused(changes, key):
    with pytest.raises(InputError, match=key):
        changed("single", changes)


@pytest.mark.parametrize("ratio", [0.0, 1.0])
def test_a_scene_that_says_nothing_has_one_plate_at_every_ratio_and_is_told_its_error(ratio, runs):
    """2.3 oscillations of the highest mode in the shortest contact that any material may have, gangue's."""
    scene = changed("elastic_plate", {"plate.max_frequency_Hz": None, "stones.gangue_ratio": ratio, "time.duration_s": 3e-4})
    run = run_scene(scene, "elastic_plate.toml", runs / f"cut_off_{ratio:g}")
    given, contact_s = run["scene"]["plate"]["max_frequency_Hz"], 2.943275 * hertz("gangue")["depth_m"] / 3.0
    assert given * contact_s == pytest.approx(2.3, rel=1e-3)
    assert run["expected_error"]["modes_spheres"] <= 0.01 and 0 < run["plate_energy_left_out"] < 2e-3


@pytest.mark.validate
@pytest.mark.parametrize("stone", ["stone", "sphere"])
def test_a_tolerance_is_kept_on_a_scene_that_had_no_part_in_the_laws(tmp_path, stone):
    from lab.accuracy.tolerance import achieved

    for row in achieved(stone, (0.1, 0.04), tmp_path):
        assert row["achieved"] <= row["expected"] <= row["tolerance"], row
