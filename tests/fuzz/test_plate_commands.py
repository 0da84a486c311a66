"""Whatever the records of a plate's sensors, its model or its taps hold: an answer, a refusal of what is not explained
(exit code 3), or one line and exit code 2."""

import json
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import strategies as st

from common.files.whole import SEAL, seal
from common.scene.plate import read_plate
from recognition.__main__ import main
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.stream.stones import sliding_ratio
from recognition.tapping.fit import BEYOND, Prior, fit_plate
from recognition.tapping.tapped import learnt
from recognition.tapping.taps import Tap
from tests.fuzz.mutations import HOSTILE, as_toml, fuzz, in_time, many, mutated, outcome

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "scenes" / "small.toml"
RATE_Hz, SAMPLES, TAPPED_UP_TO_Hz = 20_000.0, 800, 1200.0
SENSORS = ["acc_north_m_s2", "acc_west_m_s2", "acc_south_m_s2", "acc_east_m_s2"]
LIMITS = ("--radius", "0.025", "0.025", "--speed", "2", "4")
COLUMNS = ["t_s", "force_N", "rod_1_N", *SENSORS]
TAPS = {"taps": [{"record": "record.parquet", "place_m": [0.1, 0.05]},
                 {"record": "record.parquet", "place_m": [-0.07, 0.11], "unknown_force": True}],
        "prior": {"frequency": 0.03, "damping": 0.5, "gain": 0.03, "place_m": 1.5e-3}}
cells = st.one_of(st.floats(), st.sampled_from([np.nan, np.inf, 1e308, -1e308, 0.0, 5e-324]), st.sampled_from(HOSTILE))


@pytest.fixture(scope="module")
def plate():
    """With few modes; `listen` needs more."""
    return PlateModel.from_scene(SCENE, TAPPED_UP_TO_Hz)


@pytest.fixture(scope="module")
def tapped():
    """As `tap` begins with."""
    return PlateModel.from_scene(SCENE, BEYOND * TAPPED_UP_TO_Hz)


@pytest.fixture(scope="module")
def record(plate):
    """A pulse on the plate after 20 ms of noise."""
    t_s, noise = np.arange(SAMPLES) / RATE_Hz, np.random.default_rng(1)
    force_N = np.zeros(SAMPLES)
    force_N[420:426] = 1000 * np.sin(np.pi * (np.arange(6) + 0.5) / 6)
    values = plate.response(force_N, np.array([[0.1, 0.05]]), RATE_Hz)
    table = pd.DataFrame({"t_s": t_s, "force_N": force_N, "rod_1_N": noise.standard_normal(SAMPLES)})
    for name, row in zip(SENSORS, values, strict=True):
        table[name] = row + 0.1 * noise.standard_normal(SAMPLES)
    return table


@st.composite
def records(draw, record):
    """A record with columns scaled, held, swapped, doubled, renamed or gone, cells replaced, rows left out."""
    table = record.copy()
    for _ in range(draw(st.integers(0, 3))):
        name, how = draw(st.sampled_from(COLUMNS)), draw(st.sampled_from(["scale", "hold", "swap", "cell", "many", "drop", "text"]))
        if name not in table.columns:
            continue
        is_text = not pd.api.types.is_numeric_dtype(table[name])
        if how == "scale" and is_text:
            continue
        if how == "scale":
            table[name] *= draw(st.sampled_from([0.0, -1.0, 1e-300, 1e-12, 0.5, 1e6, 1e200, 1e308]))
        elif how == "hold":
            table[name] = draw(st.floats())
        elif how == "swap":
            table[name] = table[draw(st.sampled_from(sorted(table.columns)))].to_numpy()
        elif how == "drop":
            table = table.rename(columns={name: draw(st.sampled_from([*COLUMNS, *HOSTILE]))}) if draw(st.booleans()) else table.drop(columns=name)
        elif how == "text":
            table[name] = draw(st.sampled_from(HOSTILE))
        else:
            cell, last = draw(cells), len(table) if how == "many" else 1
            if is_text or isinstance(cell, str):
                table[name] = table[name].astype(object)
            at = draw(st.integers(0, len(table) - 1))
            table.loc[table.index[at:at + last], name] = cell
        table = table.loc[:, ~table.columns.duplicated()] if draw(st.booleans()) else table
        if table.columns.duplicated().any():
            break
    if draw(st.integers(0, 4)) == 0:
        table = table.iloc[:draw(st.sampled_from([0, 1, 2, 10, 300, 500]))]
    return table


def written(here, table):
    """As a parquet file, or as text where a column is no number or there are two of a name."""
    try:
        table.to_parquet(here / "record.parquet")
        return here / "record.parquet"
    except Exception:  # noqa: BLE001  what pandas cannot write nobody can hand over
        (here / "record.csv").write_bytes(table.to_csv(index=False).encode(errors="replace"))
        return here / "record.csv"


def refused_or_done(arguments):
    code, every = outcome(main, [str(argument) for argument in arguments])
    errors = [line for line in every.splitlines() if not line.startswith("note: ")]
    assert len(errors) == (code == 2) and code in (0, 2, 3), (arguments, code, every)
    return code


def check_listened(table, plate):
    """By `check` and `listen`, to the end."""
    here = Path(tempfile.mkdtemp())
    try:
        plate.save(here / "plate.json")
        before = [written(here, table).name, "plate.json"]
        refused_or_done(["check", here / before[0], "--plate", here / "plate.json"])
        code = refused_or_done(["listen", here / before[0], "--plate", here / "plate.json", *LIMITS, "--out", here / "heard"])
        heard = here / "heard"
        assert {p.name for p in here.iterdir()} - {"heard"} == set(before)
        assert heard.exists() == (code == 0) or code == 3  # which may have stones, but no ratio
        if heard.exists():
            ratio = pd.read_parquet(heard / "ratio.parquet").iloc[:, 2:].to_numpy()
            assert (np.isnan(ratio) | (code == 0) & (ratio >= 0) & (ratio <= 1)).all()
    finally:
        shutil.rmtree(here)


def check_read(table, plate):
    """As `check_listened`, up to where the stones are sought, which takes seconds."""
    def not_sought(*_):
        raise RecognitionError("not sought in this test")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("recognition.stream.heard.recognise_stream", not_sought)
        check_listened(table, plate)


def check_tapped(case, record):
    """The records of taps, or their file, are changed."""
    table, taps = case
    here = Path(tempfile.mkdtemp())
    try:
        file = written(here, record if table is None else table)
        if file.suffix == ".csv":
            taps = json.loads(json.dumps(taps, default=str).replace("record.parquet", "record.csv"))
        (here / "taps.toml").write_text(as_toml(taps), encoding="utf-8")
        code = refused_or_done(["tap", SCENE, here / "taps.toml", "--out", here / "plate.json", "--max-frequency", TAPPED_UP_TO_Hz])
        assert (code == 0) == (here / "plate.json").exists() and len(list(here.iterdir())) == 2 + (code == 0)
        if code == 0:
            PlateModel.load(here / "plate.json")  # which refuses what is not finite
    finally:
        shutil.rmtree(here)


def plates(data):
    """Plate models with numbers changed and a hash that fits them, or changed bytes."""
    changed = mutated(data).map(lambda d: json.dumps(sealed(d), default=str).encode())
    raw = json.dumps(data).encode()
    place = st.tuples(st.integers(0, len(raw) - 1), st.integers(0, 255))
    broken = st.tuples(place, st.sampled_from([1.0, 0.5, 0.0])).map(
        lambda c: (raw[:c[0][0]] + bytes([c[0][1]]) + raw[c[0][0] + 1:])[:int(c[1] * len(raw))])
    return changed | changed | changed | broken


def sealed(data):
    try:
        return seal({key: value for key, value in data.items() if key != SEAL})
    except (TypeError, ValueError):
        return data


def check_plate(raw, record):
    here = Path(tempfile.mkdtemp())
    try:
        (here / "plate.json").write_bytes(raw)
        file = written(here, record)
        refused_or_done(["check", file, "--plate", here / "plate.json"])
        assert len(list(here.iterdir())) == 2
    finally:
        shutil.rmtree(here)


def as_data(plate, here):
    plate.save(here / "plate.json")
    return json.loads((here / "plate.json").read_text())


def tap_cases(record):
    return st.tuples(records(record), st.just(TAPS)) | st.tuples(st.none(), mutated(TAPS))


@pytest.mark.slow
def test_the_taps_are_good(record):
    check_tapped((None, TAPS), record)


def test_some_records_of_sensors(record, plate):
    fuzz(lambda table: check_read(table, plate), records(record), 10)


@pytest.mark.parametrize("option, value", [("--step", "1e-12"), ("--step", "nan"), ("--window", "0"), ("--speed", "4 2")])
def test_what_no_stream_can_be_asked_for(record, plate, tmp_path, option, value):
    plate.save(tmp_path / "plate.json")
    file = written(tmp_path, record)
    code, errors = outcome(main, ["listen", str(file), "--plate", str(tmp_path / "plate.json"), *LIMITS, "--out",
                                  str(tmp_path / "heard"), option, *value.split()])
    assert code == 2 and errors.count("\n") == 1 and option in errors and not (tmp_path / "heard").exists()


@pytest.mark.parametrize("scale, samples, checked", [
    (1.0, 300, 3),  # noise alone, of a plate that is known exactly
    (1e-7, 800, 0),  # a hundredth of a microsecond, in which nothing rings
    (1e-24, 800, 2), (1e-300, 800, 2),
])
def test_records_that_show_no_ringing(record, plate, tmp_path, scale, samples, checked):
    plate.save(tmp_path / "plate.json")
    file = written(tmp_path, record.assign(t_s=scale * record["t_s"])[:samples])
    assert refused_or_done(["check", file, "--plate", tmp_path / "plate.json"]) == checked
    assert refused_or_done(["listen", file, "--plate", tmp_path / "plate.json", *LIMITS, "--out", tmp_path / "heard"]) == 2


@pytest.mark.parametrize("interval_s, samples, said", [
    (1 / 2000, 800, "samples a second"),  # a fit up to 1200 Hz needs 2400
    (1 / 20_000, 430, "after the tap"),  # which begins at sample 420
    (1 / 1e6, 800, "after the tap"),
])
def test_taps_that_do_not_hold_the_frequencies_of_the_fit(record, tmp_path, interval_s, samples, said):
    file = written(tmp_path, record.assign(t_s=interval_s * np.arange(SAMPLES))[:samples])
    (tmp_path / "taps.toml").write_text(as_toml(TAPS))
    code, errors = outcome(main, ["tap", str(SCENE), str(tmp_path / "taps.toml"), "--out", str(tmp_path / "plate.json"),
                                  "--max-frequency", str(TAPPED_UP_TO_Hz)])
    assert code == 2 and errors.count("\n") == 1 and str(file) in errors and said in errors, errors
    assert not (tmp_path / "plate.json").exists()


def test_a_tap_of_a_minute_is_refused_before_it_takes_all_memory(tapped):
    fine = replace(tapped, max_frequency_Hz=12_500.0)
    rng = np.random.default_rng(0)
    with pytest.raises(RecognitionError, match="cut it"):
        fit_plate(fine, [Tap(np.zeros(2), rng.standard_normal((4, 60 * 20_000)), 20_000.0)])


@pytest.mark.parametrize("factor", [1 - 1e-9, 1 + 1e-9])
def test_sample_rates_that_differ_by_rounding_are_the_same(tapped, factor):
    """The last frequency of a fit to 400 samples is 1200 Hz itself, which one record had then and the other had not."""
    tap = one_tap(tapped, np.random.default_rng(0), RATE_Hz, 820, 440)
    same, other = (learnt(fit_plate(tapped, [tap, replace(tap, rate_Hz=rate_Hz)])).unexplained
                   for rate_Hz in (RATE_Hz, factor * RATE_Hz))
    np.testing.assert_allclose(other, same, rtol=1e-6)


def test_a_plate_that_nothing_holds_is_tapped():
    """Its three rigid-body modes have no frequency and no damping that could be in doubt."""
    free = PlateModel.from_scene(read_plate(SCENE).model_copy(update={"rods": ()}), BEYOND * TAPPED_UP_TO_Hz)
    found = learnt(fit_plate(free, [one_tap(free, np.random.default_rng(0), RATE_Hz, 1500, 440)]))
    plate, known = found.plate, found.identified
    assert (plate.frequency_Hz[:3] == 0).all() and (plate.damping_sd[:3] == 0).all() and (plate.damping_sd[3:] > 0).all()
    assert known[3:6].all()
    np.testing.assert_allclose(plate.frequency_Hz[known], free.frequency_Hz[known], rtol=5e-3)


def one_tap(plate, rng, rate_Hz, samples, begins, *, known=True, noise=0.1):
    """A pulse of six samples, with noise."""
    force_N = np.zeros(samples + 6)
    force_N[begins:begins + 6] = 1000 * np.sin(np.pi * (np.arange(6) + 0.5) / 6)
    force_N = force_N[:samples]
    values = plate.response(force_N, np.array([[0.1, 0.05]]), rate_Hz)
    values = values + noise * rng.standard_normal(values.shape)
    return Tap(np.array([0.1, 0.05]), values, rate_Hz, force_N if known else None)


def any_tap(plate, rng, rate_Hz):
    """Of any length, moment, size and noise, cut off at some height, or with a force of any size."""
    samples = int(10 ** rng.uniform(1.8, 3.5))
    tap = one_tap(plate, rng, rate_Hz * (1 + rng.choice([0, 0, 1e-12, -1e-9])), samples, rng.integers(0, samples),
                  known=rng.random() < 0.5, noise=10 ** rng.uniform(-20, 4) * rng.integers(0, 2))
    changed, force_N = tap.acceleration, tap.force_N
    if rng.random() < 0.1:
        changed = np.minimum(changed, 10 ** rng.uniform(-3, 2))
    if rng.random() < 0.1:
        changed[rng.integers(len(changed))] = rng.choice([1.0, 1e-9, 1e9])
    if rng.random() < 0.3:
        changed = changed * 10 ** rng.uniform(-25, 25)
    if force_N is not None and rng.random() < 0.2:
        force_N = force_N * 10 ** rng.uniform(-25, 25)
    return replace(tap, acceleration=changed, force_N=force_N)


def check_any_tap(plate, seed):
    """Fitted, with finite results, or refused."""
    rng = np.random.default_rng(seed)
    rate_Hz, prior = 10 ** rng.uniform(3.3, 5), Prior()
    if rng.random() < 0.2:
        prior = prior.model_copy(update={rng.choice(list(Prior.model_fields)): 10 ** rng.uniform(-9, 0)})
    try:
        found = learnt(fit_plate(plate, [any_tap(plate, rng, rate_Hz) for _ in range(rng.integers(1, 4))], prior), prior)
    except RecognitionError as error:
        assert "\n" not in str(error), seed
        return False
    assert np.isfinite(found.unexplained).all(), seed
    return True


def test_a_record_shorter_than_a_step_has_a_table_of_no_numbers():
    stones = pd.DataFrame({"t_s": [0.01], "gangue": [0.5], "mass_kg": [0.1]})
    ratio = sliding_ratio(stones, 1.0, 0.25, 0.04)
    assert len(ratio) == 0 and [kind.kind for kind in ratio.dtypes] == ["f", "i", *6 * "f"]


def test_some_taps(record):
    fuzz(lambda case: check_tapped(case, record), tap_cases(record), 6)


def test_nothing_is_taken_from_a_short_tap(record, tmp_path):
    """In two periods of the mains the plate's own motion passes for hum."""
    record.to_parquet(tmp_path / "record.parquet")
    (tmp_path / "taps.toml").write_text(as_toml(TAPS))
    _, said = outcome(main, ["tap", str(SCENE), str(tmp_path / "taps.toml"), "--out", str(tmp_path / "plate.json"),
                             "--max-frequency", str(TAPPED_UP_TO_Hz)])
    assert said == ""


def test_some_plates(record, plate, tmp_path):
    fuzz(lambda raw: check_plate(raw, record), plates(as_data(plate, tmp_path)), 10)


@pytest.mark.validate
def test_many_records_of_sensors(record, plate):
    fuzz(lambda table: check_read(table, plate), records(record), many("RECORDS", 2000) // 4)


@pytest.mark.validate
def test_many_records_are_listened_to(record):
    plate = PlateModel.from_scene(SCENE, 10_000.0)
    fuzz(lambda table: check_listened(table, plate), records(record), many("RECORDS", 2000) // 100)


@pytest.mark.validate
def test_many_taps(record):
    fuzz(lambda case: check_tapped(case, record), tap_cases(record), many("RECORDS", 2000) // 20)


@pytest.mark.validate
def test_taps_of_any_length_rate_and_moment(tapped):
    outcomes = []
    for seed in range(many("TAPS", 1000)):
        print(f"seed {seed}", flush=True)
        in_time(lambda seed: outcomes.append(check_any_tap(tapped, seed)), seed)
    print(f"{sum(outcomes)} of {len(outcomes)} fitted")
    assert 0 < sum(outcomes) < len(outcomes)


@pytest.mark.validate
def test_many_plates(record, plate, tmp_path):
    fuzz(lambda raw: check_plate(raw, record), plates(as_data(plate, tmp_path)), many("MODELS", 2000) // 4)
