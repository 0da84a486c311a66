"""Stones cut by flat faces: volume, centre and inertia of solids against closed forms, and of their packings."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from scenes_of_tests import SCENES
from scipy.spatial import ConvexHull

from common.scene.scene import changed_scene
from common.scene.stones import ShapeTable
from common.tables import InputError
from dem.run.run import run_scene
from dem.stones.arrangement import stones_of
from dem.stones.assembly import assemble
from dem.stones.packing import REFERENCE_RADIUS_m, packed
from dem.stones.solids import moments, polyhedron, solid_of
from dem.stones.stone import UPRIGHT

NO_VOLLEY = {f"stones.{key}": None for key in ("radius_m", "speed_m_s", "positions_m", "gangue_order")}
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


def box_file(directory, size=(0.3, 0.2, 0.1), points=CUBE):
    hull = ConvexHull(points)
    triangles = hull.simplices.copy()
    for k, triangle in enumerate(triangles):
        a, b, c = points[triangle]
        if np.cross(b - a, c - a) @ hull.equations[k, :3] < 0:
            triangles[k] = triangle[::-1]
    file = directory / "box.stl"
    meshio.write_points_cells(file, points * size, [("triangle", triangles)])
    return file


def test_moments_of_a_box_by_its_closed_form(tmp_path):
    a, b, c = 0.3, 0.2, 0.1
    solid = solid_of(str(box_file(tmp_path)), 1)
    size = (4 / 3 * np.pi / (a * b * c)) ** (1 / 3)
    assert np.ptp(solid.corner, axis=0) == pytest.approx(size * np.array([a, b, c]), rel=1e-6)
    volume, first, second = moments(solid.corner, solid.triangle)
    assert volume == pytest.approx(4 / 3 * np.pi) and np.allclose(first, 0, atol=1e-7)
    assert np.diag(second) / volume == pytest.approx(size**2 * np.array([a * a, b * b, c * c]) / 12, rel=1e-6)


@pytest.mark.parametrize("table", [{}, {"extent_ratios": (0.7, 0.6)}, {"corners": 8}])
def test_a_polyhedron_is_convex_closed_and_as_long_and_flat_as_asked(table):
    solid = polyhedron(ShapeTable(**table), 5)
    extent = np.ptp(solid.corner, axis=0)
    elongation, flatness = table.get("extent_ratios", (1.0, 1.0))
    assert extent / extent[0] == pytest.approx([1, elongation, elongation * flatness])
    assert np.all(solid.corner @ solid.normal.T <= solid.offset + 1e-9) and solid.reach > 1
    edges, count = np.unique(np.sort(solid.triangle[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0,
                             return_counts=True)
    assert np.all(count == 2) and len(solid.corner) - len(edges) + len(solid.triangle) == 2  # Euler
    inside = np.random.default_rng(1).uniform(-3, 3, (200_000, 3))
    hit = np.all(inside @ solid.normal.T <= solid.offset, axis=1)
    assert hit.mean() * 6**3 == pytest.approx(4 / 3 * np.pi, rel=0.03)  # volume by darts
    assert np.abs(inside[hit].mean(axis=0)).max() < 0.03


@pytest.mark.parametrize("shapes, contact", [({}, "smooth"), ({"rock": {}}, "faces")])
def test_the_shape_chooses_the_contact_where_the_scene_does_not(tmp_path, shapes, contact):
    table = {"size_m": 0.03, "speed_m_s": 2.0}
    changes = {"stones.count": 3, "stones.drawn": table, "shapes": shapes, "stones.agglomerate.subspheres": 200} | NO_VOLLEY
    unsaid = changed_scene(SCENES / "small.toml", changes | {"stones.agglomerate.contact": None})
    assert unsaid.agglomerate.contact == contact
    assert unsaid == changed_scene(SCENES / "small.toml", changes | {"stones.agglomerate.contact": contact})
    asked = changed_scene(SCENES / "small.toml", changes)
    assert asked.agglomerate.contact == "sub_spheres"


def drawn(tmp_path, shape, subspheres=120, **changes):
    table = {"size_m": [0.03, 0.05], "speed_m_s": 2.0, "arrival_s": [0.0, 0.002]}
    return changed_scene(SCENES / "small.toml", NO_VOLLEY | {
        "stones.count": 3, "stones.drawn": table, "shapes.rock": shape, "stones.agglomerate.subspheres": subspheres,
        "stones.agglomerate.unbreakable": True, "time.duration_s": 6e-3, "time.view_interval_s": None} | changes)


@pytest.mark.parametrize("kind", ["polyhedron", "box"])
def test_mass_centre_and_inertia_of_a_stone_are_those_of_its_solid(tmp_path, kind):
    shape = {"extent_ratios": [0.8, 0.7]} if kind == "polyhedron" else str(box_file(tmp_path))
    scene = drawn(tmp_path, shape)
    stones = [replace(stone, attitude=UPRIGHT) for stone in stones_of(scene, "scene")]
    one = assemble(scene, stones)
    for k, stone in enumerate(stones):
        here = one.agglomerate == k
        m, x, r = one.mass_kg[here], one.center_m[here], one.radius_m[here]
        solid = solid_of(scene.shapes["rock"], stone.seed)
        mass = scene.materials[stone.material].density_kg_m3 * 4 / 3 * np.pi * stone.radius_m**3
        assert m.sum() == pytest.approx(mass, rel=1e-9)
        centre = m @ x / mass
        assert np.allclose(centre[:2], [stone.place_m[0], stone.place_m[1]], atol=0.01 * stone.radius_m)
        second = ((x - centre) * m[:, None]).T @ (x - centre) + (m @ r**2 / 5) * np.eye(3)
        expected = mass * stone.radius_m**2 * solid.second_moment / solid.volume
        assert np.abs(second - expected).max() < 0.01 * np.trace(expected)


def test_the_outer_layer_lies_on_the_surface():
    solid = polyhedron(ShapeTable(extent_ratios=(0.8, 0.7)), 2)
    packing = packed(solid, 300, 1, None)
    gap = packing.wall_gap_m / packing.radius_m
    assert gap.min() > -2e-3 and (np.abs(gap) < 0.02).mean() > 0.35
    for normal, offset in zip(solid.normal, solid.offset * REFERENCE_RADIUS_m):  # at every face of some size
        if (solid.offset < 1.2).all():
            assert (offset - packing.center_m @ normal - packing.radius_m).min() < 0.1 * packing.radius_m.mean()


def test_a_surface_that_is_not_closed_is_refused(tmp_path):
    file = box_file(tmp_path)
    mesh = meshio.read(file)
    meshio.write_points_cells(file, mesh.points, [("triangle", mesh.cells_dict["triangle"][:-1])])
    with pytest.raises(InputError, match="must hold a closed surface"):
        solid_of(str(file), 7)


@pytest.mark.slow
def test_polyhedra_fall_and_the_ledger_closes(tmp_path):
    summary = run_scene(drawn(tmp_path, {"extent_ratios": [0.8, 0.7]}, **{"plate.tilt_deg": 10.0}), "scene",
                        tmp_path / "run")
    assert abs(summary["energy"]["closure"]) < 0.01 and min(summary["rebound_speed_m_s"]) > -2.0


@pytest.mark.parametrize("shape, changes, said", [
    ({"extent_ratios": [0.1, 1.0]}, {}, "shapes.rock.extent_ratios.0 = 0.1: must be"),
    ({"elongation": 0.8}, {}, r"shapes.rock.elongation = 0.8: unknown key; use extent_ratios = \[elongation, flatness\]"),
    ({"corners": 8, "file": "x.stl"}, {}, "shapes.rock.file = 'x.stl': unknown key; use shapes.NAME = \"FILE\""),
    (8, {}, "shapes.rock = 8: must be a table"),
    ("none.stl", {}, "none.stl: cannot be read"),
    ({}, {"stones.agglomerate.contact": "smooth"}, "must be \"faces\" or \"sub_spheres\" where"),
    ({}, {"stones.agglomerate": None}, "stones.agglomerate = None"),
    ({}, {"stones.drawn.shapes": ["rock"]}, r"stones.drawn.shapes = \['rock'\]: unknown key; use tables"),
])
def test_bad_input_is_refused_in_one_line(tmp_path, shape, changes, said):
    with pytest.raises(InputError, match=said) as refused:
        stones_of(drawn(tmp_path, shape, **changes), "scene")
    assert "\n" not in str(refused.value)
