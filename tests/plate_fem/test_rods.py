"""Rods against closed forms and against finer meshes."""

import math

import numpy as np
import pytest
from plates import STEEL, four_rods, plate, rod
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve

from lab.plate.rod_joint import foot, joint
from plate_fem.elements.mesh import bending_stiffness, default_mesh_size, gauss_points, nodes, shear_stiffness
from plate_fem.elements.rods import attach, joint_of
from plate_fem.elements.system import assemble
from plate_fem.modes import plate_modes

# A plate so stiff that it only moves as a rigid body on its rods, within the frequencies of interest.
STIFF = {"youngs_modulus_Pa": 2e17, "theory": "mindlin", "mesh_size_m": 0.125}


BAR_m, BEAM_m = (0.1 - 0.01 * shorter for shorter in foot(STEEL["poisson_ratio"]))  # with a foot that holds


def bar_stiffness(omega, length_m=BAR_m, diameter_m=0.02):
    """Dynamic stiffness at the top of a clamped bar, inertia included: E A (omega/c) cot(omega l / c)."""
    E, rho = STEEL["youngs_modulus_Pa"], STEEL["density_kg_m3"]
    k = omega * math.sqrt(rho / E)
    return E * math.pi * diameter_m**2 / 4 * k / math.tan(k * length_m)


def beam_stiffness(omega, length_m=BEAM_m, diameter_m=0.02):
    """Dynamic stiffness (2, 2) of lateral displacement and rotation at the top of a clamped Timoshenko beam.

    The equations of the beam are carried from its base to its top by a matrix exponential.
    """
    E, rho, nu = STEEL["youngs_modulus_Pa"], STEEL["density_kg_m3"], STEEL["poisson_ratio"]
    area, second = math.pi * diameter_m**2 / 4, math.pi * diameter_m**4 / 64
    shear = 6 * (1 + nu) / (7 + 6 * nu) * E / (2 * (1 + nu)) * area
    # v' = psi + Q/shear, psi' = M/EI, Q' = -rho A omega^2 v, M' = -Q - rho I omega^2 psi
    rates = np.array([[0, 1, 1 / shear, 0], [0, 0, 0, 1 / (E * second)],
                      [-rho * area * omega**2, 0, 0, 0], [0, -rho * second * omega**2, -1, 0]])
    transfer = expm(rates * length_m)[:, 2:]  # from (Q, M) at the base, where v and psi are zero
    return transfer[2:] @ np.linalg.inv(transfer[:2])


def shaft_stiffness(omega, length_m=0.1, diameter_m=0.02):
    """Dynamic torque per rotation at the top of a clamped shaft."""
    G, rho = STEEL["youngs_modulus_Pa"] / (2 * (1 + STEEL["poisson_ratio"])), STEEL["density_kg_m3"]
    k = omega * math.sqrt(rho / G)
    return G * math.pi * diameter_m**4 / 32 * k / math.tan(k * length_m)


def test_beam_stiffness_of_this_test_at_rest():
    """A slender beam that is clamped at its base: 12EI/l^3, 6EI/l^2, 4EI/l."""
    bending, shear = 207e9 * math.pi * 0.02**4 / 64, 1.3 * 6 / 8.8 * 207e9 / 2.6 * math.pi * 0.01**2
    flexibility = np.linalg.inv(beam_stiffness(1.0, 0.1))
    assert flexibility[0, 0] == pytest.approx(0.1**3 / (3 * bending) + 0.1 / shear, rel=1e-5)
    assert flexibility[0, 1] == pytest.approx(0.1**2 / (2 * bending), rel=1e-5)
    assert flexibility[1, 1] == pytest.approx(0.1 / bending, rel=1e-5)


@pytest.mark.parametrize("nu", [0.15, 0.3])
def test_a_rods_joint_gives_way_as_the_solid_of_revolution_says(nu):
    """Side and turn of a beam's head under a push and a moment there: those of the rod below, as if shorter since its
    foot cannot contract, and of its joint by the solid, which is solved anew; and so a bar under a pull."""
    rods = [rod(0.1, 0.05, diameter_m=0.014)]
    table = plate(rods=rods, theory="mindlin", youngs_modulus_Pa=69e9, poisson_ratio=nu, max_frequency_Hz=2e3)
    parts, found = attach(assemble(table)[0], table.rods[0], 2e3), joint(0.35, nu, 3.0)
    a, area, bending = 0.007, math.pi * 0.007**2, 207e9 * math.pi * 0.014**4 / 64
    shear = 6 * (1 + nu) / (7 + 6 * nu) * 207e9 / 2 / (1 + nu) * area
    bar_m, beam_m = (0.1 - a * shorter for shorter in foot(nu))
    across, along = beam_m**3 / 3 / bending + beam_m / shear, -(beam_m**2) / 2 / bending
    for part, of_rod, of_joint in (
            (parts[0], [[bar_m / 207e9 / area]], [[found["axial"]]]),
            (parts[1], [[across, along], [along, beam_m / bending]],
             [[found["side"], found["side_turn"] / a], [found["side_turn"] / a, found["turn"] / a**2]])):
        free = np.setdiff1d(np.arange(part.stiffness.shape[0]), part.held)
        loads = (free[:, None] == np.array(part.top)).astype(float)
        moved = loads.T @ np.linalg.solve(part.stiffness.toarray()[np.ix_(free, free)], loads)
        assert moved == pytest.approx(np.array(of_rod) + np.array(of_joint) / (69e9 * a), rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("theory", ["kirchhoff", "mindlin"])
def test_stub_and_head_of_a_rod_where_the_plate_bends_or_shears(theory):
    """Energy over the disc, of w = x^2/2 + xy bent and, with shear, of w = x: the plate's own, bowl and saddle apart,
    times stubs and area. The bent plate lifts the head by the mean of w and by the offset, the sheared one turns it."""
    table = plate(rods=[rod(0.1, 0.05)], theory=theory, max_frequency_Hz=2e3)
    system, joint = assemble(table)[0], joint_of(table, table.rods[0], theory)
    bar, beam, *_, stub = attach(system, table.rods[0], 2e3)
    fine = nodes(*(gauss_points(lines)[0] for lines in (system.lines_x_m, system.lines_y_m)))
    (x, y), w = fine.T, system.deflection(fine)
    counted, u = np.flatnonzero(abs(w).sum(axis=0)), np.zeros(w.shape[1])  # of which rotations are none
    wanted = x**2 / 2 + x * y if theory == "kirchhoff" else x
    u[counted] = np.linalg.lstsq(w[:, counted].toarray(), wanted, rcond=None)[0]
    if theory == "kirchhoff":
        energy = bending_stiffness(table) * (1.3 / 2 * joint.stub + 0.7 / 2 * (1 + 4) * joint.stub_twist)
        head = (0.1**2 + 0.01**2 / 4) / 2 + 0.1 * 0.05
        assert bar.rows @ u == pytest.approx(head + joint.offset_m2, rel=1e-9)
    else:
        energy = shear_stiffness(table) * joint.stub
        assert beam.rows @ u == pytest.approx(joint.sheared, rel=1e-9) and joint.sheared[1] > 0.8
    strain = stub.rows @ u
    assert strain @ (stub.stiffness @ strain) == pytest.approx(energy * math.pi * 0.01**2, rel=1e-9)


@pytest.mark.slow
def test_solid_of_revolution_in_limits_that_are_known():
    """A rod almost without stiffness leaves the plate alone, whose lower face follows the mid-plane where Poisson's
    ratio is zero; so does the foot of any rod its theories. That face is normal to the rod, where shear stress is a
    parabola: it turns by all of the shear and moves sideways by t/12 of it. A stiff disc on a half-space turns by
    3/4 (1 - nu^2)."""
    soft, stiff = joint(0.6, 0.0, 1e-6), joint(0.1, 0.3, 1e3, fine=2)
    assert max(abs(soft["stub"]), abs(soft["stub_twist"])) < 1e-5 and abs(soft["offset"]) < 1e-3
    assert np.abs(foot(0.0)).max() < 1e-6
    thin = joint(0.1, 0.0, 1e-6)
    assert [thin["sheared_side"], thin["sheared_turn"]] == pytest.approx([1 / 12, 1], rel=2e-3)
    assert stiff["kirchhoff_turn"] == pytest.approx(0.75 * 0.91, rel=0.05)


def fitted(rows, values):
    """The unknowns that rows (k, size) give, of which some count in no row, so that they have the values (k,)."""
    counted = np.flatnonzero(abs(rows).sum(axis=0))
    matrix = rows[:, counted]
    found = np.zeros(rows.shape[1])
    found[counted] = spsolve((matrix.T @ matrix).tocsc(), matrix.T @ values)
    return found


@pytest.mark.parametrize("theory", ["kirchhoff", "mindlin"])
def test_rigid_motions_leave_all_distances(theory):
    """Sway, yaw and tilt, as the rods' heads see them: of no two points of the lower face, at any places, does the
    distance change."""
    table = plate(rods=[rod(0.1, 0.05)], theory=theory, size_m=[0.5, 0.3], max_frequency_Hz=2e3)
    system, points = assemble(table)[0], np.random.default_rng(1).uniform(-0.14, 0.14, (6, 2))
    fine = nodes(*(gauss_points(lines)[0] for lines in (system.lines_x_m, system.lines_y_m)))
    height = -table.thickness_m / 2
    motions = np.zeros((system.size, 5))
    motions[-3:, :3] = np.eye(3)
    for axis in (0, 1):
        motions[:, 3 + axis] = fitted(system.deflection(fine), fine[:, axis])
        if system.rotations is not None:
            motions[:, 3 + axis] += fitted(system.rotation(fine, axis), np.ones(len(fine)))
    moved = np.stack([*(system.lateral(points, axis, height) @ motions for axis in (0, 1)),
                      system.deflection(points) @ motions], axis=1)
    for a in range(6):
        for b in range(a):
            apart = np.append(points[a] - points[b], 0)
            assert np.abs(apart @ (moved[a] - moved[b])).max() < 1e-9
    assert moved[0, 1, 2] == pytest.approx(points[0, 0])  # counter-clockwise seen from above
    # a tilt about an axis in the mid-plane takes (x, z) to (x - z theta, z + x theta)
    assert moved[0, 0, 3] == pytest.approx(-height) and moved[0, 1, 4] == pytest.approx(-height)


def roots(function, highest):
    """All zeros of a function below the highest frequency, where it does not jump through infinity."""
    omega = np.linspace(10.0, highest, 1200)
    value = np.array([function(w) for w in omega])
    zeros = []
    for k in np.flatnonzero(value[:-1] * value[1:] < 0):
        root = brentq(function, omega[k], omega[k + 1], xtol=1e-9 * highest)
        if abs(function(root)) < abs(value[k]) + abs(value[k + 1]):  # at a pole it is larger
            zeros.append(root)
    return zeros


@pytest.mark.slow
def test_rigid_plate_on_its_rods():
    """All modes up to 10 kHz: bounce, sway with tilt in two planes, yaw, and the rods' own bending."""
    mass, thickness = 7830 * 0.25 * 0.02, 0.02
    tilt_inertia, yaw_inertia = mass * (0.5**2 + thickness**2) / 12, mass * 0.5**2 / 6
    lower = np.array([[1, -thickness / 2], [0, 1]])  # sway and tilt to what the rod's top does

    def swaying(w):
        stiffness = 4 * lower.T @ beam_stiffness(w) @ lower
        stiffness[1, 1] += 4 * 0.2**2 * bar_stiffness(w) - tilt_inertia * w**2
        stiffness[0, 0] -= mass * w**2
        return np.linalg.det(stiffness)

    def yawing(w):
        return 4 * (2 * 0.2**2 * beam_stiffness(w)[0, 0] + shaft_stiffness(w)) - yaw_inertia * w**2

    highest = 2 * math.pi * 10e3
    bounce = roots(lambda w: 4 * bar_stiffness(w) - mass * w**2, highest)
    clamped = roots(lambda w: 1 / np.linalg.det(beam_stiffness(w)), highest)
    expected = np.sort([*bounce, *np.repeat(roots(swaying, highest), 2), *roots(yawing, highest),
                        *np.repeat(clamped, 8 - 3)]) / (2 * math.pi)
    modes = plate_modes(plate(rods=four_rods(), **STIFF, max_frequency_Hz=10e3))
    assert modes.frequency_Hz == pytest.approx(expected, rel=2e-4)


@pytest.mark.parametrize(
    ("theory", "rods"),
    [
        ("kirchhoff", four_rods()),
        ("mindlin", [rod(0.13, -0.06)]),
        pytest.param("mindlin", four_rods(), marks=pytest.mark.validate),
    ],
)
def test_frequencies_on_rods_converge_with_the_mesh(theory, rods):
    """Tied over their discs, rods have a converged answer; a rod tied to one node drifts for ever."""
    table = plate(rods=rods, theory=theory, max_frequency_Hz=2e3)
    default = default_mesh_size(table)
    modes = [
        plate_modes(table.model_copy(update={"mesh_size_m": s * default})).frequency_Hz[:10] for s in (2.0, 1.0, 0.75)
    ]
    coarse, medium = (modes[i] / modes[2] - 1 for i in (0, 1))
    assert np.all(coarse > -1e-7)  # conforming elements converge from above
    assert np.all(medium > -1e-7)
    assert medium.max() < 1e-3  # what the default mesh is made for
    assert medium.max() < coarse.max() / 2
