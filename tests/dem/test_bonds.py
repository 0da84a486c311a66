"""Bond networks against brute force."""

import numpy as np
import pytest

from dem.stones.bonds import bond_network, fragments
from dem.stones.packing import Packing, SphereContainer, pack_sphere
from lab.rock.fcc import fcc_sphere

RADIUS = 0.025


@pytest.fixture(scope="module")
def stone():
    return pack_sphere(RADIUS, 500, seed=20011)


def row(gaps, radius=1.0):
    """Sub-spheres on a line with given gaps."""
    x = np.concatenate([[0.0], np.cumsum(2 * radius + np.array(gaps))])
    center = np.column_stack([x - x.mean(), np.zeros((len(x), 2))])
    return Packing(center, np.full(len(x), radius), SphereContainer(x.max()))


def test_network_is_that_of_brute_force(stone):
    bonds = bond_network(stone)
    expected = {(i, j) for i in range(500) for j in range(i + 1, 500)
                if np.linalg.norm(stone.center_m[i] - stone.center_m[j])
                <= 1.2 * (stone.radius_m[i] + stone.radius_m[j])}
    assert set(zip(bonds.first.tolist(), bonds.second.tolist())) == expected
    assert len(bonds) == len(expected)
    assert np.allclose(stone.center_m[bonds.first] + bonds.vector_m, stone.center_m[bonds.second])
    assert np.array_equal(bonds.radius_m, np.minimum(stone.radius_m[bonds.first], stone.radius_m[bonds.second]))


def test_section_of_a_round_beam():
    bonds = bond_network(row([0.0], radius=2e-3))
    assert bonds.area_m2 == pytest.approx(np.pi * 4e-6)
    assert bonds.length_m == pytest.approx(4e-3)


@pytest.mark.parametrize("count", [2, 3, 5, 50, 500, 1000])
def test_every_subsphere_is_held(count):
    bonds = bond_network(pack_sphere(RADIUS, count, seed=20012))
    degree = np.bincount(np.r_[bonds.first, bonds.second], minlength=count)
    assert degree.min() >= min(3, count - 1)
    assert fragments(count, bonds.first, bonds.second, np.ones(len(bonds), dtype=bool)).max() == 0


def test_a_loose_subsphere_gets_its_nearest_neighbours(monkeypatch):
    monkeypatch.setattr("dem.stones.bonds.GAP_TOLERANCE", 1e-6)
    fcc = fcc_sphere(RADIUS)
    r = fcc.radius_m[0]
    outermost = np.argmax(fcc.center_m[:, 0])
    center = fcc.center_m.copy()
    center[outermost] += [0.5 * r, 0.13 * r, 0.07 * r]  # off any symmetry
    moved = Packing(center, fcc.radius_m, fcc.container)
    bonds = bond_network(moved)
    mine = np.where(bonds.first == outermost, bonds.second, bonds.first)[(bonds.first == outermost)
                                                                         | (bonds.second == outermost)]
    distance = np.linalg.norm(center - center[outermost], axis=1)
    assert sorted(mine) == sorted(np.argsort(distance)[1:4])


def test_network_in_pieces_is_refused():
    far = row([0.0, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="2 separate pieces"):
        bond_network(far)


def test_benchmark_agglomerate_has_its_bonds():
    assert len(bond_network(fcc_sphere(RADIUS))) == 5181


def test_fragments_are_those_of_a_naive_flood(stone):
    bonds = bond_network(stone)
    intact = np.random.default_rng(4).uniform(size=len(bonds)) < 0.15
    label = fragments(500, bonds.first, bonds.second, intact)
    naive = np.arange(500)
    changed = True
    while changed:
        before = naive.copy()
        for i, j in zip(bonds.first[intact], bonds.second[intact]):
            naive[i] = naive[j] = min(naive[i], naive[j])
        changed = not np.array_equal(before, naive)
    assert label.min() == 0 and len(set(label)) == label.max() + 1 == len(set(naive))
    assert len(set(zip(label, naive))) == len(set(naive))  # one to one
