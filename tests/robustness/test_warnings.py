"""Physics beyond the laws is warned of, from the limits of the pages on."""

import tomllib

import numpy as np
import pytest

from common.scene.scene import changed_scene
from dem.deck.plausible import momentum_warnings, unfinished_warnings, warnings_of
from dem.stones.arrangement import stones_of
from plate_fem.impact import warnings_of_plate
from tests.robustness.small import SCENES, run


@pytest.mark.parametrize("changes, words", [
    ({"stones.speed_m_s": 1000.0}, ["strains coal", "small strains", "Hertz"]),
    ({"materials.coal.youngs_modulus_Pa": 5e12}, ["materials.coal.youngs_modulus_Pa = 5e+12", "diamond"]),
    ({"materials.coal.bond.youngs_modulus_Pa": 5e12}, ["materials.coal.bond.youngs_modulus_Pa", "diamond"]),
    ({"plate.youngs_modulus_Pa": 5e12}, ["plate.youngs_modulus_Pa", "diamond"]),
    ({"plate.rods": [{"place_m": [0.1, 0.0], "diameter_m": 0.02, "length_m": 0.1, "youngs_modulus_Pa": 5e12,
                      "density_kg_m3": 7830.0}]}, ["plate.rods.0.youngs_modulus_Pa", "diamond"]),
    ({"materials.coal.bond.tensile_strength_Pa": 200.0}, ["own weight"]),
    ({"materials.coal.density_kg_m3": 1.38}, ["materials.coal.density_kg_m3 = 1.38", "cork"]),  # g/cm^3
    ({"stones.gap_m": 0.5}, ["time.duration_s = 0.006", "before stone 1 touches"]),
    ({"plate.density_kg_m3": 7.83}, ["plate.density_kg_m3 = 7.83", "cork"]),
    ({"contacts.coal_plate.friction": 5.0}, ["contacts.coal_plate.friction = 5", "rubber"]),
    ({"stones.radius_m": 0.26}, ["radius of 0.26 m", "shorter side is 0.5 m"]),
    ({"time.gravity_m_s2": 9810.0}, ["time.gravity_m_s2 = 9810", "Jupiter"]),  # mm/s^2
    ({"materials.coal.bond.tensile_strength_Pa": 5e12}, ["tensile_strength_Pa = 5e+12", "without flaws"]),
    ({"materials.shale": "gangue"}, ["materials.shale", "stones.each"]),
])
def test_physics_beyond_the_laws_is_warned_of(changes, words):
    scene = changed_scene(SCENES / "single.toml", changes)
    said = "\n".join(warnings_of(scene, stones_of(scene, "scene")))
    assert all(word in said for word in words), said


COAL_Pa, COAL_kg_m3, PLATE_Pa, RADIUS_m, NU2 = 5.12e9, 1380.0, 2.07e11, 0.025, 0.09  # of single.toml
CONTACT_Pa = 1 / ((1 - NU2) / COAL_Pa + (1 - NU2) / PLATE_Pa)
STONE_kg = COAL_kg_m3 * 4 / 3 * np.pi * RADIUS_m**3


@pytest.mark.parametrize("key, limit, words, bonded", [
    ("materials.coal.youngs_modulus_Pa", 1.22e12, "diamond", True),
    # A fiftieth of the speed of a wave along a bar, sqrt(E / rho).
    ("stones.speed_m_s", 0.02 * np.sqrt(COAL_Pa / COAL_kg_m3), "small strains", True),
    # Hertz: (15 m v^2 / (16 E* R^(1/2)))^(2/5) = R / 10 (Johnson, Contact Mechanics, eq. 11.23).
    ("stones.speed_m_s", np.sqrt(16 * CONTACT_Pa * RADIUS_m**3 * 0.1**2.5 / (15 * STONE_kg)), "Hertz", False),
    # The pressure below a column as high as the stone.
    ("materials.coal.bond.tensile_strength_Pa", COAL_kg_m3 * 9.81 * 2 * RADIUS_m, "own weight", True),
])
def test_warnings_begin_where_docs_safety_says(key, limit, words, bonded):
    changes = {} if bonded else {"stones.agglomerate": None}
    below, above = (changed_scene(SCENES / "single.toml", changes | {key: float(factor * limit)})
                    for factor in (0.999, 1.001))
    warned = [any(words in line for line in warnings_of(scene, stones_of(scene, "scene"))) for scene in (below, above)]
    assert warned == ([True, False] if words == "own weight" else [False, True])


THICK = {"size_m": [0.2, 0.2], "thickness_m": 0.03}


@pytest.mark.parametrize("changes, left_out, words", [
    (THICK, 0.0, ["plate.thickness_m = 0.03", "6.67 of it"]),
    ({"size_m": [0.75, 0.1], "thickness_m": 0.01, "rods": ()}, 0.0, ["within the plane"]),
    ({"theory": "kirchhoff"}, 0.0, ["plate.theory = 'kirchhoff'", "without shear"]),
    ({}, 0.06, ["plate.max_frequency_Hz = 2e+04", "0.06"]),
    ({"mesh_size_m": 0.1}, 0.0, ["plate.mesh_size_m = 0.1: above 0.0", "modes up to 2e+04 Hz"]),
    ({"size_m": [0.43, 0.5]}, 0.0, ["plate.rods.0: stands 0.015 m from an edge"]),
    ({"youngs_modulus_Pa": 1e10}, 0.0, ["plate.rods.3.youngs_modulus_Pa = 2.07e+11", "nearest"]),
    ({"thickness_m": 2e-3}, 0.0, ["plate.rods.0.diameter_m = 0.02", "nearest"]),
])
def test_a_plate_beyond_its_theory_is_warned_of(changes, left_out, words):
    """And that of the paper is not."""
    plate = changed_scene(SCENES / "paper.toml", {}).plate
    assert warnings_of_plate(plate, 0.04) == [] == momentum_warnings(0.009) == momentum_warnings(None)
    said = "\n".join(warnings_of_plate(plate.model_copy(update=changes), left_out))
    assert all(word in said for word in words), said
    assert "0.02" in momentum_warnings(0.02)[0]


@pytest.mark.parametrize("scene", sorted(file.stem for file in SCENES.glob("*.toml")
                                         if "stones" in tomllib.loads(file.read_text())))
def test_no_shipped_scene_is_warned_of(scene):
    whole = changed_scene(SCENES / f"{scene}.toml", {})
    assert warnings_of(whole, stones_of(whole, scene)) == []


def test_a_warning_is_on_screen_and_in_run_json(tmp_path):
    """One of the scene, and one of the run: a thin plate deflects far."""
    import json

    thin = ("stones.speed_m_s=300.0", "plate.thickness_m=0.002", "plate.max_frequency_Hz=500.0", "plate.rods=[]",
            "time.duration_s=3e-4")
    changes = [word for change in thin for word in ("--set", change)]
    code, _, errors = run("dem", "run", SCENES / "elastic_plate.toml", *changes, "--out", tmp_path / "run")
    warned = json.loads((tmp_path / "run" / "run.json").read_text())["warnings"]
    assert code == 0 and all(f"elastic_plate.toml: {line}" in errors for line in warned)
    assert "Hertz" in warned[0] and "deflects by" in warned[-1]


def test_a_stone_that_the_plate_pushes_at_the_end_is_told_of_but_none_that_lies():
    scene = changed_scene(SCENES / "hertz_coal.toml", {"time.gravity_m_s2": 9.8})
    warned = unfinished_warnings(scene, np.array([0.0, 900.0, 1.0]), np.array([3e3, 4e3, 1.1]), np.full(3, 0.1))
    assert len(warned) == 1 and "ends while stone 2 hits the plate, one of 1 such" in warned[0]


def test_a_crushing_strength_that_nothing_takes_is_told_of():
    told = [any("contact_strength_Pa" in line for line in warnings_of(scene, stones_of(scene, "scene"))) for scene in (
        changed_scene(SCENES / "single.toml", {"materials.coal.contact_strength_Pa": 1e8} | changes)
        for changes in ({}, {"stones.agglomerate": None}, {"stones.agglomerate.contact": "sub_spheres"}))]
    assert told == [False, True, True]
