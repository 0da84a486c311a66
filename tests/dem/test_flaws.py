"""The field of flaws in a stone, and the resolution of its fragments (docs/bonds.md)."""

from collections import Counter

import numpy as np
import pytest
from scenes_of_tests import changed
from scipy.spatial import cKDTree
from scipy.stats import weibull_min

from common.tables import InputError
from dem.calibration.virtual_tests import Rock, brazilian_specimen
from dem.deck.plausible import breakage_scales, warnings_of_fragments
from dem.stones.arrangement import stones_of
from dem.stones.assembly import assemble, stone_parts
from dem.stones.stone import flaw_factors
from lab.results import RESULTS, read_result
from lab.rock.impacts import of_rock

MODULUS, LENGTH_m = 5.0, 0.009
FIELD = {"materials.coal.bond.flaw_modulus": MODULUS, "materials.coal.bond.flaw_length_m": LENGTH_m}


def test_the_field_has_a_weibull_law_of_mean_one_and_its_correlation():
    """Over many seeds, at points one length and a third of it apart; the correlation is that of the normal scores."""
    points = np.array([[0, 0, 0], [LENGTH_m, 0, 0], [0, LENGTH_m / 3, 0], [0, 0, 5 * LENGTH_m]])
    values = np.array([flaw_factors(MODULUS, LENGTH_m, seed, points) for seed in range(4000)])
    law = weibull_min(MODULUS)
    assert values.mean(axis=0) == pytest.approx(1, abs=0.012)
    assert values.std(axis=0) == pytest.approx(law.std() / law.mean(), rel=0.04)
    ranks = np.argsort(np.argsort(values, axis=0), axis=0)
    rank = np.corrcoef(ranks.T)[0, 1:]
    of_normal = 2 * np.sin(np.pi / 6 * rank)  # Pearson's correlation that a rank correlation of normal values stands for
    assert of_normal == pytest.approx([np.exp(-1), np.exp(-1 / 9), 0], abs=0.05)
    low = np.quantile(values[:, 0] * law.mean(), [0.05, 0.5, 0.95])
    assert low == pytest.approx(law.ppf([0.05, 0.5, 0.95]), rel=0.03)


def resolution(scene, one):
    return breakage_scales(scene, one)["fragment_size_over_subsphere"]


def over_critical(scene, one):
    return breakage_scales(scene, one)["speed_over_critical"]


def bonds_of(count, **changes):
    """Middle of each bond from the centre of a coal stone, and its strength factor."""
    scene = changed("single", FIELD | {"stones.agglomerate.subspheres": count, **changes})
    one = assemble(scene, stones_of(scene, "single"))
    stone = one.stones[0]
    centre = np.array([*stone.place_m, stone.radius_m + stone.gap_m])  # of a sphere that touches smoothly
    middle = one.center_m[one.bond_first] + one.bond_vector_m / 2 - centre
    return middle, one.bond_strength_factor, one


@pytest.mark.slow
def test_the_field_is_of_place_and_seed_whatever_the_packing():
    """In stones of 200 and 600 sub-spheres bonds near each other have nearly one factor; those of another seed do not."""
    coarse, fine = (bonds_of(count) for count in (200, 600))
    other = bonds_of(600, **{"stones.seed": 5})

    def differ(one, two):
        near, here = cKDTree(one[0]).sparse_distance_matrix(cKDTree(two[0]), 1e-3, output_type="coo_matrix").coords
        assert len(near) > 100
        return np.std(one[1][near] - two[1][here])

    assert differ(coarse, fine) < 0.05 and differ(coarse, other) > 0.2


def test_the_field_turns_with_its_stone_and_grows_with_none_of_its_size():
    """It is fixed in the stone, and its length is one of the rock: a larger stone has more of the same flaws."""
    each = {"material": "coal", "radius_m": 0.025, "place_m": [0.0, 0.0], "velocity_m_s": 3.0}
    volley = ("count", "positions_m", "gangue_order", "gangue_ratio", "radius_m", "speed_m_s")
    no_volley = {f"stones.{key}": None for key in volley} | {"stones.seed": 9}
    _, upright, _ = bonds_of(200, **no_volley, **{"stones.each": [each]})
    _, turned, _ = bonds_of(200, **no_volley, **{"stones.each": [each | {"attitude": [0.6, 0.8, 0.0, 0.0]}]})
    assert np.array_equal(upright, turned)
    middle, large, one = bonds_of(200, **no_volley, **{"stones.each": [each | {"radius_m": 0.05}]})
    assert large == pytest.approx(flaw_factors(MODULUS, LENGTH_m, 9, middle), rel=1e-9)
    assert not np.allclose(large, upright, rtol=0.1)


def test_stones_that_share_a_packing_have_flaws_of_their_own():
    scene = changed("single", FIELD | {
        "stones.agglomerate.subspheres": 200, "stones.count": 12, "stones.gangue_ratio": 0.0,
        "stones.positions_m": [[0.055 * (k % 4) - 0.08, 0.055 * (k // 4) - 0.06] for k in range(12)]})
    stones = stones_of(scene, "single")
    shared, = (seed for seed, _ in Counter(one.seed for one in stones).most_common(1))
    factors = [stone_parts(scene, one).strength_factor for one in stones if one.seed == shared]
    assert len(factors) > 1 and np.abs(np.triu(np.corrcoef(factors), 1)).max() < 0.3


def test_specimens_of_the_virtual_tests_have_flaws_as_stones_have():
    rock = Rock(1380, 5e9, 0.3, 0.5, 0.6, 5e9, 4.0, 1e6, 3e6, 0.5, 0.05, flaw_modulus=MODULUS, flaw_length_m=LENGTH_m)
    specimen = brazilian_specimen(0.02, 200, 3)
    middle = specimen.packing.center_m[specimen.bonds.first] + specimen.bonds.vector_m / 2
    assert np.array_equal(specimen.strength_factors(rock), flaw_factors(MODULUS, LENGTH_m, 3, middle))


@pytest.mark.parametrize("speed, energy, size_mm, warned", [(3.0, 6.0, 24.781, False), (6.0, 1.0, 8.591, True)])
def test_fragments_are_as_large_as_grady_says(speed, energy, size_mm, warned):
    """(24 x 2.1 G/(rho (v/R)^2))^(1/3), worked by hand, over the mean diameter of sub-spheres."""
    scene = changed("single", {"stones.speed_m_s": speed, "materials.coal.bond.fracture_energy_J_m2": energy})
    one = assemble(scene, stones_of(scene, "single"))
    found, = resolution(scene, one)
    assert found == pytest.approx(1e-3 * size_mm / (2 * one.radius_m.mean() / 0.975), rel=2e-3)
    told = warnings_of_fragments(scene, one)
    assert bool(told) == warned and all("what breaks depends on their number" in line for line in told)
    snaps = changed("single", {"materials.coal.bond.fracture_energy_J_m2": None})
    assert resolution(snaps, assemble(snaps, stones_of(snaps, "single"))) == [None]


@pytest.mark.parametrize("rock", ["coal", "gangue", "hard_coal", "soft_coal"])
def test_a_stone_at_its_critical_speed_falls_apart(rock):
    """Within 10 % of the speed at which impacts of the laboratory had it in pieces; nothing of a stone that snaps."""
    _, measured = read_result(RESULTS / "critical_speed.csv")
    found_m_s = float(measured[(measured["rock"] == rock) & (measured["radius_mm"] == "25")]["speed_m_s"].iloc[0])
    scene = changed("single", of_rock(rock) | {"stones.gangue_ratio": float(rock == "gangue"), "stones.speed_m_s": found_m_s})
    assert over_critical(scene, assemble(scene, stones_of(scene, "single"))) == [pytest.approx(1, abs=0.1)]
    snaps = changed("single", {"materials.coal.bond.fracture_energy_J_m2": None})
    assert over_critical(snaps, assemble(snaps, stones_of(snaps, "single"))) == [None]


def test_the_critical_speed_falls_with_size_and_rises_with_the_stones_own_strength():
    """v ~ R^-0.2, energy a mass as d^-0.4; and a stone f times as strong has f^2 of the crack energy: v ~ f^0.7."""
    found = []
    for changes in ({}, {"stones.radius_m": 0.05}, {"scatter.strength_factor": 1.5}):
        scene = changed("single", changes)
        found += over_critical(scene, assemble(scene, stones_of(scene, "single")))
    assert found[1:] == pytest.approx([found[0] * 2**0.2, found[0] / 1.5**0.7], rel=1e-9)


def test_half_a_field_is_refused():
    with pytest.raises(InputError, match="materials.coal.bond.flaw_length_m = None: must be given with flaw_modulus"):
        changed("single", {"materials.coal.bond.flaw_modulus": 5.0})


def test_the_speed_across_the_plate_is_what_breaks():
    def ratio(tilt_deg):
        scene = changed("single", {"plate.tilt_deg": tilt_deg, "stones.agglomerate.subspheres": 200})
        return over_critical(scene, assemble(scene, stones_of(scene, "single")))[0]

    assert ratio(60.0) == pytest.approx(ratio(0.0) / 2)
