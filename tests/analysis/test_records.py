import numpy as np
import pandas as pd
import pytest

from analysis import (
    Record,
    RecordError,
    as_record,
    base_parameters,
    decompose,
    hilbert_spectrum,
    marginal_spectrum,
    read_record,
    resample,
    signal_features,
)
from analysis.__main__ import main
from analysis.files.readers import read_signals
from common.channels import plain_unit


def one_line(error):
    assert "\n" not in str(error.value)
    return str(error.value)


def test_array_series_and_files_give_the_same_record(tmp_path):
    t_s = np.arange(400) / 2000.0 + 0.25
    values = np.sin(2 * np.pi * 50 * t_s)
    table = pd.DataFrame({"t_s": t_s, "a_m_s2": values})
    table.to_csv(tmp_path / "named.csv", index=False)
    table.to_parquet(tmp_path / "table.parquet")
    np.savetxt(tmp_path / "bare.csv", values)
    records = [
        as_record(pd.Series(values, index=t_s, name="a_m_s2")),
        as_record(pd.Series(values, index=pd.to_timedelta(t_s, unit="s"), name="a_m_s2")),
        read_record(tmp_path / "named.csv"),
        read_record(tmp_path / "table.parquet", column="a_m_s2"),
    ]
    for record in records:
        assert record.rate_Hz == pytest.approx(2000.0, rel=1e-6)
        assert record.unit == "m/s^2"
        assert record.t0_s == pytest.approx(0.25)
        np.testing.assert_allclose(record.values, values, rtol=1e-12, atol=1e-15)
    bare = read_record(tmp_path / "bare.csv", rate_Hz=2000.0)
    np.testing.assert_allclose(bare.values, values, atol=1e-15)


@pytest.mark.parametrize("make", [lambda r: r, decompose, marginal_spectrum, hilbert_spectrum])
def test_what_holds_arrays_compares_by_their_values(make):
    values = np.sin(np.arange(99.0)) + np.sin(0.2 * np.arange(99.0))
    one, same, other = (make(as_record(factor * values, 10.0)) for factor in (1, 1, 2))
    assert one == same != other and one != 3


@pytest.mark.parametrize("name, unit", [("acc [g]", "g"), ("acc (m/s²)", "m/s^2"), ("acc_m_s2", "m/s^2"), ("acc", "1")])
def test_a_series_has_the_units_behind_its_names(name, unit):
    record = as_record(pd.Series([0.0, 2.0, 1.0], index=pd.Index([0.0, 0.5, 1.0], name="t [ms]"), name=name))
    assert (record.unit, record.rate_Hz) == (unit, 2000.0)
    with pytest.raises(RecordError, match="'Hz'"):
        as_record(pd.Series([0.0, 2.0], index=pd.Index([0.0, 0.5], name="t [Hz]")))


@pytest.mark.parametrize("scale, words", [(2.0, "unit of the scaled"), (0.0, "not 0"), (np.nan, "finite")])
def test_a_scale_needs_a_unit(tmp_path, scale, words):
    (tmp_path / "a.csv").write_text("t_s,acc [mV]\n0,1\n0.1,2\n0.2,3\n")
    with pytest.raises(RecordError, match=words) as error:
        read_record(tmp_path / "a.csv", scale=scale)
    one_line(error)


@pytest.mark.parametrize("values", [[1.0], [[1.0, 2.0]], [1.0, np.nan, 2.0], [1.0, np.inf], ["a", "b"], [1j, 2.0],
                                    np.ma.array([1.0, 2.0], mask=[False, True])])
def test_unusable_samples_are_refused(values):
    with pytest.raises(RecordError) as error:
        as_record(values, 100.0)
    one_line(error)


def test_gaps_in_time_are_refused(tmp_path):
    t_s = np.arange(50) * 1e-3
    pd.DataFrame({"t_s": np.delete(t_s, 20), "a_m_s2": np.arange(49.0)}).to_csv(
        tmp_path / "gap.csv", index=False
    )
    with pytest.raises(RecordError, match="uniform") as error:
        read_record(tmp_path / "gap.csv")
    assert "gap.csv" in one_line(error)


def test_a_rate_that_contradicts_the_times_is_refused(tmp_path):
    pd.DataFrame({"t_s": np.arange(50) * 1e-3, "a_m_s2": np.arange(50.0)}).to_csv(
        tmp_path / "x.csv", index=False
    )
    with pytest.raises(RecordError, match="1000"):
        read_record(tmp_path / "x.csv", rate_Hz=500.0)


def test_missing_rate_column_and_file_are_named(tmp_path):
    np.savetxt(tmp_path / "bare.csv", np.arange(5.0))
    pd.DataFrame({"t_s": np.arange(5.0), "p": 1.0, "q": 2.0}).to_csv(tmp_path / "two.csv", index=False)
    (tmp_path / "text.parquet").write_text("no table")
    (tmp_path / "header.csv").write_text("t_s,a_m_s2\n")
    for path, words in (
        ("bare.csv", "rate"),
        ("two.csv", "p, q"),
        ("none.csv", "no such"),
        ("text.parquet", "table"),
        ("header.csv", "has 0 samples"),
    ):
        with pytest.raises(RecordError, match=words) as error:
            read_record(tmp_path / path)
        assert path in one_line(error)


def test_a_word_among_the_samples_is_refused(tmp_path):
    (tmp_path / "bad.csv").write_text("t_s,a_m_s2\n0,1\n0.1,oops\n0.2,3\n")
    with pytest.raises(RecordError, match="sample 1"):
        read_record(tmp_path / "bad.csv")


def test_command_line_prints_and_refuses(tmp_path, capsys):
    t_s = np.arange(1000) / 5000.0
    pd.DataFrame({"t_s": t_s, "a_m_s2": np.sin(2 * np.pi * 200 * t_s)}).to_csv(
        tmp_path / "x.csv", index=False
    )
    assert main(["features", str(tmp_path / "x.csv")]) == 0
    lines = capsys.readouterr().out.splitlines()
    rms = next(line.split() for line in lines if line.startswith("rms"))
    assert float(rms[1]) == pytest.approx(np.sqrt(0.5), rel=1e-5) and rms[2] == "m/s^2"
    assert main(["features", str(tmp_path / "y.csv")]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    assert main(["features", str(tmp_path / "x.csv"), "--no-filter"]) == 2
    assert capsys.readouterr().err == "--no-filter: goes with --resample\n"


def test_wav_round_trip(tmp_path):
    from scipy.io import wavfile

    x = 0.5 * np.sin(2 * np.pi * 40 * np.arange(2000) / 8000)
    wavfile.write(tmp_path / "x.wav", 8000, np.column_stack([x, -x]).astype(np.float32))
    wavfile.write(tmp_path / "pcm.wav", 8000, np.round(x * 32768).astype(np.int16))
    two = read_record(tmp_path / "x.wav", column="1", scale=20.0, unit="m/s^2")
    np.testing.assert_allclose(two.values, -20 * x, atol=1e-5)
    assert (two.rate_Hz, two.unit) == (8000.0, "m/s^2")
    np.testing.assert_allclose(read_record(tmp_path / "pcm.wav").values, x, atol=1 / 32768)
    for asked, words in (({}, "choose one of 0..1"), ({"time": "t", "column": "0"}, "no column of times 't'")):
        with pytest.raises(RecordError, match=words):
            read_record(tmp_path / "x.wav", **asked)


@pytest.mark.parametrize("binary", [0, 1])
def test_uff_round_trip(tmp_path, binary):
    pyuff = pytest.importorskip("pyuff")
    x = 0.5 * np.sin(2 * np.pi * 40 * np.arange(2000) / 8000)
    dataset = pyuff.prepare_58(
        binary=binary, func_type=1, rsp_node=1, rsp_dir=3, ref_node=0, ref_dir=0, data=x,
        x=np.arange(2000) / 8000, id1="plate north", rsp_ent_name="N", ref_ent_name="N", abscissa_spacing=1,
        ordinate_axis_units_lab="m/s^2", abscissa_axis_units_lab="s", ord_data_type=4, num_pts=2000,
        abscissa_min=0.0, abscissa_inc=1 / 8000, abscissa_spec_data_type=17, ordinate_spec_data_type=12,
        orddenom_spec_data_type=0, z_axis_spec_data_type=0,
    )  # fmt: skip
    pyuff.UFF(str(tmp_path / "x.uff")).write_sets(dataset, "add")  # pyuff cannot "overwrite" in binary
    found = read_record(tmp_path / "x.uff", column="plate north")
    assert found.rate_Hz == pytest.approx(8000.0, rel=1e-5) and found.unit == "m/s^2"
    np.testing.assert_allclose(found.values, x, atol=1e-5)


@pytest.mark.parametrize("name", ["broken.wav", "broken.uff"])
def test_broken_measured_files_are_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"RIFFnothing of the kind\n")
    with pytest.raises(RecordError, match=name) as error:
        read_record(tmp_path / name)
    one_line(error)


def test_a_bare_array_is_refused_and_a_series_with_times_is_a_record():
    values = np.sin(np.arange(200) * 0.7)
    for function in (decompose, signal_features, base_parameters, lambda x: resample(x, 500.0), marginal_spectrum):
        with pytest.raises(RecordError, match="no sample rate; give rate_Hz, of an array to as_record"):
            function(values)
    series = pd.Series(values, index=np.arange(200) / 1000.0)
    assert signal_features(series)["rms"].value == pytest.approx(np.sqrt(np.mean(values**2)))
    assert marginal_spectrum(series).total == marginal_spectrum(decompose(series)).total
    assert hilbert_spectrum(series, times=4).amplitude.shape == (20, 4)
    assert resample(series, 500.0).rate_Hz == 500.0


@pytest.mark.parametrize("values", [np.arange("2026-11-28", "2026-12-01", dtype="M8[D]"), np.arange(3).astype("m8[s]")])
def test_dates_are_no_samples(values):
    with pytest.raises(RecordError, match="dates; needs real numbers"):
        as_record(values, 100.0)


@pytest.mark.parametrize("given", [{"rate_Hz": "fast"}, {"rate_Hz": None}, {"rate_Hz": 1j}, {"rate_Hz": [5.0, 6.0]},
                                   {"t0_s": "noon"}, {"t0_s": None}])
def test_a_rate_or_time_that_is_no_number_is_refused(given):
    with pytest.raises(RecordError, match=next(iter(given))):
        Record([0.0, 1.0], **{"rate_Hz": 5.0} | given)


def test_an_index_of_times_counts_beside_a_rate():
    series = pd.Series([0.0, 2.0, 1.0], index=[0.1, 0.101, 0.102])
    assert as_record(series, 1000.0).t0_s == 0.1
    with pytest.raises(RecordError, match="rate_Hz = 50; its index says 1000"):
        as_record(series, 50.0)
    assert as_record(pd.Series([0.0, 2.0, 1.0], index=pd.Index([10, 12, 14], name="t [ms]"))).rate_Hz == 500.0
    with pytest.raises(RecordError, match="0 samples"):
        as_record(pd.Series([], dtype=float, index=pd.DatetimeIndex([])))


def test_a_unit_and_a_name_count_for_a_record_too():
    record = as_record(Record([0.0, 1.0], 10.0, "1", "old"), unit="g", name="new")
    assert (record.unit, record.name) == ("g", "new")


@pytest.mark.parametrize("name", [
    "t_ms", "Time_ms", "Zeit [msec]", "time (mseconds)", "t [us]", "t [ns]", "Seconds", "t (Sec)"])
def test_times_are_found_with_the_unit_behind_their_name(tmp_path, name):
    per_s = {"us": 1e6, "ns": 1e9}.get(name[-3:-1], 1e3 if "m" in name else 1.0)
    pd.DataFrame({name: np.arange(9) * per_s / 2000, "acc": np.arange(9.0)}).to_csv(tmp_path / "x.csv", index=False)
    assert read_record(tmp_path / "x.csv").rate_Hz == pytest.approx(2000.0)
    assert read_signals(tmp_path / "x.csv")["t_s"].iloc[-1] == pytest.approx(8 / 2000)


@pytest.mark.parametrize("unit, plain", [("m/sec2", "m/s^2"), ("seconds", "s"), ("msec", "ms"), ("mm/sec^2", "mm/s^2")])
def test_seconds_in_full(unit, plain):
    assert plain_unit(unit) == plain


def test_slow_times_without_a_unit_are_told_of(tmp_path, caplog):
    for name in ("t", "t_s"):
        pd.DataFrame({name: np.arange(9) * 0.15, "acc": np.arange(9.0)}).to_csv(tmp_path / "x.csv", index=False)
        read_record(tmp_path / "x.csv")
    assert [one.getMessage().partition("csv: ")[2] for one in caplog.records] == [
        "6.66667 Hz by its t; times without a unit are read in s: a column in ms must be called t [ms]"]


def test_the_sample_whose_time_does_not_rise_is_named(tmp_path):
    (tmp_path / "x.csv").write_text("t_s,acc\n" + "".join(f"{0.001 * k},{k}\n" for k in range(20)) + "End of file\n")
    with pytest.raises(RecordError, match="sample 20 does not"):
        read_record(tmp_path / "x.csv")


def test_another_unit_needs_a_scale(tmp_path):
    pd.DataFrame({"t_s": np.arange(9) / 1e3, "a_m_s2": 1.0, "b [V]": 2.0}).to_csv(tmp_path / "x.csv", index=False)
    with pytest.raises(RecordError, match="unit = 'g'; samples are in 'm/s.2'"):
        read_record(tmp_path / "x.csv", column="a_m_s2", unit="g")
    assert read_record(tmp_path / "x.csv", column="a_m_s2", unit="m/s²").unit == "m/s^2"
    assert read_record(tmp_path / "x.csv", column="a_m_s2", scale=1e3, unit="mm/s²").values[0] == 1000.0
    assert read_record(tmp_path / "x.csv", column="b", unit="g").unit == "g"


@pytest.mark.parametrize("names", [",t_s,acc", "row,second,acc"])
def test_tables_of_pandas_and_oscilloscopes(tmp_path, names):
    (tmp_path / "x.csv").write_text(names + "\n" + "".join(f"{k},{k / 500},{k % 5}\n" for k in range(40)))
    record = read_record(tmp_path / "x.csv", column=None if names[0] == "," else "acc")
    assert (record.rate_Hz, record.values.max()) == (pytest.approx(500.0), 4.0)
