"""Force records of a run of the engine: the plate's model, pushed by the stones' forces, gives the record."""

import shutil

import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import changed

from analysis import RecordError, as_record, read_run
from analysis.signals.resampling import resample
from analysis.theory.real_plate import modes_of
from dem.run.run import run_scene
from recognition.estimation.window import channels_of
from recognition.physics.arrangement_method import DURATION_S, ArrangementLikelihood
from recognition.physics.force_records import force_record_of


def a_run(directory, **changes):
    sensors = [{"name": "west", "place_m": [-0.15, 0.05]}, {"name": "east", "place_m": [0.18, -0.03]}]
    run_scene(changed("small", {"time.duration_s": 0.0045, "plate.sensors": sensors} | changes), "small", directory)
    return directory


@pytest.fixture(scope="module")
def directory(runs):
    return a_run(runs / "force_record")


def test_the_plates_model_gives_the_record_of_a_run(directory):
    run = read_run(directory)
    forces = force_record_of(run, DURATION_S)
    rows = forces.force_N.shape[1]
    recorded = channels_of(run.fast.iloc[:rows], rods=True)
    left = np.sqrt(np.mean((forces.modelled - recorded) ** 2, axis=1) / np.mean(recorded**2, axis=1))
    # The force acts where sub-spheres touch, not in the middle of a stone's place: accelerometers feel that most.
    assert left[0] < 0.01 and left[1:3].max() < 0.1 and left[3:].max() < 0.02
    assert forces.force_N.sum() * forces.step_s == pytest.approx(run.info["impulse_N_s"], rel=0.05)
    assert sorted(forces.gangue) == [False, True] and forces.sample_s == pytest.approx(1.5e-4)


@pytest.mark.parametrize("anti_alias", [False, True])
def test_samples_of_a_run_pass_the_filter_that_its_scene_says(directory, runs, anti_alias):
    """The samples are those that `resample` takes of the fast stream, and the model's are theirs."""
    run = read_run(directory if anti_alias else a_run(runs / "unfiltered", **{"time.anti_alias": False}))
    for name in ("a_m_s2", "acc_west_m_s2", "force_N", "total_J"):
        fast = as_record(run.fast[name].to_numpy(), 30 * run.rate_Hz)
        assert run.signals[name].to_numpy() == pytest.approx(resample(fast, run.rate_Hz, anti_alias=anti_alias).values)
    assert (run.signals["t_s"] == run.fast["t_s"][::30].to_numpy()).all()
    forces = force_record_of(run, 0.0045)
    recorded = channels_of(run.signals, rods=True)[:, :forces.sampled.shape[1]][:, :20]
    left = np.sqrt(np.mean((forces.sampled[:, :20] - recorded) ** 2, axis=1) / np.mean(recorded**2, axis=1))
    assert left[0] < 0.01 and left[1:3].max() < 0.1 and left[3:].max() < 0.02


def test_the_modes_of_a_run_come_from_the_cache_that_its_simulation_filled(directory, monkeypatch):
    monkeypatch.setattr("plate_fem.solution.model.build_model", None)  # which finding them would call
    run = read_run(directory)
    assert modes_of(run).frequency_Hz.size == run.summary.n_modes


def test_runs_without_a_force_record(directory, tmp_path):
    for name in ("run.json", "signals.parquet"):
        shutil.copy(directory / name, tmp_path / name)
    run = read_run(tmp_path)
    longer = pd.DataFrame({name: np.resize(values, 100) for name, values in run.signals.items()})
    longer["t_s"] = np.arange(100) / run.rate_Hz
    assert ArrangementLikelihood().prepare(longer, run).force_record is None
    with pytest.raises(RecordError, match="fast.parquet"):
        force_record_of(run, DURATION_S)
    shutil.copy(directory / "fast.parquet", tmp_path)
    run = read_run(tmp_path)
    del run.info["scene"]["plate"]["thickness_m"]
    with pytest.raises(RecordError, match="needs that of a plate that bends"):
        force_record_of(run, DURATION_S)
