"""Stones that are not convex: an L cut out of a plate, against closed forms of boxes; and what no solid can be."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from test_shapes import CUBE, drawn

from common.tables import InputError, Refused
from dem.run.run import run_scene
from dem.stones.arrangement import stones_of
from dem.stones.assembly import assemble
from dem.stones.packing import REFERENCE_RADIUS_m, container_of, packed
from dem.stones.solids import moments, solid_of
from dem.stones.stone import UPRIGHT

HEIGHT = 0.8
OUTLINE = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
BOXES = np.array([[[0, 0, 0], [2, 1, HEIGHT]], [[0, 1, 0], [1, 3, HEIGHT]]])  # low and high corners
BOX = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [1, 5, 7],
                [1, 7, 3], [0, 2, 6], [0, 6, 4]])  # of CUBE, all turned the same way


def prism(outline, height, fan):
    """Corners and outward triangles; `fan` (k, 3) is the outline in triangles."""
    n = len(outline)
    point = np.vstack([np.column_stack([outline, np.full(n, z)]) for z in (0.0, height)])
    sides = [t for k in range(n) for m in [(k + 1) % n] for t in ([k, m, m + n], [k, m + n, k + n])]
    return point, np.vstack([np.array(fan)[:, ::-1], np.array(fan) + n, sides])


ELL = prism(OUTLINE, HEIGHT, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])


def written(directory, point, triangle):
    solid_of.cache_clear()
    meshio.write_points_cells(directory / "mesh.stl", point, [("triangle", triangle)])
    return str(directory / "mesh.stl")


@pytest.fixture(scope="module")
def ell(tmp_path_factory):
    return solid_of(written(tmp_path_factory.mktemp("ell"), *ELL), 1)


def of_boxes():
    """Volume, centre and second moment about it of the two boxes of the L."""
    size, middle = BOXES[:, 1] - BOXES[:, 0], BOXES.mean(axis=1)
    volume = size.prod(axis=1)
    centre = volume @ middle / volume.sum()
    off = middle - centre
    second = sum(v * (np.outer(o, o) + np.diag(s**2) / 12) for v, o, s in zip(volume, off, size, strict=True))
    return volume.sum(), centre, second


def test_moments_of_an_L_by_those_of_its_boxes(ell):
    volume, centre, second = of_boxes()
    size = (4 / 3 * np.pi / volume) ** (1 / 3)
    assert not ell.is_convex and ell.corner == pytest.approx(size * (np.unique(ELL[0], axis=0) - centre), abs=1e-6)
    found = moments(ell.corner, ell.triangle)
    assert found[0] == pytest.approx(4 / 3 * np.pi) and np.allclose(found[1], 0, atol=1e-6)
    assert found[2] == pytest.approx(size**5 * second, abs=1e-6 * np.trace(size**5 * second))


def test_inside_and_distance_to_the_surface_by_those_of_its_boxes(ell):
    """Of points inside, the distance to the surface is that to the nearest of its eight rectangles."""
    container = container_of(ell)
    volume, centre, _ = of_boxes()
    size = (4 / 3 * np.pi / volume) ** (1 / 3)
    point = np.random.default_rng(2).uniform(ELL[0].min(axis=0), ELL[0].max(axis=0), (4000, 3))
    scaled = size * (point - centre)
    inside = np.any([np.all((point > low) & (point < high), axis=1) for low, high in BOXES], axis=0)
    assert np.array_equal(container.contains(scaled), inside) and 0.3 < inside.mean() < 0.8
    edges = np.stack([OUTLINE, np.roll(OUTLINE, -1, axis=0)])
    upright = [(np.append(pair.min(axis=0), 0), np.append(pair.max(axis=0), HEIGHT)) for pair in edges.swapaxes(0, 1)]
    level = [(np.append(low[:2], z), np.append(high[:2], z)) for low, high in BOXES for z in (0, HEIGHT)]
    away = np.min([np.linalg.norm(point - np.clip(point, low, high), axis=1) for low, high in upright + level], axis=0)
    walls = container.walls(scaled[inside])
    assert walls[0][0] == pytest.approx(size * away[inside], abs=1e-6)
    assert np.linalg.norm(walls[0][1], axis=1) == pytest.approx(1.0)
    assert np.array_equal(container.contains(scaled[inside] - 1.001 * walls[0][0][:, None] * walls[0][1]),
                          np.zeros(inside.sum(), dtype=bool))


@pytest.mark.slow
def test_the_outer_layer_lies_on_the_surface_of_an_L(ell):
    packing = packed(ell, 100, 1, None)
    gap = packing.wall_gap_m / packing.radius_m
    assert gap.min() > -2e-3 and (np.abs(gap) < 0.02).mean() > 0.35
    assert packing.container.contains(packing.center_m).all()
    off = packing.center_m[:, None] - packing.center_m
    apart = np.sqrt((off**2).sum(axis=2)) / (packing.radius_m[:, None] + packing.radius_m)
    assert apart[~np.eye(100, dtype=bool)].min() > 0.998
    for corner in ell.corner:  # each end of the L is filled
        nearest = (np.linalg.norm(packing.center_m - REFERENCE_RADIUS_m * corner, axis=1) - packing.radius_m).min()
        assert nearest < 1.5 * packing.radius_m.mean()


@pytest.mark.slow
def test_stones_in_the_shape_of_an_L_fall(tmp_path, monkeypatch):
    """Mass, centre and inertia are those of the solid, and the energy closes."""
    monkeypatch.setattr("dem.stones.arrangement.PACKINGS", 1)
    shape = written(tmp_path, *ELL)
    scene = drawn(tmp_path, shape, 100)
    stones = [replace(stone, attitude=UPRIGHT) for stone in stones_of(scene, "scene")]
    one = assemble(scene, stones)
    solid = solid_of(scene.shapes["rock"], stones[0].seed)
    for k, stone in enumerate(stones):
        here = one.agglomerate == k
        m, x, r = one.mass_kg[here], one.center_m[here], one.radius_m[here]
        mass = scene.materials[stone.material].density_kg_m3 * 4 / 3 * np.pi * stone.radius_m**3
        assert m.sum() == pytest.approx(mass, rel=1e-9)
        centre = m @ x / mass
        assert np.allclose(centre[:2], stone.place_m, atol=0.01 * stone.radius_m)
        second = ((x - centre) * m[:, None]).T @ (x - centre) + (m @ r**2 / 5) * np.eye(3)
        expected = mass * stone.radius_m**2 * solid.second_moment / solid.volume
        assert np.abs(second - expected).max() < 0.01 * np.trace(expected)
    summary = run_scene(scene, "scene", tmp_path / "run")
    assert abs(summary["energy"]["closure"]) < 0.01 and min(summary["rebound_speed_m_s"]) > -2.0


def beside(*boxes):
    """Boxes (low, high) as one mesh."""
    return (np.vstack([low + CUBE * (np.array(high) - low) for low, high in boxes]),
            np.vstack([BOX + 8 * k for k in range(len(boxes))]))


ONE, LOWER = (np.zeros(3), np.ones(3)), (np.array([0.2, 0.2, -2.0]), np.array([0.8, 0.8, 0.5]))
WRONG = ELL[1].copy()
WRONG[3] = WRONG[3][::-1]


@pytest.mark.parametrize("point, triangle, said", [
    (ELL[0], ELL[1][:-1], "an edge does not belong to two triangles"),
    (ELL[0], WRONG, "triangles are all turned the same way"),
    (*beside(ONE, LOWER), "must not cut itself, as it does at"),
    (*beside(ONE, (np.full(3, 3.0), np.full(3, 4.0)), (np.full(3, 3.2), np.full(3, 3.8))), "goes 2 times round"),
])
def test_what_bounds_no_solid_is_refused_in_one_line(tmp_path, point, triangle, said):
    file = written(tmp_path, point, triangle)
    with pytest.raises(InputError, match=said) as refused:
        solid_of(file, 1)
    assert "\n" not in str(refused.value) and "mesh.stl" in str(refused.value)


@pytest.mark.slow
def test_parts_that_do_not_hold_together_are_refused(tmp_path):
    shape = written(tmp_path, *beside(ONE, (np.full(3, 3.0), np.full(3, 4.0))))
    scene = drawn(tmp_path, shape, 40)
    with pytest.raises(Refused, match="hold all parts of their shape together"):
        assemble(scene, stones_of(scene, "scene"))


def test_a_surface_may_be_turned_inside_out_as_a_whole(tmp_path, ell):
    inside_out = solid_of(written(tmp_path, ELL[0], ELL[1][:, ::-1]), 1)
    assert inside_out.volume == pytest.approx(ell.volume) and np.allclose(inside_out.corner, ell.corner)
