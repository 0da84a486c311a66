from types import SimpleNamespace

import numpy as np
import pytest

from analysis import RecordError, read_run
from analysis.sweep import breakage
from tests.analysis.synthetic import BROKEN_BONDS, lattice, write_run

CENTRE, FIRST, SECOND = lattice()
PER_STONE = len(FIRST)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return read_run(write_run(tmp_path_factory.mktemp("runs") / "ratio_050", 0.5))


@pytest.fixture(scope="module")
def network(run):
    return breakage.read_network(run)


def test_network_is_that_of_the_deck(network):
    assert network.centre_m.shape == (10 * len(CENTRE), 3)
    assert network.first.size == 10 * PER_STONE
    assert network.bonds_of_each.sum() == 2 * network.first.size
    apart = np.linalg.norm(network.centre_m[network.first] - network.centre_m[network.second], axis=1)
    np.testing.assert_allclose(apart, 0.01, rtol=1e-6)
    assert np.all(network.agglomerate[network.first] == network.agglomerate[network.second])


def test_broken_bonds_until_a_time(run, network):
    assert breakage.broken_bonds(run, network).sum() == len(run.breakage)
    early = breakage.broken_bonds(run, network, 0.01)
    assert early.sum() == sum(BROKEN_BONDS[m] - -(-BROKEN_BONDS[m] // 10) for m in run.materials)
    only_first = np.zeros(10)
    only_first[0] = 1.0
    assert breakage.broken_bonds(run, network, only_first).sum() == BROKEN_BONDS[run.materials[0]]


def naive_fragments(network, broken):
    """Flood filling, sub-sphere by sub-sphere."""
    neighbours = {i: [] for i in range(network.radius_m.size)}
    for a, b, gone in zip(network.first, network.second, broken, strict=True):
        if not gone:
            neighbours[a].append(b)
            neighbours[b].append(a)
    label, count = {}, 0
    for start in neighbours:
        if start in label:
            continue
        stack = [start]
        while stack:
            i = stack.pop()
            if i not in label:
                label[i] = count
                stack += neighbours[i]
        count += 1
    return np.array([label[i] for i in range(len(label))])


def test_fragments_equal_flood_filling(run, network):
    for broken in (
        breakage.broken_bonds(run, network),
        np.random.default_rng(3).random(network.first.size) < 0.7,
        np.zeros(network.first.size, dtype=bool),
    ):
        twin, found = naive_fragments(network, broken), breakage.fragments(network, broken)
        assert len(set(zip(twin, found, strict=True))) == len(set(twin)) == len(set(found))


def test_fragment_shares_are_whole_stones_and_single_spheres(network):
    whole = breakage.fragment_shares(network, np.zeros(network.first.size, dtype=bool))
    assert len(whole) == 10 and all(s.size == 1 and s[0] == pytest.approx(1.0) for s in whole)
    dust = breakage.fragment_shares(network, np.ones(network.first.size, dtype=bool))
    assert all(s.size == len(CENTRE) for s in dust)
    assert all(s.sum() == pytest.approx(1.0) for s in dust)


def test_damage_of_a_sphere_that_lost_two_of_its_bonds(network):
    middle = int(np.argmin(np.linalg.norm(CENTRE, axis=1)))
    own = np.flatnonzero((network.first == middle) | (network.second == middle))
    assert own.size == 6
    broken = np.zeros(network.first.size, dtype=bool)
    broken[own[:2]] = True
    assert breakage.damage(network, broken)[middle] == pytest.approx(2 / 6)
    everything = breakage.damaged_volume_share(network, np.ones_like(broken))
    np.testing.assert_allclose(everything, 1.0)
    np.testing.assert_allclose(breakage.damaged_volume_share(network, np.zeros_like(broken)), 0.0)


def test_areas_and_modes_add_up(run):
    area = breakage.broken_area_m2(run)
    np.testing.assert_allclose(area, [3e-6 * BROKEN_BONDS[m] for m in run.materials])
    over_time = breakage.broken_area_over_time(run, np.array([0.0, 0.01, 0.04]))
    assert np.all(over_time[:, 0] == 0) and np.all(np.diff(over_time, axis=1) >= 0)
    np.testing.assert_allclose(over_time[:, 2], area)
    cracks = breakage.crack_counts(run)
    assert sum(cracks["coal"].values()) == 5 * BROKEN_BONDS["coal"]
    assert sum(sum(c.values()) for c in cracks.values()) == len(run.breakage)


def test_first_collision_is_the_first_pulse(run):
    found = breakage.collisions(run, 1)
    assert len(found) == 2
    assert found[0] == (pytest.approx(1.1e-4, abs=2e-6), pytest.approx(3.3e-4, abs=2e-6))
    np.testing.assert_allclose(breakage.first_collision_end_s(run), 3.3e-4, atol=2e-6)
    for share, hits in ((0.009, 2), (0.011, 3)):  # of its largest force: of a splinter, and of a collision
        force_N = run.fast["force_01_N"].to_numpy(copy=True)
        force_N[3000] = share * force_N.max()
        assert len(breakage.collisions(SimpleNamespace(finest=run.fast.assign(force_01_N=force_N)), 1)) == hits


def test_section_through_the_middle(network):
    found = breakage.section(network, np.zeros(network.radius_m.size), 1)
    in_plane = CENTRE[np.abs(CENTRE[:, 1]) < 1e-9]
    assert len(found.radius_m) == len(in_plane)
    np.testing.assert_allclose(found.radius_m, 0.004875)
    assert found.area_m2 == pytest.approx(len(in_plane) * np.pi * 0.004875**2)
    assert found.broken_area_m2 == 0
    assert breakage.section(network, np.ones(network.radius_m.size), 1).broken_area_m2 == found.area_m2


def test_a_section_beside_the_middle_of_a_sub_sphere_is_a_smaller_disc():
    """Two equal sub-spheres 8 mm apart across the section: it cuts both 4 mm from their centres of 5 mm, in circles of
    3 mm; a small one beside them, which weighs little, is missed."""
    centre = np.array([[0.0, -4e-3, 0.0], [0.0, 4e-3, 0.0], [0.02, 0.04, 0.0]])
    radius, bonds = np.array([5e-3, 5e-3, 0.1e-3]), (np.array([0, 1]), np.array([1, 2]))
    beside = breakage.Network(centre, radius, np.ones(3, int), *bonds)
    found = breakage.section(beside, np.array([0.5, 0.4, 0.0]), 1)
    np.testing.assert_allclose(found.radius_m, 3e-3, rtol=1e-3)
    assert found.area_m2 == pytest.approx(2 * np.pi * 9e-6, rel=1e-3)
    assert found.broken_area_m2 == pytest.approx(np.pi * 9e-6, rel=1e-3)
    # Without its second bond the large one in the middle has lost half of its bonds, and the small one its only one.
    damaged = breakage.damaged_volume_share(beside, np.array([False, True]))
    assert damaged == pytest.approx((0.5 * 5**3 + 0.1**3) / (2 * 5**3 + 0.1**3))


def test_a_run_without_deck_says_so(tmp_path):
    path = write_run(tmp_path / "ratio_000", 0.0)
    (path / "deck" / "bonds.txt").unlink()
    with pytest.raises(RecordError, match="deck") as error:
        breakage.read_network(read_run(path))
    assert "\n" not in str(error.value)
