import numpy as np
import pandas as pd
import pytest

from analysis import RecordError, as_record, read_record
from analysis.__main__ import main


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
