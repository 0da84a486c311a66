"""What PlateModes offers: shapes between nodes, regular grids, bounds, the cache."""

import numpy as np
import pytest
from plates import four_rods, plate, rod

from common.tables import InputError, Refused
from plate_fem import modes as modes_module
from plate_fem.elements.mesh import bicubics, nodes
from plate_fem.elements.rods import disc_quadrature, joint_of
from plate_fem.impact import energy_left_out
from plate_fem.modes import plate_modes, table_hash
from plate_fem.solution import eigen, model

TABLE = plate(rods=[rod(0.15, 0.1)], max_frequency_Hz=1500.0, theory="kirchhoff")


@pytest.fixture(scope="module")
def modes():
    return plate_modes(TABLE)


def test_shapes_at_nodes_and_cells(modes):
    assert modes.shape_at(modes.node_m) == pytest.approx(modes.shape, abs=1e-12)
    x, y = modes.node_m[modes.quad].transpose(2, 0, 1)
    area = 0.5 * np.sum(x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y, axis=1)
    assert np.all(area > 0)
    assert area.sum() == pytest.approx(0.25)


def test_a_place_off_the_plate_is_refused_and_its_edge_is_not(modes):
    assert np.isfinite(modes.shape_at([[0.25, -0.25]])).all()
    for place, message in (([0.251, 0.0], "x = 0.251: must lie on the plate, from -0.25 to 0.25 m"),
                           ([0.0, np.nan], "y = nan: must lie on the plate"), ([0.0], "points")):
        with pytest.raises(InputError, match=message):
            modes.shape_at([place])
    with pytest.raises(InputError, match="y = 9"):
        plate_modes(TABLE, None, [[0.0, 9.0]])
    with pytest.raises(InputError, match="nan Hz"):
        energy_left_out(np.nan, 1e-4)


def test_grid_is_the_shape_and_goes_on_smoothly_beyond_the_edge(modes):
    x, y, shape = _on_grid(modes, 0.003)
    h = x[1] - x[0]
    assert h <= 0.003
    assert x[2] == pytest.approx(-0.25)
    assert x[-3] == pytest.approx(0.25)
    assert y[0] == pytest.approx(-0.25 - 2 * (y[1] - y[0]))
    points = np.array([[x[5], y[7]], [x[2], y[-3]]])
    assert shape[[5, 2], [7, -3]] == pytest.approx(modes.shape_at(points), abs=1e-12)
    # four-point Lagrange interpolation across the edge loses nothing: third differences stay small there
    across = np.diff(shape, 3, axis=0)
    assert abs(across[:4]).max() < 5 * abs(across[4:20]).max()


def test_four_point_interpolation_on_the_grid(modes):
    x, y, shape = _on_grid(modes, 0.004)
    rng = np.random.default_rng(2)
    points = rng.uniform(-0.25, 0.25, (200, 2))
    found = np.array([_lagrange(x, y, shape, p) for p in points])
    assert abs(found - modes.shape_at(points)).max() < 1e-5 * abs(shape).max()


def _on_grid(modes, spacing_m):
    x, y = modes.grid(spacing_m)
    return x, y, np.hstack(list(modes.shapes_at(nodes(x, y)))).reshape(len(x), len(y), -1)


def _lagrange(x, y, shape, point):
    weights, start = [], []
    for axis, value in ((x, point[0]), (y, point[1])):
        i = min(max(int((value - axis[0]) / (axis[1] - axis[0])) - 1, 0), len(axis) - 4)
        nodes = axis[i : i + 4]
        w = [np.prod([(value - b) / (a - b) for b in nodes if b != a]) for a in nodes]
        weights.append(w)
        start.append(i)
    block = shape[start[0] : start[0] + 4, start[1] : start[1] + 4]
    return np.einsum("i,j,ijm->m", *weights, block)


@pytest.mark.parametrize("table", [TABLE, plate(edges="simply_supported", max_frequency_Hz=2000.0, theory="kirchhoff")],
                         ids=["largest at corners", "largest between nodes"])
def test_largest_shape_bounds_every_point(table):
    modes = plate_modes(table)
    points = np.random.default_rng(5).uniform(-0.25, 0.25, (20000, 2))
    found = abs(modes.shape_at(points)).max(axis=0)
    assert np.all(found <= modes.largest_shape)
    assert np.all(modes.largest_shape < 1.2 * found)


def test_the_middle_plane_sways_and_yaws_as_a_rigid_body(modes):
    """The top face moves as it does, less half the thickness times the slope: fibres of a thin plate stay normal."""
    middle = modes.lateral + TABLE.thickness_m / 2 * modes.nodal[1:3].transpose(1, 0, 2)
    (x, y), ones = modes.node_m.T, np.ones(len(modes.node_m))
    for axis, across in enumerate((y, x)):
        left = np.linalg.lstsq(np.column_stack([ones, across]), middle[:, axis], rcond=None)[1]
        assert np.all(left < 1e-12 * (modes.lateral[:, axis] ** 2).sum(axis=0).max())


def test_mean_shape_is_the_mean(modes):
    s = (np.arange(400) + 0.5) / 400 * 0.5 - 0.25
    points = np.stack(np.meshgrid(s, s), axis=-1).reshape(-1, 2)
    assert modes.mean_shape == pytest.approx(modes.shape_at(points).mean(axis=0), abs=1e-4)


def test_signs_and_values_repeat_to_the_bit(modes):
    again = plate_modes(TABLE)
    assert np.array_equal(again.nodal, modes.nodal)
    top = abs(modes.shape).max(axis=0)
    first = (abs(modes.shape) > 0.9 * top).argmax(axis=0)
    assert np.all(modes.shape[first, np.arange(len(top))] > 0)


def test_rod_force_follows_the_deflection():
    """In a mode, E A k / sin(k l) times the rise of the rod's head, which is the mean deflection over the disc, more by
    its offset and less by what the joint gives way; k the wavenumber of the bar, which its foot makes shorter."""
    table = plate(rods=four_rods(), max_frequency_Hz=600.0, theory="kirchhoff")
    modes, joint = plate_modes(table), joint_of(table, table.rods[0], "kirchhoff")
    k, length_m = 2 * np.pi * modes.frequency_Hz * np.sqrt(7830 / 207e9), 0.1 / (1 + 0.57 * 0.3**2 * 0.01 / 0.1)
    for force, (x, y) in zip(modes.rod_force, [(-0.2, -0.2), (-0.2, 0.2), (0.2, -0.2), (0.2, 0.2)], strict=True):
        points, weights = disc_quadrature(x, y, 0.01)
        w = bicubics(modes.lines_x_m, modes.lines_y_m)
        bent = sum(w.values(points, by) for by in ((2, 0), (0, 2)))
        rise = weights @ (modes.shape_at(points) + joint.offset_m2 * bent @ modes.nodal.reshape(-1, len(k)))
        stiffness = 207e9 * np.pi * 0.01**2 * k
        expected = stiffness * rise / (np.sin(k * length_m) + joint.axial_m_N * stiffness * np.cos(k * length_m))
        assert force == pytest.approx(expected, rel=1e-5, abs=1e-8 * abs(expected).max())


def test_cache(tmp_path, modes, monkeypatch):
    first = plate_modes(TABLE, tmp_path)
    monkeypatch.setattr(modes_module, "_compute", lambda *_: pytest.fail("computed again"))
    second = plate_modes(TABLE, tmp_path)
    for name in ("frequency_Hz", "nodal", "rod_force", "surface_stress", "lines_x_m", "mass_kg", "theory",
                 "n_residual"):
        assert np.array_equal(getattr(first, name), getattr(second, name))
        assert np.array_equal(getattr(first, name), getattr(modes, name))
    assert type(second.mass_kg) is float
    assert type(second.theory) is str


def test_hash_follows_what_matters():
    assert table_hash(TABLE) == table_hash(TABLE.model_copy(update={"yield_stress_Pa": 1e8}))
    assert table_hash(TABLE) != table_hash(TABLE.model_copy(update={"thickness_m": 0.021}))
    assert table_hash(TABLE) != table_hash(TABLE, [[0.0, 0.0]])


@pytest.mark.slow
@pytest.mark.parametrize("rods", [[rod(0.15, 0.1, diameter_m=0.06)], []], ids=["rod", "free"])
def test_lanczos_finds_what_the_dense_solution_does(rods, monkeypatch):
    """Of a free plate also its motions as a rigid body, and pairs of equal frequencies."""
    monkeypatch.setattr(model, "mirror_axes", lambda *_: [])
    table = plate(rods=rods, thickness_m=0.01, max_frequency_Hz=2e3)
    part = max(model.build_model(table).parts, key=lambda part: len(part.number))
    limit = (2 * np.pi * 2e3) ** 2
    count = eigen._count_below(part, limit)
    assert count > 10 and len(part.number) > 2 * eigen._vectors_for(count)
    found, shapes = eigen._lowest(part, limit, count)
    monkeypatch.setattr(eigen, "_vectors_for", lambda _: len(part.number))
    expected, wanted = eigen._lowest(part, limit, count)
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-12 * limit)
    assert shapes @ (shapes.T @ (part.mass @ wanted)) == pytest.approx(wanted, abs=1e-6 * abs(wanted).max())


def test_more_modes_than_can_be_found_are_refused(monkeypatch):
    monkeypatch.setattr(eigen, "MODES_AT_MOST", 4)
    with pytest.raises(Refused, match="the limit is 4"):
        plate_modes(TABLE)


def test_a_plate_without_a_mode_is_refused():
    """It stands on a rod: no part of it is free to move as a whole."""
    with pytest.raises(Refused, match="no mode of plate and rods lies below it"):
        plate_modes(TABLE.model_copy(update={"max_frequency_Hz": 1.0}))


def test_momentum_of_a_plate_that_its_edges_hold():
    """A simply supported square one: 8 / pi^2 of the root of its mass, in its first mode."""
    found = plate_modes(plate(edges="simply_supported", max_frequency_Hz=1500.0, theory="kirchhoff"))
    assert abs(found.momentum[0]) == pytest.approx(8 / np.pi**2 * np.sqrt(found.mass_kg), rel=1e-4)
