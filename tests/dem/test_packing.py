"""Packings against brute force, geometry and the literature's random close packing."""

import numpy as np
import pytest
from packings import BoxContainer, pack_box, plate_depth_m, solid_fraction

from dem.stones.packing import (
    OVERLAP_TOLERANCE,
    ConvexContainer,
    CylinderContainer,
    SphereContainer,
    _Swelling,
    near_pairs,
    pack,
    pack_sphere,
)
from lab.rock.fcc import fcc_sphere

RADIUS = 0.025
OBLIQUE = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
TETRAHEDRON = ConvexContainer(tuple((*normal, 2.0) for normal in OBLIQUE.tolist()), (6.0, 6.0, 6.0), 64 * np.sqrt(3))


@pytest.fixture(scope="module")
def stone():
    return pack_sphere(RADIUS, 500, seed=20011)


def directions(count):
    d = np.random.default_rng(3).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1)[:, None]


def all_distances(packing):
    """Distance over the sum of radii of every pair, without any tree."""
    i, j = np.triu_indices(len(packing.radius_m), 1)
    distance = np.linalg.norm(packing.center_m[i] - packing.center_m[j], axis=1)
    return i, j, distance / (packing.radius_m[i] + packing.radius_m[j])


def test_same_seed_same_packing_and_another_seed_another(stone):
    again, other = pack_sphere(RADIUS, 500, seed=20011), pack_sphere(RADIUS, 500, seed=20012)
    assert np.array_equal(stone.center_m, again.center_m) and np.array_equal(stone.radius_m, again.radius_m)
    assert np.abs(stone.center_m - other.center_m).max() > 1e-3


def test_size_only_scales_the_packing(stone):
    small = pack_sphere(RADIUS / 10, 500, seed=20011)
    assert np.allclose(10 * small.center_m, stone.center_m, rtol=0, atol=1e-12)


@pytest.mark.parametrize("count", [2, 3, 7, 60, 500])
@pytest.mark.parametrize("seed", [1, 2])
def test_no_overlap_beyond_the_tolerance(count, seed):
    packing = pack_sphere(RADIUS, count, seed)
    assert all_distances(packing)[2].min() >= 1 - OVERLAP_TOLERANCE * (1 + 1e-9)
    sticks_out = np.linalg.norm(packing.center_m, axis=1) + packing.radius_m - RADIUS
    assert (sticks_out <= OVERLAP_TOLERANCE * packing.radius_m * (1 + 1e-9)).all()
    assert packing.radius_m.max() / packing.radius_m.min() == pytest.approx(1.5)


def test_one_subsphere_fills_the_container():
    packing = pack_sphere(RADIUS, 1, seed=1)
    assert solid_fraction(packing) == pytest.approx(1)
    assert np.array_equal(packing.center_m, np.zeros((1, 3)))


def test_near_pairs_are_those_of_brute_force(stone):
    i, j, ratio = all_distances(stone)
    for tolerance in (0.0, 0.1, 0.3):
        near = ratio <= 1 + tolerance
        assert np.array_equal(near_pairs(stone.center_m, stone.radius_m, tolerance), np.column_stack([i, j])[near])


@pytest.mark.slow
def test_far_from_the_wall_it_is_random_close_packing():
    """Random close packing has 0.64 for equal spheres and up to 0.01 more for this spread of sizes; sub-spheres of
    a jammed frictionless packing have six contacts, less what the few rattlers lack (O'Hern et al. 2003)."""
    packing = pack_box((0.05, 0.05, 0.05), 3000, seed=5)
    edge = 0.05 - 8 * packing.radius_m.mean()  # without the layers that the wall orders
    points = np.random.default_rng(1).uniform(-edge / 2, edge / 2, (20000, 3))
    solid = np.zeros(len(points), dtype=bool)
    for c, r in zip(packing.center_m, packing.radius_m):
        solid |= ((points - c) ** 2).sum(1) < r**2
    assert solid.mean() == pytest.approx(0.645, abs=0.02)
    pairs = near_pairs(packing.center_m, packing.radius_m, 5e-3)
    contacts = np.bincount(pairs.ravel(), minlength=3000)
    inner = (np.abs(packing.center_m) < edge / 2).all(1)
    assert 5.5 < contacts[inner].mean() < 6.7


def test_stone_is_dense_and_smooth(stone):
    assert 0.57 < solid_fraction(stone) < 0.64
    lowest = (stone.center_m[:, 2] - stone.radius_m).min()
    highest = (stone.center_m[:, 2] + stone.radius_m).max()
    assert lowest == pytest.approx(-RADIUS, rel=1e-4)
    assert highest == pytest.approx(RADIUS, rel=1e-3)
    at_surface = stone.wall_gap_m < 0.5 * stone.radius_m
    touching = stone.wall_gap_m < 5e-3 * stone.radius_m
    assert touching.sum() > 0.9 * at_surface.sum()
    # A plate meets the stone at nearly the same height from any side; touching fcc is six times rougher.
    face = plate_depth_m(stone, directions(500)) / RADIUS
    assert face.mean() < 0.006 < 4 * 0.006 < (plate_depth_m(fcc_sphere(RADIUS), directions(500)) / RADIUS).mean()


@pytest.mark.parametrize("packing", [
    pack(CylinderContainer(0.025, 0.1), 300, seed=4), pack_box((0.03, 0.04, 0.05), 300, seed=4)], ids=["cylinder", "box"])
def test_cylinder_and_box_hold_their_subspheres(packing):
    x, r = packing.center_m, packing.radius_m
    out = OVERLAP_TOLERANCE * r * (1 + 1e-9)
    if isinstance(packing.container, CylinderContainer):
        assert (np.hypot(x[:, 0], x[:, 1]) + r <= 0.025 + out).all() and (np.abs(x[:, 2]) + r <= 0.05 + out).all()
        volume = np.pi * 0.025**2 * 0.1
    else:
        assert (np.abs(x) + r[:, None] <= np.array([0.03, 0.04, 0.05]) / 2 + out[:, None]).all()
        volume = 0.03 * 0.04 * 0.05
    assert solid_fraction(packing) == pytest.approx(4 / 3 * np.pi * (r**3).sum() / volume)
    assert solid_fraction(packing) > 0.54
    ends = packing.center_m[:, 2] + np.outer([-1, 1], r)
    assert ends.min() == pytest.approx(-packing.container.half_size_m[2], rel=1e-3)
    assert ends.max() == pytest.approx(packing.container.half_size_m[2], rel=1e-3)


def test_a_single_layer_touches_both_faces():
    """A disc too thin for two layers: every sub-sphere lies between both faces, none sticks out."""
    packing = pack(CylinderContainer(0.5, 0.3), 8, seed=1)
    z, r = packing.center_m[:, 2], packing.radius_m
    assert r.max() == pytest.approx(0.15, rel=2e-3)  # the largest is as thick as the disc
    assert (np.abs(z) + r - 0.15 <= OVERLAP_TOLERANCE * r * (1 + 1e-9)).all()
    assert all_distances(packing)[2].min() >= 1 - OVERLAP_TOLERANCE * (1 + 1e-9)


@pytest.mark.parametrize("container", [
    SphereContainer(3.0), CylinderContainer(2.0, 5.0), BoxContainer((4.0, 4.5, 5.0)), TETRAHEDRON],
    ids=["sphere", "cylinder", "box", "tetrahedron"])
def test_forces_are_the_gradient_of_the_enthalpy(container):
    rng = np.random.default_rng(2)
    state = _Swelling(container, rng.uniform(0.8, 1.2, 40), rng)
    state.scale, pressure = 0.9, 0.3

    def enthalpy():
        i, j = np.triu_indices(40, 1)
        sigma = state.scale * (state.size[i] + state.size[j])
        overlap = np.maximum(1 - np.linalg.norm(state.x[i] - state.x[j], axis=1) / sigma, 0)
        walls = [np.maximum(1 - d.T / (state.scale * state.size), 0) for d, _ in container.walls(state.x)]
        return 0.5 * (overlap**2).sum() + 0.5 * sum((w**2).sum() for w in walls) - pressure * 40 * np.log(state.scale)

    force, force_scale = state.forces(pressure)
    h = 1e-6
    for k in range(0, 40, 7):
        for axis in range(3):
            state.x[k, axis] += h
            up = enthalpy()
            state.x[k, axis] -= 2 * h
            down = enthalpy()
            state.x[k, axis] += h
            assert force[k, axis] == pytest.approx(-(up - down) / (2 * h), abs=1e-6)
    scale = state.scale
    state.scale = scale * np.exp(h)
    up = enthalpy()
    state.scale = scale * np.exp(-h)
    assert force_scale == pytest.approx(-(up - enthalpy()) / (2 * h), abs=1e-5)


def test_fcc_of_the_benchmarks():
    packing = fcc_sphere(RADIUS)
    ratio = all_distances(packing)[2]
    assert len(packing.radius_m) == 998
    assert (ratio < 1 + 1e-9).sum() == 5181 and ratio.min() > 1 - 1e-9
    assert packing.wall_gap_m.min() > 0


@pytest.mark.parametrize("arguments, word", [
    ((0.0, 10, 1), "positive"), ((np.nan, 10, 1), "positive"), ((0.01, 0, 1), "count")])
def test_bad_sizes_are_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        pack_sphere(*arguments)


def test_fcc_without_room_is_refused():
    with pytest.raises(ValueError, match="fits"):
        fcc_sphere(1.0, 2.0)
