"""A plate learnt by tapping: plates whose modes are known, tapped."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from common.resources import resource
from lab.known_truth.other_plates import scattered
from lab.known_truth.tap_records import hammer_taps
from recognition.__main__ import main
from recognition.plate.plate_model import PlateModel
from recognition.tapping.fit import Fit, Prior, fit_plate
from recognition.tapping.structure import Structure
from recognition.tapping.tapped import learnt
from recognition.tapping.taps import Tap, spectra

SCENE = resource("scenes") / "paper.toml"
PLACES = np.array([[0.11, 0.07], [-0.16, 0.13]])


@pytest.fixture(scope="module")
def start():
    return PlateModel.from_scene(SCENE, 1500.0)


@pytest.fixture(scope="module")
def truth():
    """2 % off in its frequencies, 20 % in its damping, 2 % in its shapes; with modes above those of the fit."""
    return scattered(PlateModel.from_scene(SCENE, 2500.0), 0.02, np.random.default_rng(5))


def errors(found, truth):
    """Errors of frequency and damping (relative) of the modes that are called identified, each over its standard
    deviation as well."""
    k = np.flatnonzero(found.identified)
    nearest = abs(truth.frequency_Hz[:, None] - found.plate.frequency_Hz[k]).argmin(axis=0)
    frequency = found.plate.frequency_Hz[k] / truth.frequency_Hz[nearest] - 1
    damping = np.log(found.plate.damping_ratio[k] / truth.damping_ratio[nearest])
    return frequency, frequency / found.plate.frequency_sd[k], damping


@pytest.mark.parametrize("force_known", [True, False])
def test_modes_are_found(start, truth, force_known):
    rng, loud = np.random.default_rng(7), truth.sensor_shape * [[1.0], [1.08], [1.0], [1.0]]
    taps = hammer_taps(replace(truth, sensor_shape=loud), PLACES, rng, rate_Hz=8e3, force_known=force_known)
    found = learnt(fit_plate(start, taps))
    frequency, over_sd, damping = errors(found, truth)
    shape = np.abs(found.plate.sensor_shape[1, 3:8]) @ np.abs(truth.sensor_shape[1, 3:8])
    assert shape / np.sum(truth.sensor_shape[1, 3:8] ** 2) == pytest.approx(1.08, abs=0.04)  # its gain
    assert found.identified[3:8].all()  # all below 1200 Hz but those of the next line
    assert not found.identified[:3].any()  # sway and yaw, which no tap on the top excites: what was known stays
    assert found.plate.damping_ratio[:3] == pytest.approx(start.damping_ratio[:3], rel=0.05)
    assert abs(frequency).max() < 2e-3 and abs(damping).max() < 0.2
    assert np.sqrt(np.mean(over_sd**2)) < 3
    assert found.unexplained.max() < 0.1


def test_modes_beyond_the_fit_keep_to_the_trend():
    """A plate that is 2 % stiffer: of modes above the fit the taps show flanks alone, which say little of frequencies."""
    start, truth = PlateModel.from_scene(SCENE, 3000.0), PlateModel.from_scene(SCENE, 6000.0)
    truth = replace(truth, frequency_Hz=1.02 * truth.frequency_Hz)
    taps = hammer_taps(truth, PLACES, np.random.default_rng(7), rate_Hz=8e3, place_error_m=1.5e-3)
    found = learnt(fit_plate(start, taps))
    beyond = start.frequency_Hz > found.highest_Hz
    assert beyond.sum() > 5
    assert found.plate.frequency_Hz[beyond] == pytest.approx(truth.frequency_Hz[:beyond.size][beyond], rel=3e-3)


@pytest.mark.slow
def test_frequencies_that_are_off_the_more_the_higher_are_found():
    """As those of another theory of plates: up to 15 % above the start, whose standard deviation is 3 %."""
    start = PlateModel.from_scene(SCENE, 3750.0)
    truth = replace(start, frequency_Hz=start.frequency_Hz * (1 + 0.15 * start.frequency_Hz / 3000))
    taps = hammer_taps(truth, PLACES, np.random.default_rng(7), rate_Hz=8e3)
    found = learnt(fit_plate(start, taps))
    bends = (truth.frequency_Hz > 300) & (truth.frequency_Hz < 2400)  # the fit ends at 3000 Hz
    assert bends.sum() >= 8 and found.identified[bends].all()
    assert abs(found.plate.frequency_Hz / truth.frequency_Hz - 1)[bends].max() < 2e-3


def test_transforms_of_a_tap_have_its_onset_as_the_origin_of_time():
    """There the transform of a single sample is its length in time at all frequencies, and later ones come with a phase."""
    values = np.zeros((2, 2000))
    values[:, 500], values[1, 503] = 8e3, 8e3
    found = spectra(Tap(PLACES[0], values, 8e3), 30.0, 1000.0, 0.01, 1200)
    assert found.acceleration[0] == pytest.approx(np.ones(len(found.s)))
    assert found.acceleration[1] == pytest.approx(1 + np.exp(-found.s * 3 / 8e3))


def test_slopes_are_differences(start):
    """Of every parameter's derivative."""
    rng = np.random.default_rng(3)
    taps = hammer_taps(start, PLACES[:1], rng, rate_Hz=8e3, force_known=False)
    fit = Fit(Structure(start), taps, Prior(), 200.0)
    scale = fit.prior_sd
    state = 0.1 * scale * rng.standard_normal(scale.size)
    value, slope = fit.predicted(state, 0, slopes=True)
    for _ in range(5):
        step = 1e-4 * scale * rng.standard_normal(scale.size)
        change = (fit.predicted(state + step, 0)[0] - fit.predicted(state - step, 0)[0]) / 2
        assert np.linalg.norm(slope @ step - change) < 1e-5 * np.linalg.norm(change)


def write_taps(directory, taps, names):
    lines = []
    for k, tap in enumerate(taps):
        columns = {"t_s": np.arange(tap.acceleration.shape[1]) / tap.rate_Hz, "force_N": tap.force_N}
        columns |= {f"acc_{name}_m_s2": row for name, row in zip(names, tap.acceleration, strict=True)}
        pd.DataFrame(columns).to_csv(directory / f"tap{k}.csv", index=False)
        lines.append(f'[[taps]]\nrecord = "tap{k}.csv"\nplace_m = {list(map(float, tap.place_m))}\n')
    (directory / "taps.toml").write_text("".join(lines))
    return [str(SCENE), str(directory / "taps.toml"), "--out", str(directory / "plate.json"), "--max-frequency", "1200"]


def test_command_writes_the_plate(truth, tmp_path, capsys):
    taps = hammer_taps(truth, PLACES, np.random.default_rng(7), rate_Hz=8e3)
    assert main(["tap", *write_taps(tmp_path, taps, truth.sensor_names)]) == 0
    plate = PlateModel.load(tmp_path / "plate.json")
    assert np.min(abs(plate.frequency_Hz[:, None] / truth.frequency_Hz[3:8] - 1), axis=0).max() < 2e-3
    said = capsys.readouterr().out
    assert "not identified" in said and f"\n{len(PLACES)} taps, {len(PLACES)} with a measured force\n" in said


def test_an_offset_of_a_channel_and_hum_are_taken_away(truth, tmp_path, capsys):
    """As of a sensor that feels its weight: without, nothing of that channel would be explained."""
    taps = hammer_taps(truth, PLACES, np.random.default_rng(7), rate_Hz=8e3)
    assert main(["tap", *write_taps(tmp_path, taps, truth.sensor_names)]) == 0
    told, frequency_Hz = capsys.readouterr(), PlateModel.load(tmp_path / "plate.json").frequency_Hz[3:8]
    assert "taken away" not in told.err
    t_s = np.arange(taps[0].acceleration.shape[1]) / 8e3
    added = np.array([[0.0 * t_s], [9.81 + 0.0 * t_s], [3.0 * np.sin(2 * np.pi * 50 * t_s)], [0.0 * t_s]])[:, 0]
    humming = [replace(tap, acceleration=tap.acceleration + added, force_N=tap.force_N + 40.0) for tap in taps]
    assert main(["tap", *write_taps(tmp_path, humming, truth.sensor_names)]) == 0
    told = capsys.readouterr().err
    assert told.count("west: offset 9.") == 2 and told.count("south: hum at 50 Hz of") == 2
    assert told.count("force_N: offset 40 N") == 2
    np.testing.assert_allclose(PlateModel.load(tmp_path / "plate.json").frequency_Hz[3:8], frequency_Hz, rtol=2e-4)


@pytest.mark.parametrize("change, said", [
    (lambda table: table.assign(acc_west_m_s2=table["acc_west_m_s2"].clip(-20, 20)), "west: clipped: "),
    (lambda table: table.assign(force_N=table["force_N"].rolling(4, min_periods=1).max()), "force_N: clipped: "),
    (lambda table: table.assign(acc_west_m_s2=1e-3 * table["acc_west_m_s2"]), "west: dead"),
    (lambda table: table.assign(force_N=-table["force_N"]), "a place, a sign or a unit"),
])
def test_faults_of_a_tap_are_refused(truth, tmp_path, capsys, change, said):
    words = write_taps(tmp_path, hammer_taps(truth, PLACES[:1], np.random.default_rng(7), rate_Hz=8e3), truth.sensor_names)
    change(pd.read_csv(tmp_path / "tap0.csv")).to_csv(tmp_path / "tap0.csv", index=False)
    assert main(["tap", *words]) == 2
    assert said in capsys.readouterr().err.splitlines()[-1] and not (tmp_path / "plate.json").exists()


@pytest.mark.parametrize("highest_Hz, said", [("40", "no mode of plate and rods lies below it"), ("0", "must be above 0")])
def test_a_frequency_without_modes_is_refused_in_one_line(tmp_path, capsys, highest_Hz, said):
    assert main(["tap", str(SCENE), "taps.toml", "--out", str(tmp_path / "p.json"), "--max-frequency", highest_Hz]) == 2
    assert said in capsys.readouterr().err.splitlines()[-1]


def frequency_responses(plate, place, frequency_Hz):
    """Acceleration upwards at each sensor over a force downwards, as the sum of the modes."""
    w, natural = 2 * np.pi * frequency_Hz[:, None], 2 * np.pi * plate.frequency_Hz
    with np.errstate(invalid="ignore"):
        share = w**2 / (natural**2 - w**2 + 2j * plate.damping_ratio * natural * w)
    share[0] = np.where(natural == 0, -1.0, 0.0)
    return (share * plate.shape(*place[:, None])[0]) @ plate.sensor_shape.T


@pytest.mark.slow
def test_frequency_responses_in_and_modes_out(truth, tmp_path):
    """Those of an analyser, in g over N, teach the plate as taps do, and its modes are read by other programs."""
    pyuff = pytest.importorskip("pyuff")
    frequency_Hz, lines = np.arange(6001) / 1.5, ["unit = 'g'\n"]
    for k, place in enumerate(PLACES):
        for name, response in zip(truth.sensor_names, frequency_responses(truth, place, frequency_Hz).T, strict=True):
            one = pyuff.prepare_58(
                binary=1, func_type=4, rsp_node=1, rsp_dir=3, ref_node=2, ref_dir=-3, data=response / 9.80665,
                x=frequency_Hz, id1=name, rsp_ent_name="N", ref_ent_name="N", abscissa_spacing=1, ord_data_type=6,
                num_pts=6001, abscissa_min=0.0, abscissa_inc=1 / 1.5, ordinate_axis_units_lab="g",
                orddenom_axis_units_lab="N", abscissa_axis_units_lab="Hz", abscissa_spec_data_type=18,
                ordinate_spec_data_type=12, orddenom_spec_data_type=13, z_axis_spec_data_type=0)
            pyuff.UFF(str(tmp_path / f"tap{k}.uff")).write_sets(one, "add")
        lines.append(f"[[taps]]\nrecord = 'tap{k}.uff'\nplace_m = {list(map(float, place))}\n")
    (tmp_path / "taps.toml").write_text("".join(lines))
    words = ["tap", str(SCENE), str(tmp_path / "taps.toml"), "--out", str(tmp_path / "plate.json"),
             "--max-frequency", "1200", "--uff", str(tmp_path / "modes.uff")]
    assert main(words) == 0 and main(words) == 0
    plate = PlateModel.load(tmp_path / "plate.json").without_residual_modes()
    found = abs(plate.frequency_Hz[:, None] / truth.frequency_Hz[3:8] - 1).min(axis=0)
    assert found.max() < 1e-3, found
    nodes, *modes = [one for one in pyuff.UFF(str(tmp_path / "modes.uff")).read_sets() if one["type"] in (15, 55)]
    assert [one["freq"] for one in modes] == pytest.approx(plate.frequency_Hz, rel=1e-5)
    assert [one["modal_damp_vis"] for one in modes] == pytest.approx(plate.damping_ratio, rel=1e-5)
    shapes = np.transpose([one["r3"] for one in modes])
    np.testing.assert_allclose(shapes, plate.shape(nodes["x"], nodes["y"]), atol=1e-4 * abs(shapes).max())


def test_swapped_sensors_are_refused(truth, tmp_path, capsys):
    swapped = [replace(tap, acceleration=tap.acceleration[[1, 0, 2, 3]])
               for tap in hammer_taps(truth, PLACES, np.random.default_rng(7), rate_Hz=8e3)]
    assert main(["tap", *write_taps(tmp_path, swapped, truth.sensor_names)]) == 3
    assert "NOT EXPLAINED" in capsys.readouterr().out
    assert not (tmp_path / "plate.json").exists()


@pytest.mark.parametrize(("old", "new", "said"), [
    ("[0.11,", "[0.31,", "taps.0.place_m: x_m = 0.31"), ("tap0.csv", "none.csv", "none.csv"), ("place_m", "z_m", "z_m")])
def test_bad_files_end_in_one_line(truth, tmp_path, capsys, old, new, said):
    words = write_taps(tmp_path, hammer_taps(truth, PLACES, np.random.default_rng(7), rate_Hz=8e3), truth.sensor_names)
    file = tmp_path / "taps.toml"
    file.write_text(file.read_text().replace(old, new, 1))
    assert main(["tap", *words]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1 and not (tmp_path / "plate.json").exists()
