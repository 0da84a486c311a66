"""Virtual tests against the static solution, the law of proportional loads, and what the fitted materials claim."""

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_tests import SCENES

from common.scene import BondTable, read_scene
from common.tables import InputError, check, read_toml
from dem.__main__ import main
from dem.calibration.calibrate import CHECK_SEEDS, TARGETS, calibrate, fit_tensile_strength, read_target
from dem.calibration.virtual_tests import (
    Rock,
    brazilian_specimen,
    compression_specimen,
    elastic_test,
    strength_test,
)
from dem.stones.bonds import network_stiffness
from dem.stones.strength import strength_scale

ROCK = Rock(density_kg_m3=1400.0, contact_modulus_Pa=5e9, contact_poisson_ratio=0.3, restitution=0.5, friction=0.6,
            bond_modulus_Pa=6e9, stiffness_ratio=3.0, tensile_strength_Pa=3e6, shear_strength_Pa=6e6,
            tan_friction=0.5, damping_ratio=0.05)


@pytest.mark.parametrize("volumetric_ratio", [0.0, 0.3])
def test_slow_compression_gives_the_elastic_constants_at_rest(tmp_path, volumetric_ratio):
    specimen = compression_specimen(0.025, 300, seed=11)
    modulus, nu = elastic_test(tmp_path, specimen, replace(ROCK, volumetric_ratio=volumetric_ratio))
    at_rest = network_stiffness(specimen.packing, specimen.bonds, ROCK.bond_modulus_Pa, ROCK.stiffness_ratio,
                                volumetric_ratio)
    assert modulus == pytest.approx(at_rest.youngs_modulus_Pa[0], rel=2e-3)
    assert nu == pytest.approx(at_rest.poisson_ratio[0], abs=2e-3)


@pytest.mark.parametrize("specimen", [compression_specimen(0.025, 300, 11), brazilian_specimen(0.025, 250, 11)],
                         ids=["compression", "Brazilian"])
def test_load_at_failure_goes_with_the_strength_of_the_bonds(tmp_path, specimen):
    """Bonds are elastic until they break, so with twice the strength, strained twice as fast, all loads double.

    Strains are kept so small that no geometry changes: at real ones, paths of cracks part and one specimen differs
    by 10 %.
    """
    records = [strength_test(tmp_path / f"{factor}", specimen,
                             replace(ROCK, tensile_strength_Pa=factor * 3e3, shear_strength_Pa=factor * 6e3),
                             factor * 1e-6) for factor in (1, 2)]
    assert records[1].strength_Pa == pytest.approx(2 * records[0].strength_Pa, rel=1e-3)


def test_failure_does_not_depend_on_the_speed_of_the_platens(tmp_path):
    specimen = brazilian_specimen(0.025, 250, 11)
    fast, slow = (strength_test(tmp_path / f"{k}", specimen, ROCK, strain).strength_Pa
                  for k, strain in enumerate((1e-3, 4e-4)))
    assert fast == pytest.approx(slow, rel=0.05)


def test_a_specimen_that_holds_is_refused(tmp_path):
    strong = replace(ROCK, tensile_strength_Pa=1e12, shear_strength_Pa=1e12)
    with pytest.raises(RuntimeError, match="did not fail within 10 times"):
        strength_test(tmp_path, compression_specimen(0.01, 30, 11), strong, 1e-5)


class FakeLaboratory:
    """Stands for the virtual tests: strength is `law` of that of the bonds."""

    def __init__(self, law):
        self.law = law

    def strengths(self, stage, kind, rock, seeds):
        return self.law(rock.tensile_strength_Pa) * np.linspace(0.9, 1.1, len(seeds))


def test_tensile_strength_is_fitted_and_the_ratio_of_strengths_kept():
    target = read_target("coal")
    rock = fit_tensile_strength(ROCK, target, FakeLaboratory(lambda s: 0.4 * s), range(5))
    assert rock.tensile_strength_Pa == pytest.approx(target.tensile_strength_Pa / 0.4, rel=0.01)
    assert rock.shear_strength_Pa == pytest.approx(2 * rock.tensile_strength_Pa)
    with pytest.raises(RuntimeError, match="the tensile strength reached"):
        fit_tensile_strength(ROCK, target, FakeLaboratory(lambda s: 5e5), range(5))


@pytest.mark.parametrize("material, scene, words", [
    ("stone", "paper.toml", ["MATERIAL = 'stone'", "coal", "gangue", "paper.toml"]),
    ("coal", "hertz_coal.toml", ["hertz_coal.toml", "stones.agglomerate"])])
def test_bad_input_is_one_line_and_leaves_nothing(tmp_path, capsys, material, scene, words):
    out = tmp_path / "out"
    assert main(["calibrate", material, "--scene", str(SCENES / scene), "--out", str(out)]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and all(word in line for word in words)
    assert not out.exists()


def test_a_material_without_targets_is_named(tmp_path):
    file = tmp_path / "targets.toml"
    file.write_text("[coal]\ntensile_strength_Pa = 1e6\n")
    with pytest.raises(InputError, match="gangue is missing"):
        read_target("gangue", file)
    with pytest.raises(InputError, match="coal.compressive_strength_Pa is missing"):
        read_target("coal", file)


@pytest.mark.parametrize("material", ["coal", "gangue"])
def test_fitted_materials_meet_modulus_and_tensile_strength(material):
    file = SCENES / "materials" / f"{material}.toml"
    table = read_toml(file)
    check(BondTable, table["bond"], file, where="bond")
    scene, target = read_scene(SCENES / "paper.toml"), read_target(material, TARGETS)
    reached = table["reached"]
    assert reached["youngs_modulus_Pa"]["target"] == scene.materials[material].youngs_modulus_Pa
    assert reached["tensile_strength_Pa"]["target"] == target.tensile_strength_Pa
    assert abs(reached["youngs_modulus_Pa"]["mean"] / reached["youngs_modulus_Pa"]["target"] - 1) < 0.03
    assert abs(reached["tensile_strength_Pa"]["mean"] / reached["tensile_strength_Pa"]["target"] - 1) < 0.05


@pytest.mark.validate
@pytest.mark.parametrize("material", ["coal", "gangue"])
def test_calibration_again_meets_the_targets_and_the_kept_values(tmp_path, material):
    """E within 3 % and tensile strength within 5 % of the target, on packings without part in the fit.

    Two calibrations have differed by 3 % in the tensile strength of coal; why was not traced. They are asked to differ by
    less than three standard errors of the scatter of their packings.
    """
    calibrate(material, SCENES / "paper.toml", tmp_path, report=lambda line: None)
    again, kept = (read_toml(folder / f"{material}.toml") for folder in (tmp_path, SCENES / "materials"))
    for name, tolerance in (("youngs_modulus_Pa", 0.03), ("tensile_strength_Pa", 0.05)):
        now, before = again["reached"][name], kept["reached"][name]
        assert now["mean"] == pytest.approx(now["target"], rel=tolerance)
        standard_error = np.hypot(now["deviation"], before["deviation"]) / np.sqrt(CHECK_SEEDS)
        assert abs(now["mean"] - before["mean"]) < 3 * standard_error


def test_strength_scale():
    radius = np.array([1e-3, 2e-3, 4e-3])
    assert strength_scale(radius, 2e-3, 0.5) == pytest.approx([np.sqrt(2), 1, np.sqrt(0.5)])
    assert strength_scale(1e-3, 3e-3, 0.0) == 1
    # toughness, sigma sqrt(R), is the same for every size
    assert strength_scale(radius, 1e-3, 0.5) * np.sqrt(radius) == pytest.approx(np.sqrt(1e-3) * np.ones(3))
    with pytest.raises(ValueError, match="positive"):
        strength_scale(0.0, 1e-3, 0.5)
