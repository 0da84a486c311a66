"""Packings and surfaces from the library are those that are found, bit by bit."""

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_tests import SCENES

from common.scene.scene import read_scene
from dem.stones import contact_patch, packing as packings
from dem.stones.bonds import bond_network
from dem.stones.contact_patch import stone_surface, surface_of
from dem.stones.packing import SphereContainer, pack_sphere, packed


def test_a_packing_from_the_library_is_the_packing(tmp_path, monkeypatch):
    expected = pack_sphere(0.025, 60, 7)
    first = packed(None, 60, 7, tmp_path)
    monkeypatch.setattr(packings, "pack_sphere", lambda *_: pytest.fail("packed again"))
    second = packed(None, 60, 7, tmp_path)
    for packing in (first, second):
        assert packing.center_m.tobytes() == expected.center_m.tobytes()
        assert packing.radius_m.tobytes() == expected.radius_m.tobytes()
        assert packing.container == expected.container


def test_another_number_or_seed_is_another_packing(tmp_path):
    packings = [packed(None, *key, tmp_path) for key in ((20, 7), (21, 7), (20, 8))]
    assert len({packing.center_m.tobytes() for packing in packings}) == 3


def test_a_surface_from_the_library_is_the_surface(tmp_path, monkeypatch):
    packing = pack_sphere(0.025, 200, 7)
    bonds, scene = bond_network(packing), read_scene(SCENES / "paper.toml")
    expected = stone_surface(packing, bonds, scene.materials["coal"].bond)
    surface_of(packing, bonds, scene.materials["coal"].bond, tmp_path)
    other = surface_of(packing, bonds, scene.materials["gangue"].bond, tmp_path)
    monkeypatch.setattr(contact_patch, "stone_surface", lambda *_: pytest.fail("found again"))
    kept = surface_of(packing, bonds, scene.materials["coal"].bond, tmp_path)
    assert np.array_equal(kept.compliance_m_N, expected.compliance_m_N)
    assert np.all(kept.compliance_m_N != other.compliance_m_N)
    assert np.array_equal(kept.is_surface, expected.is_surface)


def test_a_surface_of_another_container_is_another_surface(tmp_path):
    """The same sub-spheres in a larger sphere: fewer of them reach its surface."""
    packing = pack_sphere(0.025, 200, 7)
    larger = replace(packing, container=SphereContainer(0.0255))
    bonds, bond = bond_network(packing), read_scene(SCENES / "paper.toml").materials["coal"].bond
    surface_of(packing, bonds, bond, tmp_path)
    kept, expected = surface_of(larger, bonds, bond, tmp_path), stone_surface(larger, bonds, bond)
    assert np.array_equal(kept.compliance_m_N, expected.compliance_m_N)
    assert len(list(tmp_path.glob("surface-*.cache"))) == 2
