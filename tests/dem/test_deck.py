"""The deck holds what the scene needs and nothing else."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from scenes_of_tests import changed

from common.scene.plate import FlexiblePlate
from dem.deck.render import render
from dem.deck.time_step import TimeStep, step_limits, time_step
from dem.run.participants import PlateRecorder
from dem.stones.arrangement import stones_of
from dem.stones.assembly import assemble
from plate_fem.modes import plate_modes

# What each part looks like in a deck.
PARTS = {
    "bonds": r"^fix bonds .*bond/parallel",
    "bond damping": r"damping_time",
    "dilatation": r"^ +dilatation ",
    "friction": r"coefficientFriction",
    "friction history": r"tangential history",
    "rolling": r"rolling",
    "gravity": r"^fix gravity ",
    "coupling": r"to_plate|shapes\.bin",
    "pictures": r"^fix pictures ",
    "plasticity": r"yield_pressure",
    "free flight": r"^fix free_flight ",
    "weak contact": r" weak_contact ",
}
# Those of a volley, "single" by its base; decks of other ways are run in test_falling_scenes.py.
NAMES = ["elastic_plate", "hertz_coal", "hertz_gangue", "paper", "single", "small"]


def deck_of(scene):
    assembly = assemble(scene, stones_of(scene, "scene"))
    step = time_step(scene, step_limits(scene, assembly, "scene"), "scene", 0.1 if isinstance(scene.plate, FlexiblePlate) else None)
    text = render(scene, assembly, step)
    return {part for part, pattern in PARTS.items() if re.search(pattern, text, re.MULTILINE)}, text


def needed(scene):
    """By the scene's words alone. A single stone that holds together touches nothing but the plate."""
    table = scene.stones.agglomerate
    alone = scene.stones.count == 1 and (table is None or table.unbreakable)
    rubs = any(c.friction > 0 for pair, c in scene.contacts.items() if pair.endswith("_plate") or not alone)
    return {part for part, wanted in {
        "bonds": table is not None,
        "bond damping": table is not None and table.damping_ratio > 0,
        "dilatation": table is not None and any(
            bond.volumetric_ratio > 0 or bond.pressure_strengthening > 0 for bond in (scene.materials[name].bond for name in ("coal", "gangue"))),
        "friction": rubs,
        "friction history": rubs,
        "gravity": scene.time.gravity_m_s2 > 0,
        "coupling": isinstance(scene.plate, FlexiblePlate),
        "pictures": scene.time.view_interval_s is not None,
        "plasticity": scene.plate.yield_stress_Pa is not None,
        "free flight": scene.time.free_flight_tolerance > 0,
        "weak contact": isinstance(scene.plate, FlexiblePlate) and table is not None and scene.time.co_step is None,
    }.items() if wanted}


def small(name, changes=()):
    scene = changed(name, {})
    few = {"stones.agglomerate.subspheres": 12, "stones.agglomerate.contact": "sub_spheres"}
    few = few if scene.stones.agglomerate else {}
    return changed(name, few | dict(changes))


@pytest.mark.parametrize("name", NAMES)
def test_each_scene_gets_its_parts_and_no_other(name):
    scene = small(name)
    assert deck_of(scene)[0] == needed(scene)


SMOOTH = {f"contacts.{pair}": {"restitution": 0.5, "friction": 0.0}
          for pair in ("coal_plate", "gangue_plate", "coal_coal", "coal_gangue", "gangue_gangue")}
RIGID = {"plate": {"size_m": [0.5, 0.5], "density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11,
                   "poisson_ratio": 0.3}}
OMISSIONS = {
    # whole spheres press too little to yield, and a rigid plate does not yield at all
    "bonds": ({"stones.agglomerate": None}, {"bonds", "bond damping", "dilatation", "weak contact", "plasticity"}),
    "dilatation": ({f"materials.{name}.bond.{key}": None for name in ("coal", "gangue") for key in (
        "volumetric_ratio", "pressure_strengthening")}, {"dilatation"}),
    "damping": ({"stones.agglomerate.damping_ratio": 0.0}, {"bond damping"}),
    "friction": (SMOOTH, {"friction", "friction history"}),
    "gravity": ({"time.gravity_m_s2": None}, {"gravity"}),
    "plate": (RIGID, {"coupling", "weak contact", "plasticity"}),
    "plasticity": ({"plate.yield_stress_Pa": None}, {"plasticity"}),
    "free flight": ({"time.free_flight_tolerance": 0.0}, {"free flight"}),
    "co-step of its own": ({"time.co_step": 1}, {"weak contact"}),
    "pictures": ({"time.view_interval_s": None}, {"pictures"}),
}


WHOLE = {"plate.yield_stress_Pa": 8e8, "materials.coal.bond.volumetric_ratio": 0.3}


@pytest.fixture(scope="module")
def whole():
    return deck_of(small("paper", WHOLE))[0]


@pytest.mark.parametrize("omission", OMISSIONS)
def test_what_the_scene_leaves_out_the_deck_leaves_out(omission, whole):
    changes, gone = OMISSIONS[omission]
    assert whole == set(PARTS) - {"rolling"}
    assert whole - deck_of(small("paper", WHOLE | changes))[0] == gone


def test_a_plate_without_rods_has_none_in_its_modes_and_signals():
    held = {"plate.mesh_size_m": 0.1, "plate.max_frequency_Hz": 2000.0}
    for changes, rods in ((held, 4), (held | {"plate.rods": None, "plate.edges": "simply_supported"}, 0)):
        scene = small("paper", changes)
        modes = plate_modes(scene.plate)
        step = SimpleNamespace(sample_steps=1, fast_steps=1, co_step=10, dt_s=1e-6)
        recorder = PlateRecorder(scene, modes, step, None, None)
        assert len(modes.rod_force) == sum(column.startswith("rod_") for column in recorder.columns) == rods


def test_a_recorder_goes_on_whatever_waits():
    """No row, some, or as many as but one that make a block wait for it at a checkpoint; a whole block has been computed."""
    scene = small("paper", {"plate.mesh_size_m": 0.1, "plate.max_frequency_Hz": 500.0})
    modes = plate_modes(scene.plate)
    step = TimeStep(dt_s=1e-6, limits_s={}, bond_time_s=None, co_step=10, fast_steps=10, sample_steps=10, steps=3000)

    def recorder():
        return PlateRecorder(scene, modes, step, None, lambda *_: None)

    def add(to, rows):
        to(range(10 * rows[0], 10 * rows[-1] + 1, 10), states[list(rows)], states[7, 0], states[8, 0])

    states = np.random.default_rng(1).normal(size=(300, 2, len(modes.frequency_Hz)))
    for kept in (0, 1, PlateRecorder.BLOCK - 1, PlateRecorder.BLOCK, PlateRecorder.BLOCK + 1):
        whole, first, second = recorder(), recorder(), recorder()
        for one in (whole, first):
            add(one, range(kept)) if kept else None
        second.set_state(first.get_state())
        for one in (whole, second):
            add(one, range(kept, 300))
        for name, values in whole.signals().items():
            assert np.array_equal(second.signals()[name], values), (kept, name)


def test_contacts_that_cannot_happen_ask_for_nothing():
    smooth_plate = {f"contacts.{name}_plate.friction": 0.0 for name in ("coal", "gangue")}
    one = {"stones.agglomerate.unbreakable": True} | smooth_plate
    assert "friction history" not in deck_of(small("single", one))[0]
    assert "friction history" in deck_of(small("single", smooth_plate))[0]


def test_materials_that_are_not_there_are_not_in_the_deck():
    text = deck_of(small("paper", {"stones.gangue_ratio": 0.0}))[1]
    assert "gangue" not in text
