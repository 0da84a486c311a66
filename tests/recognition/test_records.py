"""Records of sensors in other units, under other names and at other rates are those in m/s^2."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from analysis import RecordError, read_record
from recognition import RecognitionError
from recognition.estimation.window import Window
from recognition.plate.records import at_rate, numbers, read_accelerations, record_table
from recognition.stream.recognise import sensors_of

T_s = np.arange(200) / 8000.0
X = np.sin(2 * np.pi * 100.0 * T_s)
G = 9.80665


@pytest.mark.parametrize("name, scale, unit, factor", [
    ("acc_A_m_s2", 1.0, None, 1.0), ("acc_A_m_s2", 2.0, "m/s^2", 2.0), ("A [g]", 1.0, None, G), ("A (mm/s²)", 3.0, "mm/s^2", 3e-3),
    ("A", 0.1, "g", 0.1 * G), ("acc_A [mV]", 0.01, "g", 0.01 * G), ("acc_A_m_s2", 0.01, "g", 0.01 * G)])
def test_units_and_names(tmp_path, name, scale, unit, factor):
    pd.DataFrame({"Zeit [ms]": 1e3 * T_s, name: X, "force_N": X}).to_csv(tmp_path / "a.csv", index=False)
    table, _ = record_table(tmp_path / "a.csv", scale, unit)
    assert sorted(table) == ["acc_A_m_s2", "force_N", "t_s"]
    np.testing.assert_allclose(table["acc_A_m_s2"], factor * X, rtol=1e-12)
    np.testing.assert_allclose(table["force_N"], X, rtol=1e-12)
    np.testing.assert_allclose(table["t_s"], T_s, rtol=1e-12)


@pytest.mark.parametrize("name, factor", [("Force [kN]", 1e3), ("force (N)", 1.0)])
def test_a_force_has_any_unit(tmp_path, name, factor):
    pd.DataFrame({"t_s": T_s, name: X}).to_csv(tmp_path / "a.csv", index=False)
    np.testing.assert_allclose(record_table(tmp_path / "a.csv", 9.81, "g")[0]["force_N"], factor * X, rtol=1e-12)


def test_a_column_without_a_unit_is_left_alone_and_another_unit_is_refused(tmp_path):
    pd.DataFrame({"t_s": T_s, "A": X}).to_csv(tmp_path / "a.csv", index=False)
    assert list(record_table(tmp_path / "a.csv")[0]) == ["t_s", "A"]
    for wrong in ({"unit": "V"}, {"scale": 0.0}, {"scale": float("nan")}, {"scale": 5.0}):
        with pytest.raises(RecordError, match="must be|scale = 5; needs the unit"):
            record_table(tmp_path / "a.csv", **wrong)


@pytest.mark.parametrize("name", ["A", "A [g]", "acc_A_m_s2"])
def test_text_among_samples_is_refused_and_a_column_of_text_passed_over(tmp_path, name):
    text = [*X[:5].astype(str), "oops", *X[6:].astype(str)]
    pd.DataFrame({"t_s": T_s, name: text, "note": "dry"}).to_csv(tmp_path / "a.csv", index=False)
    table, source = record_table(tmp_path / "a.csv", 2.0, "g")
    with pytest.raises(RecordError, match="acc_A_m_s2: sample 5 is nan; every sample must be finite"):
        numbers(table, "acc_A_m_s2", source)
    table[[]].to_parquet(tmp_path / "none.parquet")
    assert record_table(tmp_path / "none.parquet", 2.0, "g")[0].empty


@pytest.mark.parametrize("kind", ["wav", "tdms", "h5", "lvm"])
def test_any_recorder_gives_the_columns_of_sensors(tmp_path, kind):
    file, unit = tmp_path / f"a.{kind}", None
    if kind == "wav":
        from scipy.io import wavfile

        wavfile.write(file, 8000, np.column_stack([X, -X]))
        unit, names = "g", ["acc_0_m_s2", "acc_1_m_s2"]
    elif kind == "tdms":
        nptdms = pytest.importorskip("nptdms")
        with nptdms.TdmsWriter(file) as writer:
            writer.write_segment([nptdms.ChannelObject("plate", name, sign * X, {"wf_increment": 1 / 8000, "unit_string": "g"})
                                  for name, sign in (("A", 1), ("B", -1))])
    elif kind == "h5":
        with pytest.importorskip("h5py").File(file, "w") as made:
            made.attrs["fs"] = 8000.0
            for name, sign in (("A", 1), ("B", -1)):
                made.create_dataset(f"plate/{name}", data=sign * X).attrs["unit"] = "g"
    else:
        rows = "".join(f"\t{x:.15e}\t{-x:.15e}\n" for x in X)
        file.write_text("LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\n\nChannels\t2\n"
                        f"Y_Unit_Label\tg\tg\nDelta_X\t1.25E-4\t1.25E-4\n***End_of_Header***\n\tA\tB\n{rows}")
    table, _ = record_table(file, unit=unit)
    names = names if kind == "wav" else ["acc_A_m_s2", "acc_B_m_s2"]
    np.testing.assert_allclose(table[names].to_numpy().T, [G * X, -G * X], rtol=1e-12)
    np.testing.assert_allclose(table["t_s"], T_s, rtol=1e-12)


@pytest.mark.parametrize("rate_Hz", [20_000.0, 44_100.0, 51_200.0])
@pytest.mark.parametrize("tone_Hz", [200.0, 3000.0, 5000.0])
def test_another_rate_gives_what_would_have_been_sampled(rate_Hz, tone_Hz):
    """A tone above half the new rate folds back, as in the runs that models are fitted to."""
    t_s = 0.5 + np.arange(round(0.1 * rate_Hz)) / rate_Hz
    table = at_rate(pd.DataFrame({"t_s": t_s, "a_m_s2": np.cos(2 * np.pi * tone_Hz * t_s)}), 20_000 / 3, "x")
    inner = slice(20, -20)
    steps_s = np.diff(table["t_s"])
    assert table["t_s"][0] == 0.5 and steps_s == pytest.approx(1.5e-4, rel=1e-3)
    np.testing.assert_allclose(table["a_m_s2"][inner], np.cos(2 * np.pi * tone_Hz * table["t_s"])[inner], atol=0.02)


def test_behind_a_filter_a_tone_above_half_the_new_rate_is_taken_away():
    t_s = np.arange(2000) / 20_000
    table = at_rate(pd.DataFrame({"t_s": t_s, "a_m_s2": np.cos(2 * np.pi * 5000.0 * t_s)}), 20_000 / 3, "x", anti_alias=True)
    assert abs(table["a_m_s2"][20:-20]).max() < 0.01


def test_a_model_is_of_runs_that_all_passed_a_filter_or_none():
    runs = [SimpleNamespace(path=f"run_{k}", rate_Hz=20_000 / 3, t_s=np.arange(300),
                            scene=SimpleNamespace(time=SimpleNamespace(anti_alias=k == 2))) for k in (1, 2)]
    assert [Window.of([run]).anti_alias for run in runs] == [False, True]
    with pytest.raises(RecognitionError, match="run_2/run.json: scene.time.anti_alias = True; must be as in run_1, False"):
        Window.of(runs)


def test_a_rate_far_below_the_models_tells_of_the_unit_of_times():
    """Milliseconds in a column `t` would be 8 Hz, which could be resampled to what no sensor felt."""
    table = pd.DataFrame({"t_s": 1e3 * T_s, "acc_A_m_s2": X})
    for use in (lambda: at_rate(table, 20_000 / 3, "x"), lambda: Window(20_000 / 3, 100).cut(table, "x")):
        with pytest.raises(RecordError, match=r"x: 8 Hz; .*read in s: a column in ms must be called t \[ms\]"):
            use()
    with pytest.raises(RecordError, match="8000 Hz; the model needs 6666.67 Hz; --resample goes to it"):
        Window(20_000 / 3, 100).cut(table.assign(t_s=T_s), "x")


def test_what_is_no_acceleration_becomes_none_and_another_unit_needs_a_scale(tmp_path):
    table = pd.DataFrame({"t_s": np.arange(4) / 1e3, "Force [N]": 1.0, "A [V]": 2.0, "B [g]": 3.0})
    table.to_csv(tmp_path / "x.csv", index=False)
    with pytest.raises(RecordError, match="x.csv: B: unit = 'm/s.2'; samples are in 'g'"):
        record_table(tmp_path / "x.csv", 1.0, "m/s^2")
    found = record_table(tmp_path / "x.csv", 2.0, "m/s^2")[0]
    assert list(found) == ["t_s", "force_N", "acc_A_m_s2", "acc_B_m_s2"] and found["acc_A_m_s2"][0] == 4.0


def test_where_no_unit_is_told_the_refusal_says_what_there_is(tmp_path):
    pd.DataFrame({"t_s": T_s, "A": X, "B [mm/s]": X}).to_csv(tmp_path / "x.csv", index=False)
    with pytest.raises(RecognitionError, match=r"has t_s, A, B \[mm/s\]; acc_NAME_m_s2 is also NAME \[g\], or NAME with --unit g"):
        read_accelerations(tmp_path / "x.csv", SimpleNamespace(sensor_names=("A",)))
    with pytest.raises(RecognitionError, match="has t_s, A; acc_NAME_m_s2 is also"):
        sensors_of(["t_s", "A"], 2e4, SimpleNamespace(sensor_names=("A",), rod_force_N_m=()), "x.csv")


@pytest.mark.parametrize("name, unit", [("acc_A_m_s2", "g"), ("acc_A_m_s2 [g]", None)])
def test_a_name_that_says_m_s2_is_not_in_another_unit(tmp_path, name, unit):
    """As `features` refuses it: 9.80665 is in the samples, or it is not."""
    pd.DataFrame({"t_s": T_s, name: X}).to_csv(tmp_path / "x.csv", index=False)
    with pytest.raises(RecordError, match=r"x.csv: acc_A_m_s2: unit = 'g'; samples are in 'm/s\^2'"):
        record_table(tmp_path / "x.csv", 1.0, unit)
    if unit:
        with pytest.raises(RecordError, match=r"unit = 'g'; samples are in 'm/s\^2'"):
            read_record(tmp_path / "x.csv", column=name, unit=unit)
