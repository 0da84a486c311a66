"""Processes that need the same stones share the work."""

import threading
from pathlib import Path

import numpy as np
import pytest

from common.files import cache
from common.files.cache import key_of
from common.resources import resource
from common.scene.scene import changed_scene
from dem.stones import assembly, packing
from dem.stones.arrangement import stones_of
from dem.stones.packing import SphereContainer

SCENE = resource("scenes") / "small.toml"


@pytest.fixture
def scene():
    return changed_scene(SCENE, {"stones.gangue_ratio": 0.5})


def key_of_stone(scene, stone):
    count = scene.stones.agglomerate.subspheres
    return key_of(Path(packing.__file__), SphereContainer(packing.REFERENCE_RADIUS_m), count, stone.seed)


def test_a_stone_that_another_process_packs_comes_last(tmp_path, monkeypatch, scene):
    """Locks belong to an open file, so this process may stand for two. The stone is free once all else is done."""
    stones = stones_of(scene, "scene")
    first, second = stones
    monkeypatch.setattr(cache, "LOCKS", 2**64)  # so that the two stones do not share one
    other = cache._locked(tmp_path, "packing", key_of_stone(scene, first))
    done, stone_parts = [], assembly.stone_parts

    def recorded(scene, stone, cache_dir):
        parts = stone_parts(scene, stone, cache_dir)
        done.append(stones.index(stone))
        if stone is second:
            other.__exit__(None, None, None)
        return parts

    monkeypatch.setattr(assembly, "stone_parts", recorded)
    other.__enter__()
    both = assembly.assemble(scene, stones, tmp_path, lambda: done.append("meanwhile"))
    assert done == ["meanwhile", 1, 0]
    monkeypatch.undo()
    alone = assembly.assemble(scene, stones)
    assert np.array_equal(both.center_m, alone.center_m) and np.array_equal(both.bond_vector_m, alone.bond_vector_m)


def test_two_at_once_pack_each_stone_once(tmp_path, monkeypatch, scene):
    stones = stones_of(scene, "scene")
    packed, pack_sphere = [], packing.pack_sphere

    def recorded(radius_m, count, seed):
        packed.append(seed)
        return pack_sphere(radius_m, count, seed)

    monkeypatch.setattr(packing, "pack_sphere", recorded)
    found = []
    workers = [threading.Thread(target=lambda: found.append(assembly.assemble(scene, stones, tmp_path)))
               for _ in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert sorted(packed) == sorted(stone.seed for stone in stones)
    assert np.array_equal(found[0].center_m, found[1].center_m)
