"""A sub-sphere that reaches over the edge of the plate touches the edge line: elastic, continuous, and with friction.
A smooth stone that breaks there loses no energy by it."""

import numpy as np
import pytest
from decks import Body, deck, frames, ledger, run_engine, write_files
from scenes_of_tests import changed

from dem.run.run import run_scene

RADIUS_m, HALF_m = 3e-3, 0.01


def fall(directory, x_m, y_m=0.0, velocity=(0.0, -1.0), restitution=1.0, friction=0.0, steps=10000,
         half_m=(HALF_m, HALF_m), z_m=RADIUS_m):
    """One sphere falls on a rigid plate, its centre over (x, y); `velocity` along x and z. Returns its velocities
    and forces (k, 3), and the ledger in shares of its kinetic energy at the start."""
    body = Body(np.array([[x_m, y_m, z_m]]), np.full(1, RADIUS_m), np.zeros((0, 2), int), np.zeros(0))
    write_files(directory, body)
    wall = (f"fix plate all wall/plate agglomerates agglomerates.txt forces forces.bin "
            f"extent {-half_m[0]} {half_m[0]} {-half_m[1]} {half_m[1]} co_step 1 contact model hertz tangential history "
            f"primitive type 2 zplane 0.0\n")
    text = deck(2e-7, steps, 10, lines=wall, velocity=f"velocity all set {velocity[0]} 0 {velocity[1]} units box\n")
    text = text.replace("0.5 0.5 0.5 0.5", " ".join([str(friction)] * 4))
    run_engine(directory, text.replace("0.9 0.9 0.9 0.9", " ".join([str(restitution)] * 4)))
    seen = frames(directory)
    start = 0.5 * body.mass_kg[0] * (velocity[0] ** 2 + velocity[1] ** 2) or 1.0  # J, of one that was at rest
    return seen.v[:, 0], seen.force[:, 0], {name: rows[:, 0] / start for name, rows in ledger(directory).column.items()}


def unexplained(c):
    return -c["wall_work_J"] - c["wall_elastic_J"] - c["wall_damped_J"] - c["friction_J"] + c["springs_gained_J"]


@pytest.mark.slow
@pytest.mark.parametrize("beside_m", [1e-4, 1.5e-3, 2.5e-3])
def test_an_elastic_sphere_is_reflected_by_the_edge(tmp_path, beside_m):
    """The normal goes from the edge to the centre: a sphere that falls beside it turns its velocity about that normal.
    The overlap is small against the radius, so the normal hardly turns in the contact."""
    v, _, c = fall(tmp_path, HALF_m + beside_m)
    sine = beside_m / RADIUS_m
    cosine = np.sqrt(1 - sine**2)
    assert v[-1] == pytest.approx([2 * sine * cosine, 0, 2 * cosine**2 - 1], abs=0.02)
    assert c["kinetic_J"][-1] == pytest.approx(1, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("half_m", [(HALF_m, 0.4 * HALF_m), (0.4 * HALF_m, HALF_m)])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_plate_that_is_not_square_has_its_own_edges(tmp_path, half_m, axis):
    """From the edge to the centre it goes at 60 degrees."""
    place, expected = [0.0, 0.0], [0.0, 0.0, 0.5]
    place[axis], expected[axis] = half_m[axis] + 1.5e-3, np.sqrt(0.75)
    v, _, _ = fall(tmp_path, *place, half_m=half_m)
    assert v[-1] == pytest.approx(expected, abs=0.02)


def test_what_lies_below_the_face_is_pushed_away_from_the_nearest_edge(tmp_path):
    """A sphere that came past the edge, its centre 0.2 mm inside of it and 2.9 mm below: along the line from the edge."""
    _, force, _ = fall(tmp_path, HALF_m - 2e-4, 1e-3, velocity=(0.0, 0.0), steps=10, z_m=-2.9e-3)
    away = np.array([-2e-4, 0, -2.9e-3])
    assert force[0] == pytest.approx(np.linalg.norm(force[0]) * away / np.linalg.norm(away), rel=1e-6)
    assert force[0][2] < 0


def test_a_corner_pushes_both_ways(tmp_path):
    v, _, c = fall(tmp_path, HALF_m + 1.5e-3, HALF_m + 1.5e-3)
    assert v[-1][0] == pytest.approx(v[-1][1], rel=1e-9) and v[-1][0] > 0.6
    assert c["kinetic_J"][-1] == pytest.approx(1, abs=1e-4)


def test_the_force_is_continuous_where_the_centre_leaves_the_plate(tmp_path):
    """A sphere that crosses the outline in the middle of its contact is as one far from the edge."""
    (tmp_path / "edge").mkdir(), (tmp_path / "inside").mkdir()
    edge, inside = (fall(tmp_path / name, x, velocity=(1.0, -1.0), steps=2000)
                    for name, x in (("edge", HALF_m - 2e-5), ("inside", 0.0)))
    assert edge[1][:, 2].max() == pytest.approx(inside[1][:, 2].max(), rel=1e-3)
    assert np.abs(np.diff(edge[1][:, 2])).max() == pytest.approx(np.abs(np.diff(inside[1][:, 2])).max(), rel=0.02)
    assert np.abs(unexplained(edge[2])).max() < 2e-4


@pytest.mark.parametrize(("friction", "restitution"), [(0.0, 1.0), (0.4, 1.0), (0.4, 0.5)])
def test_the_ledger_explains_what_the_edge_took(tmp_path, friction, restitution):
    _, _, c = fall(tmp_path, HALF_m + 1.5e-3, friction=friction, restitution=restitution)
    assert abs(unexplained(c)[-1]) < 2e-4
    assert 1 - c["kinetic_J"][-1] == pytest.approx(-c["wall_work_J"][-1], abs=1e-9)
    assert friction > 0 or c["friction_J"][-1] == 0


@pytest.mark.parametrize(("velocity", "seed", "subspheres"), [
    ((1.5, 0.0, -4.0), 1, 200), ((3.0, 0.0, -3.0), 1, 200), ((3.0, 0.0, -3.0), 2, 200), ((1.5, 0.0, -4.0), 1, 500)])
def test_a_stone_that_breaks_as_it_slides_over_the_edge_keeps_its_energy(tmp_path, velocity, seed, subspheres):
    """Its patch goes on as single sub-spheres, some of them beside the plate."""
    rigid = changed("hertz_coal", {}).plate.model_dump(mode="json")
    volley = dict.fromkeys(("count", "positions_m", "radius_m", "speed_m_s", "gangue_ratio", "gangue_order",
                            "coal", "gangue"))
    one = {"material": "coal", "radius_m": 0.025, "place_m": [0.2497, 0.0], "velocity_m_s": velocity}
    scene = changed("single", {
        **{f"stones.{key}": value for key, value in volley.items()}, "stones.each": [one], "stones.seed": seed, "plate": rigid,
        "stones.agglomerate.subspheres": subspheres, "contacts.coal_plate": {"restitution": 1.0, "friction": 0.4},
        "time.duration_s": 9e-4, "time.view_interval_s": None})
    found = run_scene(scene, "scene", tmp_path / "run")
    assert found["n_bonds_broken"] > 400
    assert abs(found["energy"]["closure"]) < 1e-3
    for part in ("contacts", "bonds"):
        assert abs(found["energy"][f"{part}_unexplained_J"]) < 1e-3 * found["energy"]["impact_J"]
    assert found["energy"]["bond_damping_J"] > 0.01 * found["energy"]["impact_J"]
