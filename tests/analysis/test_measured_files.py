"""Records as measurement systems write them: what is read are the samples that were written."""

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat, wavfile

from analysis import RecordError, read_record
from analysis.files.readers import read_signals
from analysis.files.text_tables import read_plain_table, read_text_table
from analysis.signals.records import sample_rate_Hz, seconds
from common.files.parquet import read_numbers, write_parquet

T_s = np.arange(6) / 2000.0
A = np.array([0.0, 12.5, -3.25, 7.125, -1.0, 0.5])
EUROPEAN = {
    "german.csv": ("utf-8", "Zeit [ms];Beschleunigung [m/s²]\n", ";", "\n"),
    "windows.csv": ("cp1252", "Zeit [ms];Beschleunigung [m/s²]\r\n", ";", "\r\n"),
    "excel.txt": ("utf-16", "Zeit [ms]\tBeschleunigung [m/s²]\n", "\t", "\n"),
    "preamble.csv": ("utf-8-sig", "Gerät;Nr. 7\nDatum;3,5,2026\n\nZeit;Beschleunigung\nms;m/s²\n", ";", ";\n"),
    "polish.csv": ("utf-8", '"Czas (ms)";"Beschleunigung (m/s^2)"\n', ";", "\n"),
}


def european(number):
    return f"{number:.4f}".replace(".", ",")


@pytest.mark.parametrize("name", EUROPEAN)
@pytest.mark.parametrize("column", [None, "Beschleunigung"])
def test_decimal_commas_and_names_in_any_language(tmp_path, name, column):
    encoding, head, separator, end = EUROPEAN[name]
    rows = [european(1e3 * t) + separator + european(a) + end for t, a in zip(T_s, A, strict=True)]
    (tmp_path / name).write_bytes((head + "".join(rows)).encode(encoding))
    record = read_record(tmp_path / name, column=column)
    np.testing.assert_array_equal(record.values, A)
    assert (record.rate_Hz, record.unit) == (pytest.approx(2000.0, rel=1e-12), "m/s^2")


def test_columns_of_many_are_chosen_by_name(tmp_path):
    file = tmp_path / "many.csv"
    file.write_text("Chwila;Kanał 1 [g];Kanał 2 [g]\n" + "".join(f"{european(t)};1,5;{european(a)}\n"
                                                                 for t, a in zip(T_s, A, strict=True)))
    record = read_record(file, column="Kanał 2", time="Chwila", scale=9.80665, unit="m/s^2")
    np.testing.assert_allclose(record.values, 9.80665 * A, rtol=1e-15)
    assert record.rate_Hz == pytest.approx(2000.0, rel=1e-12)
    for wrong, words in ((dict(column="Kanał 2"), "rate"), (dict(column="Kanał 3", rate_Hz=1.0), "Kanał 1"),
                         (dict(column="Kanał 2", time="Zeit"), "Chwila")):
        with pytest.raises(RecordError, match=words) as error:
            read_record(file, **wrong)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(("time", "per_s"), [("t_ms", 1e3), ("time_us", 1e6), ("t_s", 1.0), ("clock", 1.0)])
def test_a_unit_after_an_underscore_is_that_of_the_times(tmp_path, time, per_s):
    pd.DataFrame({time: per_s * T_s, "acc": A}).to_csv(tmp_path / "a.csv", index=False)
    assert read_record(tmp_path / "a.csv", column="acc", time=time).rate_Hz == pytest.approx(2000.0, rel=1e-12)


@pytest.mark.parametrize("clock, separator, rate_Hz", [
    ("2026-11-28T10:00:00.{}", ",", None), ("2026-11-28 10:00:00,{}", ";", None),
    ("2026-11-28T10:00:00.{}Z", "\t", None), ("28.11.2026 10:00:00,{}", ";", 2000.0), ("10:00:00.{}", ",", None)])
def test_dates_are_times_and_another_clock_needs_a_rate(tmp_path, clock, separator, rate_Hz):
    rows = [(clock.format(f"{1e4 * t:04.0f}"), a) for t, a in zip(T_s, A, strict=True)]
    (tmp_path / "a.csv").write_text(f"time{separator}acc [g]\n" + "".join(
        f"{at}{separator}{european(a) if separator == ';' else a}\n" for at, a in rows))
    record = read_record(tmp_path / "a.csv", rate_Hz=rate_Hz)
    np.testing.assert_array_equal(record.values, A)
    assert (record.rate_Hz, record.unit) == (pytest.approx(2000.0, rel=1e-9), "g")
    with pytest.raises(RecordError, match="2026-11-28T10" if rate_Hz else "says 2000"):
        read_record(tmp_path / "a.csv", rate_Hz=None if rate_Hz else 500.0)


@pytest.mark.parametrize("text, values", [
    ("1,5\n2,5\n-0,5\n", None),  # two columns, or one? Nobody can tell
    ("Kraft\n1,5\n2,5\n-0,5\n", [1.5, 2.5, -0.5]),
    ("1;\n2;\n", [1.0, 2.0]),
    ("# t a\n", None),
], ids=["open", "named", "separator at the end", "no numbers"])
def test_one_column(tmp_path, text, values):
    file = tmp_path / "one.csv"
    file.write_text(text)
    if values is None:
        with pytest.raises(RecordError):
            read_record(file, rate_Hz=10.0)
    else:
        np.testing.assert_array_equal(read_record(file, rate_Hz=10.0).values, values)


@pytest.mark.parametrize("text, words", [
    ("t_s;a\n0,1;oops\n0,2;1,0\n", "line 2"), ("t_s;a\n0,1;1,5\n0,2;oops\n0,3;1\n", "sample 1 is nan"),
    ("t_s;a\n0,1;1,5\n0,2;1,5;7\n", "saw 3"), ("t_s;a;a\n0,1;1,5;2\n0,2;1,5;7\n", "twice"),
    ("t [foo];a\n0,1;1,5\n0,2;1,5\n", "'foo'"),
])
def test_a_table_that_says_nothing_clear_is_refused(tmp_path, text, words):
    file = tmp_path / "x.csv"
    file.write_text(text)
    with pytest.raises(RecordError, match=words) as error:
        read_record(file, column="a")
    assert str(file) in str(error.value) and "\n" not in str(error.value)


def test_flac_holds_shares_of_full_scale(tmp_path):
    soundfile = pytest.importorskip("soundfile")
    x = 0.5 * np.sin(2 * np.pi * 40 * np.arange(2000) / 8000)
    soundfile.write(tmp_path / "x.flac", np.column_stack([x, -x]), 8000, subtype="PCM_24")
    record = read_record(tmp_path / "x.flac", column="1", scale=20.0, unit="m/s^2")
    np.testing.assert_allclose(record.values, -20 * x, atol=20 / 2**23)
    assert (record.rate_Hz, record.unit) == (8000.0, "m/s^2")
    with pytest.raises(RecordError, match="choose one of 0..1"):
        read_record(tmp_path / "x.flac")
    with pytest.raises(RecordError, match="8000"):
        read_record(tmp_path / "x.flac", column="0", rate_Hz=100.0)


def matlab_5(file, values):
    from scipy.io import savemat

    savemat(file, values)


def matlab_73(file, values):
    """HDF5 behind the head that MATLAB writes, with matrices as it stores them, transposed."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(file, "w", userblock_size=512) as made:
        for name, value in values.items():
            made[name] = np.atleast_2d(value)
    with open(file, "r+b") as head:
        head.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


@pytest.mark.parametrize("write", [matlab_5, matlab_73])
def test_matlab_files_of_either_kind(tmp_path, write):
    file = tmp_path / "x.mat"
    write(file, {"a_m_s2": A, "t": T_s, "note": 7.0})
    record = read_record(file)
    np.testing.assert_array_equal(record.values, A)
    assert (record.rate_Hz, record.unit) == (pytest.approx(2000.0, rel=1e-12), "m/s^2")
    write(file, {"north": A, "south": -A, "Fs": 2000.0})
    assert read_record(file, column="south").values[1] == -12.5 and read_record(file, column="south").rate_Hz == 2000.0
    with pytest.raises(RecordError, match="north, south"):
        read_record(file)
    write(file, {"north": A})
    with pytest.raises(RecordError, match="rate"):
        read_record(file)
    assert read_record(file, rate_Hz=50.0).rate_Hz == 50.0


def test_fields_and_matrices_of_a_matlab_file(tmp_path):
    matlab_5(tmp_path / "x.mat", {"run": {"acc": np.column_stack([A, 2 * A]), "force_N": A, "dt": 5e-4, "unit": "g"},
                                  "text": "impact"})
    record = read_record(tmp_path / "x.mat", column="acc:1")
    assert record.unit == "g" and read_record(tmp_path / "x.mat", column="force_N").unit == "N"
    np.testing.assert_array_equal(record.values, 2 * A)
    assert record.rate_Hz == pytest.approx(2000.0)


def test_hdf5_takes_rate_and_unit_from_attributes(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file.attrs["Sample Rate"] = 500.0
        near, far = file.create_dataset("near/acc", data=A), file.create_dataset("far/acc", data=-A)
        near.attrs["units"] = "m/s²"
        far.attrs["wf_increment"] = 1e-3
        file["far"].attrs["unit"] = "mV"
    near, far = (read_record(tmp_path / "x.h5", column=f"{name}/acc") for name in ("near", "far"))
    np.testing.assert_array_equal(near.values, A)
    assert (near.rate_Hz, near.unit, far.rate_Hz, far.unit) == (500.0, "m/s^2", pytest.approx(1000.0), "mV")
    with pytest.raises(RecordError, match="near/acc"):
        read_record(tmp_path / "x.h5", column="acc")


@pytest.mark.parametrize("name", ["broken.mat", "broken.h5", "broken.flac"])
def test_broken_files_are_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"nothing of the kind\n" * 20)
    with pytest.raises(RecordError, match=name) as error:
        read_record(tmp_path / name)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", [
    "t_s,a_m_s2\n0,1.5\n1e-3,-2.25\n2e-3,nan\n", "# t a\n0.1  1\n0.2\t2\n\n0.3 -3e-3\n", "1;2\n3;4\n",
    "t,a\n0,1\n1,\n2,3\n", "t,a\n0,1\n1,word\n2,3\n", "t,a\n0,1\n1,2,3\n", "t;a\n0,5;1,5\n1,0;2,5\n",
    '"t","a"\n"0","1"\n', "1,\n2,\n", "a,a\n1,2\n3,4\n", "word\n"],
    ids=["commas", "blanks", "no names", "gap", "word", "long line", "decimal comma", "quotes",
         "spare", "twice", "no number"])
def test_a_plain_table_is_the_one_that_pandas_reads_or_none(tmp_path, text):
    (tmp_path / "a.csv").write_text(text)
    try:
        plain = read_plain_table(tmp_path / "a.csv")
    except ValueError:
        return
    whole = read_text_table(tmp_path / "a.csv")
    assert list(plain) == list(whole.columns)
    np.testing.assert_allclose(np.column_stack(list(plain.values())), whole.to_numpy(dtype=float), rtol=1e-15)


@pytest.mark.parametrize("table, plain", [
    (pd.DataFrame({"t_s": T_s, "n": np.arange(6, dtype=np.int32)}), True),
    (pd.DataFrame({"a": A}, index=pd.Index(T_s, name="t_s")), False),
    (pd.DataFrame({"a": A, "word": list("abcdef")}), False), (pd.DataFrame({"a": [1, None]}, dtype="Int64"), False)],
    ids=["numbers", "index", "words", "gap"])
def test_a_parquet_table_of_numbers_is_the_one_that_pandas_reads(tmp_path, table, plain):
    table.to_parquet(tmp_path / "a.parquet")
    if not plain:
        with pytest.raises(ValueError, match="index|numbers"):
            read_numbers(tmp_path / "a.parquet")
        return
    pd.testing.assert_frame_equal(pd.DataFrame(read_numbers(tmp_path / "a.parquet")), table.astype(float))
    write_parquet(table, tmp_path / "a.parquet")  # with checksums
    data = bytearray((tmp_path / "a.parquet").read_bytes())
    data[data.index(b"\x28\xb5\x2f\xfd") + 12] ^= 1  # in the first page, which Zstandard's mark begins
    (tmp_path / "a.parquet").write_bytes(data)
    with pytest.raises((OSError, ValueError)):
        read_numbers(tmp_path / "a.parquet")


@pytest.mark.parametrize("rows", [0, 1, 11])
def test_a_table_of_arrays_is_written_as_pandas_writes_it(tmp_path, rows):
    rng = np.random.default_rng(rows)
    numbers = rng.normal(size=(rows, 3))
    numbers[::2, 1] = np.nan
    table = {"a": numbers[:, 0], "gap": numbers[:, 1], "n": np.arange(rows),
             "word": np.array([["coal", "", "Grün"][k % 3] for k in range(rows)], dtype=str)}
    write_parquet(table, tmp_path / "own.parquet")
    write_parquet(pd.DataFrame(table), tmp_path / "pandas.parquet")
    files = tmp_path / "own.parquet", tmp_path / "pandas.parquet"
    own, of_pandas = (pq.read_table(file).replace_schema_metadata() for file in files)
    assert own.equals(of_pandas) and own.column("gap").null_count == -(-rows // 2)
    pd.testing.assert_frame_equal(*map(pd.read_parquet, files))


@pytest.mark.parametrize("begin", [pd.Timestamp("2026-03-01"), pd.Timestamp("2026-03-01", tz="Asia/Shanghai"),
                                   pd.Timedelta(0)], ids=["date", "zone", "span"])
def test_dates_and_an_index_of_times_give_the_rate_in_seconds(tmp_path, begin):
    x = np.sin(np.arange(100))
    table = pd.DataFrame({"time": begin + pd.to_timedelta(np.arange(100) / 1000.0, unit="s"), "acc_a_m_s2": x})
    table.to_parquet(tmp_path / "column.parquet")
    table.set_index("time").to_parquet(tmp_path / "index.parquet")
    for name in ("column", "index"):
        assert read_record(tmp_path / f"{name}.parquet").rate_Hz == pytest.approx(1000.0)
        np.testing.assert_allclose(read_signals(tmp_path / f"{name}.parquet").t_s, np.arange(100) / 1000.0, atol=1e-9)


@pytest.mark.parametrize(("rate_Hz", "unit", "decimals"), [
    (20_000.0, "s", 6), (51_200.0, "s", 6), (51_200.0, "ms", 3), (102_400.0, "s", 6), (8192.0, "s", 5), (2e4, "s", 0)])
def test_times_rounded_to_few_digits_need_no_rate(rate_Hz, unit, decimals):
    """A lost sample, one twice, a step to another rate and times that drift are still refused."""
    even_s = 3.0 + np.arange(4000) / rate_Hz
    wrong = [np.delete(even_s, k) for k in (1, 1999, 3998)] + [np.insert(even_s, 5, even_s[4])]
    wrong += [even_s + 0.3 / rate_Hz * (even_s > even_s[2000]), 3 + (even_s - 3) * (1 + 1e-3 * (even_s > even_s[2000])),
              3 + (even_s - 3) * (1 + 0.1 * (even_s - 3))]
    size = 1e3 if unit == "ms" else 1.0

    def written(t_s):
        times = (size * t_s).astype(np.float32) if decimals == 0 else np.round(size * t_s, decimals)
        return seconds(f"t [{unit}]", times, "x")

    assert sample_rate_Hz(written(even_s), "x") == pytest.approx(rate_Hz, rel=2e-5)
    for times in wrong:
        with pytest.raises(RecordError, match="uniform|rise"):
            sample_rate_Hz(written(times), "x")


def test_times_too_coarse_to_show_a_lost_sample_are_refused():
    with pytest.raises(RecordError, match="uniform"):
        sample_rate_Hz((np.arange(4000) / 30_000.0).round(5), "x")


def test_rounded_times_agree_with_the_rate_that_is_told(tmp_path):
    """At 51.2 kHz to 0.01 and 1 ms, in single precision, and in seconds since 1970; a rate 1 % off, or a lost sample,
    does not agree."""
    rate_Hz, n = 51_200.0, 5000
    true_s, samples = 3.0 + np.arange(n) / rate_Hz, np.sin(np.arange(n))
    for k, times in enumerate((true_s.round(5), true_s.round(3), true_s.astype(np.float32), 1.7e9 + true_s)):
        pd.DataFrame({"t_s": times, "a_m_s2": samples}).to_parquet(file := tmp_path / f"{k}.parquet")
        record = read_record(file, rate_Hz=rate_Hz)
        assert record.rate_Hz == rate_Hz and record.t0_s == times[0]
        for wrong_Hz in (1.01 * rate_Hz, 0.0, np.nan, -rate_Hz):
            with pytest.raises(RecordError, match="uniform|rise"):
                read_record(file, rate_Hz=wrong_Hz)
    for times in (np.delete(true_s, 9).round(5), 1.7e9 + np.delete(true_s, 9)):
        pd.DataFrame({"t_s": times, "a_m_s2": samples[1:]}).to_parquet(file := tmp_path / "lost.parquet")
        with pytest.raises(RecordError, match="uniform"):
            read_record(file, rate_Hz=rate_Hz)
    pd.DataFrame({"t_s": true_s.round(5), "a_m_s2": samples}).to_csv(tmp_path / "x.csv", index=False)
    with pytest.raises(RecordError, match="uniform sample rate; where times are rounded, give the sample rate"):
        read_record(tmp_path / "x.csv")


def test_a_sound_file_that_is_cut_off_is_told_of(tmp_path, caplog):
    wavfile.write(tmp_path / "x.wav", 8000, np.arange(500, dtype=np.int16))
    assert read_record(tmp_path / "x.wav").values.size == 500 and not caplog.text
    (tmp_path / "x.wav").write_bytes((tmp_path / "x.wav").read_bytes()[:600])
    assert read_record(tmp_path / "x.wav").values.size == 278 and "fewer samples than it says" in caplog.text


def test_a_file_without_real_numbers_says_so(tmp_path):
    savemat(tmp_path / "x.mat", {"x": 1j * np.arange(9), "of": "steel"})
    with pytest.raises(RecordError, match="x.mat: holds no signal"):
        read_record(tmp_path / "x.mat")
