"""Energy of the sub-spheres' dilatation, and the tensile criterion that knows the mean pressure (docs/bonds.md)."""

import numpy as np
import pytest
from decks import Body, bond_line, chain, deck, fcc_ball, frames, ledger, run_engine, write_files
from scipy.spatial.transform import Rotation
from test_bond_breaking import load_one_bond
from test_bond_parallel import strike, trembles_on

from dem.stones.bonds import Bonds, bond_network, dilatations, network_stiffness, stiffness_matrix
from dem.stones.packing import pack_sphere
from tests.dem.highest_frequency import highest_frequency_rad_s

E, RATIO, KAPPA = 5e9, 2.0, 1.5e9
LENGTH, RADIUS = 2e-3, 1e-3
AREA = np.pi * RADIUS**2
ELASTIC = (KAPPA, 0.0, 0.0)


def energy_J(body, undeformed_m, x_m):
    """The naive twin: sum over sub-spheres of kappa (W/6) theta^2/2, theta = 3 S/W, bond by bond."""
    stretch, weight = np.zeros(len(x_m)), np.zeros(len(x_m))
    for (i, j), radius in zip(body.pair, body.bond_radius_m):
        length = np.linalg.norm(undeformed_m[j] - undeformed_m[i])
        for end in (i, j):
            stretch[end] += np.pi * radius**2 * (np.linalg.norm(x_m[j] - x_m[i]) - length)
            weight[end] += np.pi * radius**2 * length
    return (0.5 * KAPPA * weight / 6 * (3 * stretch / weight) ** 2).sum()


def random_body():
    packing = pack_sphere(0.01, 40, seed=3)
    bonds = bond_network(packing)
    return Body(packing.center_m, 0.9 * packing.radius_m, np.column_stack([bonds.first, bonds.second]), bonds.radius_m)


def forces(directory, body, x_m, kernel="plain", **bond):
    """Of the bonds alone on sub-spheres that stand at x_m (n, 3), undeformed as in `body`."""
    directory.mkdir()
    write_files(directory, body)
    undeformed = (directory / "bonds.txt").read_text()
    write_files(directory, Body(x_m, body.radius_m, body.pair, body.bond_radius_m))
    (directory / "bonds.txt").write_text(undeformed)
    run_engine(directory, deck(1e-9, 0, 1, bonds=bond_line(E, RATIO, kernel=kernel, **bond)))
    return frames(directory).force[0], ledger(directory).column["bond_elastic_J"]


@pytest.mark.parametrize("kernel", ["plain", "sse2", "avx2", "auto"])
def test_forces_are_the_gradient_of_the_energy(tmp_path, kernel):
    """Against central differences of the twin, of a body deformed by some per cent; and they turn with the body."""
    body = random_body()
    x = body.center_m + np.random.default_rng(1).normal(size=body.center_m.shape) * 3e-5
    expected, step = np.zeros_like(x), 1e-9
    for k in np.ndindex(*x.shape):
        moved = np.zeros_like(x)
        moved[k] = step
        expected[k] = -(energy_J(body, body.center_m, x + moved) - energy_J(body, body.center_m, x - moved)) / (2 * step)
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7])
    for name, place, wanted in (("as it is", x, expected), ("turned", turn.apply(x), turn.apply(expected))):
        with_it, _ = forces(tmp_path / f"{name} with", body, place, kernel, dilatation=ELASTIC)
        without, _ = forces(tmp_path / f"{name} without", body, place, kernel)
        assert np.abs(with_it - without - wanted).max() < 1e-7 * np.abs(wanted).max()


def test_one_bond_alone_stretches_as_a_stiffer_bar(tmp_path):
    """Both ends dilate by 3 times its strain: E + 3 kappa takes the place of E along it, and nothing else changes."""
    body = chain(2)
    stretched = body.center_m * [1.001, 1, 1]
    force, _ = forces(tmp_path / "run", body, stretched, dilatation=ELASTIC)
    assert force[1] == pytest.approx([-(E + 3 * KAPPA) * AREA * 1e-3, 0, 0], rel=1e-9)


def test_a_swollen_body_has_one_stress_in_all_bonds():
    """theta is 3 times a uniform strain at every sub-sphere, surface or not: the energy is 9/2 kappa (sum of W/6) e^2,
    and a turn has none."""
    packing = pack_sphere(1.0, 60, seed=1)
    bonds = bond_network(packing)
    volumes, theta = dilatations(60, bonds)
    motion = np.zeros((60, 6))
    motion[:, :3] = 1e-3 * packing.center_m
    assert theta @ motion.ravel() == pytest.approx(np.full(60, 3e-3), rel=1e-12)
    added = stiffness_matrix(60, bonds, 1.0, 2.0, 0.3) - stiffness_matrix(60, bonds, 1.0, 2.0)
    assert 0.5 * motion.ravel() @ added @ motion.ravel() == pytest.approx(0.5 * 0.3 * volumes.sum() * 9e-6, rel=1e-9)
    motion[:, :3] = np.cross([0.3, -0.2, 0.5], packing.center_m)
    assert np.abs(theta @ motion.ravel()).max() < 1e-12


@pytest.mark.slow
def test_nu_rises_and_the_shear_modulus_stays():
    """The term feels the volume alone, up to the disorder of the packing: G is that of the network without it."""
    packing = pack_sphere(1.0, 500, seed=20011)
    bonds = bond_network(packing)
    soft, stiff = (network_stiffness(packing, bonds, 1.0, 4.0, kappa) for kappa in (0.0, 0.3))
    shear = [s.youngs_modulus_Pa.mean() / (2 * (1 + s.poisson_ratio[0])) for s in (soft, stiff)]
    assert soft.poisson_ratio[0] == pytest.approx(0.18, abs=0.01)
    assert 0.27 < stiff.poisson_ratio[0] < 0.32
    assert shear[1] == pytest.approx(shear[0], rel=0.05)


def impact_energy_J(directory):
    start = frames(directory)
    return 0.5 * (start.mass[0][:, None] * start.v[0] ** 2).sum()


def test_energy_is_kept_without_damping(tmp_path):
    strike(tmp_path, tension=1e30, damping=0.0, dilatation=ELASTIC)
    rows = ledger(tmp_path).column
    lost = -rows["bond_work_J"][-1, 0] - rows["bond_elastic_J"][-1, 0]
    assert abs(lost) < 1e-3 * impact_energy_J(tmp_path)


def test_events_keep_the_energy_that_the_dilatation_loses(tmp_path):
    """Without dampers the work that the bonds took is in them or was in those that broke."""
    strike(tmp_path, tension=1e6, damping=0.0, elastic=True, steps=4000, dilatation=(KAPPA, 2.0, 2.5e5))
    rows = ledger(tmp_path).column
    events = (tmp_path / "events.csv").read_text().splitlines()
    released = sum(float(line.split(",")[-2]) for line in events[1:])
    assert len(events) > 50
    lost = -rows["bond_work_J"][-1, 0] - rows["bond_elastic_J"][-1, 0]
    assert lost == pytest.approx(released, abs=1e-3 * impact_energy_J(tmp_path))


@pytest.mark.parametrize("kernel", ["sse2", "avx2", "avx512"])
def test_packed_kernels_agree_with_the_naive_twin(tmp_path, kernel):
    results = []
    for name in ("plain", kernel):
        here = tmp_path / name
        here.mkdir()
        try:
            strike(here, name, steps=1000, dilatation=(KAPPA, 2.0, 5e5))
        except AssertionError as error:
            if "this processor has no kernel" in str(error):
                pytest.skip(f"no {kernel} on this processor")
            raise
        events = (here / "events.csv").read_text().splitlines()[1:]
        results.append((frames(here).x[-1], sorted(line.split(",")[:2] for line in events)))
    assert len(results[0][1]) > 10
    assert results[0][1] == results[1][1]
    assert np.abs(results[0][0] - results[1][0]).max() < 1e-12


@pytest.mark.slow
def test_two_ranks_give_what_one_gives(tmp_path):
    runs = []
    for ranks in (1, 2):
        here = tmp_path / str(ranks)
        here.mkdir()
        strike(here, ranks=ranks, dilatation=(KAPPA, 2.0, 5e5))
        runs.append(frames(here))
    assert np.abs(runs[0].x[-1] - runs[1].x[-1]).max() < 1e-10


@pytest.mark.parametrize("pressure, gained", [(1e5, 0.0), (1e6, 2.0 * (1e6 - 2e5))])
def test_a_bond_under_pressure_breaks_at_a_higher_tension(tmp_path, pressure, gained):
    """A bond alone, squeezed to the mean pressure (E/3 + kappa) theta and then bent: its bending stress must make up
    for its own compression and reach strength + alpha (p - p0)."""
    strength, alpha, threshold, steps = 1e6, 2.0, 2e5, 2000
    strain = pressure / (3 * (E / 3 + KAPPA))
    critical = (strength + gained + (E + 3 * KAPPA) * strain) * LENGTH / (E * RADIUS)
    found = load_one_bond(tmp_path, 5, 2 * critical, strain, tension=strength, shear=1e30,
                          dilatation=(KAPPA, alpha, threshold))
    assert [event["mode"] for event in found] == ["tension"]
    assert float(found[0]["step"]) == pytest.approx(steps / 2, abs=3)


def test_the_stable_step_is_that_of_the_network(tmp_path):
    """That of the leapfrog scheme, 2 over the highest frequency of the stiffness matrix."""
    body = fcc_ball(4)
    bonds = Bonds(body.pair[:, 0], body.pair[:, 1], body.center_m[body.pair[:, 1]] - body.center_m[body.pair[:, 0]],
                  body.bond_radius_m)
    ratio, kappa = 4.0, 2 * E  # so large that it sets the limit
    limit = 2 / highest_frequency_rad_s(bonds, E, ratio, body.mass_kg, body.radius_m, kappa / E)
    assert limit < 0.85 * 2 / highest_frequency_rad_s(bonds, E, ratio, body.mass_kg, body.radius_m)
    # Above, energy grows by a factor of e^0.57 a step: more steps would leave no number.
    for share, steps, holds in ((0.99, 2000, True), (1.01, 60, False)):
        assert holds == trembles_on(tmp_path / str(share), body, share * limit, ratio, steps,
                                    dilatation=(kappa, 0.0, 0.0))
