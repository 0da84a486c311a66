"""Stones that come and go: each as if it were alone, nothing lost, and a run that is taken up in the middle."""

import re

import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import changed
from test_checkpoint_engine import engine, stopped_at_next

from common.tables import InputError
from dem.deck.render import write_deck
from dem.deck.time_step import fast_per_sample
from dem.run.energy_balance import PlateEnergy, energy_ledger, read_ledger, stone_energies
from dem.run.prepare import prepare
from dem.run.results import read_forces
from dem.stones.stone import Flying

GRAVITY = 9.8
SPEED = 0.5
CHECKPOINTS = 10
APEX_s = SPEED / GRAVITY
PLATE = {"size_m": [0.5, 0.5], "density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11,
         "poisson_ratio": 0.3}
FALLS_OFF = {"place_m": [0.24, 0.0], "velocity_m_s": (1.0, 0.1, -SPEED)}


def scene_of(each, duration_s, **changes):
    """Stones of one size one by one on a rigid plate."""
    one = {"material": "coal", "radius_m": 0.01}
    old = ("count", "radius_m", "positions_m", "speed_m_s", "gangue_order", "gangue_ratio")
    return changed("single", {
        **{f"stones.{key}": None for key in old}, "stones.each": [one | stone for stone in each], "plate": PLATE,
        "stones.agglomerate": {"subspheres": 60, "contact": "sub_spheres", "unbreakable": True},
        "time.duration_s": duration_s, "time.view_interval_s": None, "assumptions": None, **changes})


def written(directory, scene):
    """The deck of a scene, and what `prepare` made."""
    model = prepare(scene, "stream", None)
    write_deck(directory, scene, model.assembly, model.step, None)
    return model


def set_checkpoints(directory, every):
    """DEM steps between two steps that allow a checkpoint."""
    deck, times = re.subn(r"checkpoint every \d+", f"checkpoint every {every}", (directory / "deck.liggghts").read_text())
    assert times == 1
    (directory / "deck.liggghts").write_text(deck)


def engine_run(directory, scene, checkpoints=None):
    """The engine alone, with a rigid plate, and with so many steps that allow a checkpoint."""
    model = written(directory, scene)
    if checkpoints:
        set_checkpoints(directory, model.step.steps // checkpoints)
    process = engine(directory, 1)
    output = process.communicate(timeout=300)[0]
    assert process.returncode == 0, output[-1500:]
    return model


def pushes_of(directory, stone):
    """Steps and mean pushes of the rows of one stone."""
    pushes = read_forces(directory / "forces.bin")
    own = pushes.stone == stone
    return pushes.step[own], pushes.mean_N[own], pushes.largest_N[own]


@pytest.mark.slow
def test_a_stone_of_a_stream_pushes_as_alone_and_as_at_the_start(tmp_path):
    """The same stone at three times, once while another one bounces: the same pushes, shifted in time."""
    sample_s, at = 1.5e-4, {"place_m": [0.1, 0.0], "velocity_m_s": SPEED}
    other = {"place_m": [-0.1, 0.1], "velocity_m_s": SPEED}
    found = []
    for name, later, others in (("start", 0, []), ("alone", 40, []), ("with", 40, [other, other | {"place_m": [-0.1, -0.1], "arrival_s": 0.02}])):
        each = [at | {"arrival_s": APEX_s + later * sample_s}, *others]
        model = engine_run(tmp_path / name, scene_of(each, 0.0585 + later * sample_s))
        step, mean, largest = pushes_of(tmp_path / name, 0)
        assert len(step) > 20 and (tmp_path / name / "stones.bin").exists() == bool(later)
        found.append((step - later * model.step.sample_steps, mean, largest))
    for step, mean, largest in found[1:]:
        assert np.array_equal(step, found[0][0])
        assert np.abs(mean - found[0][1]).max() < 1e-6 * found[0][1].max()
        assert largest.max() == pytest.approx(found[0][2].max(), rel=1e-7)


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """Two stones fall off the plate, one breaks on it and one is still to come at the end."""
    directory = tmp_path_factory.mktemp("left") / "deck"
    each = [FALLS_OFF, FALLS_OFF | {"arrival_s": 0.07}, {"place_m": [0.0, 0.0], "velocity_m_s": 6.0},
            {"place_m": [0.1, 0.1], "velocity_m_s": SPEED, "arrival_s": 1.0}]
    scene = scene_of(each, 0.21, **{"stones.agglomerate.unbreakable": False})
    return engine_run(directory, scene, CHECKPOINTS), directory


def test_what_has_left_the_plate_is_taken_out_and_counted(left):
    model, directory = left
    gone = pd.read_csv(directory / "left.csv")
    mass, sizes = model.assembly.stone_mass_kg, model.assembly.sizes
    for stone in (0, 1):
        pieces = gone[gone.agglomerate == stone + 1]
        assert pieces.mass_kg.sum() == pytest.approx(mass[stone], rel=1e-9) and pieces.subspheres.sum() == sizes[stone]
    assert (gone.z_m < 0).all() and (gone.vz_m_s < 0).all()
    near = read_ledger(directory / "ledger.bin", 4).is_near
    assert near[0].tolist() == [True, False, True, False] and near[-1].tolist() == [False, False, True, False]


def test_a_stone_that_rises_from_below_the_plate_has_not_left(tmp_path):
    """It enters beside the plate, 2 cm below its face, rises past the edge and comes down on it."""
    model = written(tmp_path / "deck", scene_of([{"place_m": [0.1, 0.0], "velocity_m_s": SPEED, "arrival_s": 0.07}], 0.24))
    file = tmp_path / "deck" / "stones.bin"
    numbers = np.fromfile(file)
    whole = numbers.view("<i8")
    _, start, count = whole[3 + whole[1]:][:3]
    atoms = numbers[start // 8:][:9 * count].reshape(-1, 9)
    atoms[:, 3:6] += [0.31, 0.0, -0.02] - atoms[:, 3:6].mean(axis=0)
    atoms[:, 6:] = [-1.0, 0.0, 1.0]
    numbers.tofile(file)
    process = engine(tmp_path / "deck", 1)
    output = process.communicate(timeout=300)[0]
    assert process.returncode == 0, output[-1500:]
    assert len(pd.read_csv(tmp_path / "deck" / "left.csv")) == 0
    entered_s = model.assembly.entries[0].entry_s
    step, mean, _ = pushes_of(tmp_path / "deck", 0)
    flight_s = (1 + np.sqrt(1 - 2 * GRAVITY * 0.03)) / GRAVITY
    assert step[0] * model.step.dt_s - entered_s == pytest.approx(flight_s, rel=0.01)


def test_momentum_and_energy_close_with_stones_that_left(left):
    """Impulse of plate and weight over each body's own time; what was taken out is in the ledger as it was then."""
    model, directory = left
    ledger, dt = read_ledger(directory / "ledger.bin", 4), model.step.dt_s
    gone = pd.read_csv(directory / "left.csv")
    entered = ledger.has_entered[-1]
    start, mass = model.assembly.momentum_start_kg_m_s[:, 2], model.assembly.stone_mass_kg
    at_entry = (start - mass * -GRAVITY * np.array([e.entry_s for e in model.assembly.entries]))[entered].sum()
    there = mass[entered].sum() - gone.mass_kg.sum()
    momentum_gone = (gone.mass_kg * gone.vz_m_s).sum()
    now = ledger.column["momentum_z_kg_m_s"][-1].sum() - momentum_gone
    weight = GRAVITY * dt
    at_end = now + there * weight * model.step.steps + momentum_gone + (gone.mass_kg * weight * gone.step).sum()
    pushes = read_forces(directory / "forces.bin")
    impulse = pushes.all_mean_N.sum() * model.step.fast_steps * dt
    assert at_end - at_entry == pytest.approx(impulse, rel=1e-3)
    parts = stone_energies(ledger, GRAVITY, model.assembly.mass_height_kg_m)
    energy = energy_ledger(parts, PlateEnergy(), entered * model.assembly.kinetic_start_J)
    assert abs(energy["closure"]) < 0.01
    assert ledger.column["broken"][-1, 2] > 0


@pytest.mark.parametrize("interval_s", [1.5e-4, 1e-4, 7e-5])
def test_the_fast_stream_of_a_long_run_is_kept_in_bounds(interval_s):
    """Two million rows at most; where so many are a whole number a sample, that number, whatever the round-off."""
    scene = scene_of([FALLS_OFF], 0.1, **{"time.sample_interval_s": interval_s})

    def rows_a_sample(duration_s):
        return fast_per_sample(scene.model_copy(update={"time": scene.time.model_copy(update={"duration_s": duration_s})}))

    assert [rows_a_sample(2e6 / k * interval_s) for k in range(1, 31)] == list(range(1, 31))
    for samples in (66_000, 70_001, 123_456, 1_999_999):
        rows = rows_a_sample(samples * interval_s)
        assert rows * samples <= 2e6 * (1 + 1e-9) and (rows == 30 or (rows + 1) * samples > 2e6 * (1 - 1e-9))


@pytest.mark.parametrize("interval_s, rows", [(1e-5, 30), (1.5e-4, 30), (1e-3, 200), (0.02, 4000)])
def test_the_fast_stream_of_slow_samples_is_as_fast(interval_s, rows):
    """Else contacts of 0.2 ms fall between its rows, and what is above half its rate folds back before the filter."""
    scene = scene_of([FALLS_OFF], 0.1, **{"time.sample_interval_s": interval_s})
    assert fast_per_sample(scene) == rows


STREAMS = ("ledger.bin", "forces.bin", "contacts.bin", "events.csv", "left.csv")


@pytest.mark.slow
def test_a_stream_that_is_taken_up_ten_times_is_the_undisturbed_one(left, tmp_path):
    """Before the second stone enters, while it flies, and when the first has left, too."""
    model, whole = left
    taken_up(tmp_path / "parts", model, whole)


def test_a_stream_is_taken_up_where_nothing_is_left(tmp_path):
    """The first stone has fallen off, the second is still to come."""
    later = {"place_m": [0.1, 0.1], "velocity_m_s": SPEED, "arrival_s": 1.0}
    scene = scene_of([FALLS_OFF, later], 0.21, **{"stones.agglomerate.unbreakable": False})
    model = engine_run(tmp_path / "whole", scene, CHECKPOINTS)
    assert not read_ledger(tmp_path / "whole" / "ledger.bin", 2).is_near[-1].any()
    taken_up(tmp_path / "parts", model, tmp_path / "whole")


def taken_up(parts, model, whole):
    """The run is stopped at each step that allows a checkpoint, and has the same streams in the end."""
    written(parts, model.given)
    every = model.step.steps // CHECKPOINTS
    set_checkpoints(parts, every)
    steps = range(0, model.step.steps, every)
    for step in steps[:-1]:
        code, output, stopped = stopped_at_next(parts, 1, step)
        assert (code, stopped) == (75, step + every), output[-1500:]
    process = engine(parts, 1, steps[-1])
    output = process.communicate(timeout=300)[0]
    assert process.returncode == 0, output[-1500:]
    for name in STREAMS:
        assert (parts / name).read_bytes() == (whole / name).read_bytes(), name


def test_a_stone_waits_where_something_is_in_the_way(tmp_path, monkeypatch):
    """The first one falls through the place where the second enters, which then enters later, and falls from there. The
    third, which is to enter elsewhere meanwhile, does not wait for it. A run taken up in the wait is the undisturbed one."""
    monkeypatch.setattr(Flying, "nearest", lambda *_: (-1, np.inf))  # which would refuse the scene
    speed, first_speed, enters_s = 1.5, 2.5, 0.05
    first_s = (first_speed - np.sqrt(first_speed**2 - speed**2)) / GRAVITY  # from the height of the second to its touch
    at = {"place_m": [0.0, 0.0]}
    model = engine_run(tmp_path / "deck", scene_of([
        at | {"velocity_m_s": first_speed, "arrival_s": enters_s + first_s},
        at | {"velocity_m_s": speed, "arrival_s": enters_s + speed / GRAVITY},
        at | {"place_m": [0.1, 0.0], "velocity_m_s": speed, "arrival_s": enters_s + 2e-3 + speed / GRAVITY}], enters_s + 0.03))
    ledger = read_ledger(tmp_path / "deck" / "ledger.bin", 3)
    row = np.argmax(ledger.is_near[:, 1])
    mass = model.assembly.stone_mass_kg[1]
    fallen_s = -ledger.column["momentum_z_kg_m_s"][row, 1] / (mass * GRAVITY)  # since it entered, at rest
    waited_s = ledger.step[row] * model.step.dt_s - fallen_s - enters_s
    assert 0.008 < waited_s < 0.015 and ledger.is_near[-1].all()  # 20 mm at 2 m/s
    assert ledger.column["waited_steps"][-1] * model.step.dt_s == pytest.approx([0, waited_s, 0], abs=model.step.dt_s)
    mass_height = model.assembly.mass_height_kg_m[1] - mass * GRAVITY * fallen_s**2 / 2
    assert ledger.column["mass_height_kg_m"][row, 1] == pytest.approx(mass_height, rel=1e-9)
    assert ledger.column["pair_work_J"][row, 1] == 0
    third = np.argmax(ledger.is_near[:, 2])
    assert 0 <= ledger.step[third] * model.step.dt_s - enters_s - 2e-3 < 1.5 * model.step.sample_steps * model.step.dt_s
    in_wait = int((enters_s + 0.5 * waited_s) / model.step.dt_s / model.step.sample_steps) * model.step.sample_steps
    parts = tmp_path / "parts"
    written(parts, model.given)
    set_checkpoints(parts, in_wait)
    code, output, stopped = stopped_at_next(parts, 1)
    assert (code, stopped) == (75, in_wait), output[-1500:]
    assert engine(parts, 1, in_wait).wait(timeout=300) == 0
    for name in STREAMS:
        assert (parts / name).read_bytes() == (tmp_path / "deck" / name).read_bytes(), name


@pytest.mark.parametrize("key, value", [("ranks", 2), ("time.free_flight_tolerance", 0.0)])
def test_a_stream_without_bodies_in_free_flight_is_refused(key, value):
    scene = scene_of([FALLS_OFF, FALLS_OFF | {"arrival_s": 1.0}], 0.01, **{key: value})
    with pytest.raises(InputError, match=f"{key} = {value:g}: must be .* as stone 2 does"):
        prepare(scene, "scene", None)


@pytest.mark.slow
def test_more_sub_spheres_come_in_than_liggghts_makes_room_for_at_once(tmp_path):
    """Its list of equal tags grows by a thousand, and is cleared at its new length before it is made longer."""
    each = [{"place_m": [0.05 * (k % 4) - 0.1, 0.05 * (k // 4) - 0.1], "velocity_m_s": SPEED,
             "arrival_s": APEX_s + 1e-3} for k in range(16)]
    model = engine_run(tmp_path / "deck", scene_of(each, 0.02, **{"stones.agglomerate.subspheres": 200}))
    ledger = read_ledger(tmp_path / "deck" / "ledger.bin", 16)
    assert ledger.is_near[-1].all() and model.assembly.n_particles > 3000
    flown_s = ledger.step[-1] * model.step.dt_s - np.array([entry.entry_s for entry in model.assembly.entries])
    assert ledger.column["momentum_z_kg_m_s"][-1] == pytest.approx(
        -model.assembly.stone_mass_kg * GRAVITY * flown_s, rel=1e-6)


def test_a_stone_may_enter_between_the_ledger_and_the_look_at_its_energies(tmp_path):
    """The ledger is at step 394, the engine looks at its energies at step 400, and a stone comes in at step 396."""
    sample_s, sample_steps, every = 4.2e-5, 210, 197
    dt = sample_s / sample_steps
    at = {"place_m": [0.1, 0.0], "velocity_m_s": SPEED}
    scene = scene_of([at | {"arrival_s": 1e-3}, at | {"place_m": [0.1, 0.1], "arrival_s": APEX_s + 396.5 * dt}], 4 * sample_s, **{
        "time.time_step_s": dt, "time.sample_interval_s": sample_s})
    model = written(tmp_path / "deck", scene)
    assert model.step.sample_steps == sample_steps
    deck = (tmp_path / "deck" / "deck.liggghts").read_text()
    odd = deck.replace(f"agglomerates.txt every {sample_steps} file", f"agglomerates.txt every {every} file")
    assert odd != deck
    (tmp_path / "deck" / "deck.liggghts").write_text(odd)
    process = engine(tmp_path / "deck", 1)
    output = process.communicate(timeout=300)[0]
    assert process.returncode == 0, output[-1500:]
    ledger = read_ledger(tmp_path / "deck" / "ledger.bin", 2)
    near = dict(zip(ledger.step.tolist(), ledger.is_near[:, 1].tolist(), strict=True))
    assert not near[2 * every] and near[3 * every]


def test_small_fragments_are_taken_out_as_they_fly_and_nothing_is_lost(tmp_path):
    stream = {"rate_1_s": 100.0, "arrival_s": [0.0, 0.03], "size_m": 0.02, "speed_m_s": 3.0, "least_fragment": 5}
    old = ("count", "radius_m", "positions_m", "speed_m_s", "gangue_order")
    scene = changed("single", {
        **{f"stones.{key}": None for key in old}, "stones.drawn": stream, "stones.gangue_ratio": 0.0, "plate": PLATE,
        "stones.agglomerate": {"subspheres": 60, "contact": "sub_spheres"}, "time.view_interval_s": None, "assumptions": None,
        "time.duration_s": 0.05})
    model = engine_run(tmp_path / "deck", scene)
    gone = pd.read_csv(tmp_path / "deck" / "left.csv")
    assert len(gone) > 3 and (gone.z_m > 0).any() and (gone.subspheres[gone.z_m > 0] < 5).all()
    ledger = read_ledger(tmp_path / "deck" / "ledger.bin", 3)
    assert ledger.has_entered[-1].all() and (ledger.column["broken"][-1] > 0).any()
    parts = stone_energies(ledger, GRAVITY, model.assembly.mass_height_kg_m)
    energy = energy_ledger(parts, PlateEnergy(), model.assembly.kinetic_start_J)
    assert abs(energy["closure"]) < 2e-3
