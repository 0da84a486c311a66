"""run.json by its schema: whole where this version wrote it, tolerant of what is absent, strict about what is there."""

import json

import pytest
from scenes_of_tests import changed

from common.run_summary import RunSummary, read_summary, summary_from
from common.tables import InputError
from dem.run.run import run_scene

LEAST = {"status": "finished", "gangue_ratio": 0.5, "materials": ["coal", "gangue"]}


def test_a_run_writes_every_key_and_reads_the_same(tmp_path):
    written = run_scene(changed("hertz_coal", {}), "hertz_coal.toml", tmp_path / "run")
    file = tmp_path / "run" / "run.json"
    assert written == json.loads(file.read_text())
    keys = {field.alias or name for name, field in RunSummary.model_fields.items()}
    of_others = {"wall_impulse_N_s", "rod_impulse_N_s", "plate_momentum_kg_m_s", "rods_momentum_kg_m_s",
                 "damping_impulse_N_s", "momentum_missing"}  # of side walls, of plates on rods
    assert set(written) == keys - of_others
    summary = read_summary(file)
    assert summary.as_json() == written
    assert summary.yield_.contact_law == "Hertz" and summary.yield_.bending is None
    assert summary.scene.stones.radius_m == 0.025 and summary.scene.plate.thickness_m is None


def test_absent_keys_are_none_and_unknown_ones_are_kept():
    summary = summary_from(LEAST | {"by_somebody_else": 1, "scene": {"time": {"idle_tolerance": 1e-4}}}, "run.json")
    assert summary.n_modes is None and summary.wall_time_s == {} and summary.scene.stones.count is None
    assert summary.as_json()["by_somebody_else"] == 1
    assert summary.as_json()["scene"] == {"time": {"idle_tolerance": 1e-4}}


@pytest.mark.parametrize("change, words", [
    ({"gangue_ratio": 1.5}, "gangue_ratio = 1.5"), ({"gangue_ratio": "1"}, "gangue_ratio = '1'"),
    ({"materials": "coal"}, "materials = 'coal'"), ({"n_modes": 3.5}, "n_modes = 3.5"),
    ({"scene": []}, "scene = []"), ({"scene": {"stones": {"count": "3"}}}, "scene.stones.count = '3'"),
    ({"scene": {"plate": {"rods": [{"length_m": 0.1}]}}}, "scene.plate.rods.0.place_m is missing")])
def test_a_wrong_value_is_refused_by_name(change, words):
    with pytest.raises(InputError) as error:
        summary_from(LEAST | change, "somewhere/run.json")
    assert str(error.value).startswith("somewhere/run.json: ") and words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("key", LEAST)
def test_what_a_run_must_say_is_asked_for(key):
    with pytest.raises(InputError, match=f"{key} is missing"):
        summary_from({name: value for name, value in LEAST.items() if name != key}, "run.json")
