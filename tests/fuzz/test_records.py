"""Whatever a record holds: its features, or one line and exit code 2."""

import json
import os
import shutil
import signal
import tempfile
import warnings
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import soundfile
from hypothesis import strategies as st
from scipy.io import savemat, wavfile

from analysis import RecordError, read_run
from analysis.__main__ import main
from tests.fuzz.mutations import HOSTILE, fuzz, good_run, many, mutated, outcome

TIMES = np.arange(64) * 1e-3
SIGNAL = np.sin(300 * TIMES) * np.exp(-20 * TIMES)
COLUMNS = st.sampled_from(["t_s", "a_m_s2", "time", "t", "0", "force_N", *HOSTILE])
cells = st.one_of(st.floats(), st.integers(-(2**63), 2**63 - 1), st.sampled_from(HOSTILE), st.text(max_size=5))


@st.composite
def tables(draw):
    """A good record with cells replaced, columns renamed, doubled, of another type, or rows gone."""
    table = pd.DataFrame({"t_s": TIMES, "a_m_s2": SIGNAL}).astype(object)
    for _ in range(draw(st.integers(0, 4))):
        row, column = draw(st.integers(0, len(table) - 1)), draw(st.integers(0, table.shape[1] - 1))
        table.iloc[row, column] = draw(cells)
    if draw(st.booleans()):
        table.columns = [draw(COLUMNS) for _ in table.columns]
    if draw(st.booleans()):
        table = table.iloc[: draw(st.integers(0, 5))]
    return table


@st.composite
def files(draw):
    """Name and bytes of a file: a table, garbage, or a good file with bytes changed or cut off."""
    ending = draw(st.sampled_from([".csv", ".txt", ".parquet", ".wav", ".flac", ".mat", ".h5"]))
    if ending in (".csv", ".txt") and draw(st.booleans()):
        text = draw(tables()).to_csv(index=draw(st.booleans()), sep=draw(st.sampled_from(",;\t ")))
        return "record" + ending, text.encode(errors="replace")
    data = bytearray(good_file(ending))
    for _ in range(draw(st.integers(0, 4))):
        data[draw(st.integers(0, len(data) - 1))] = draw(st.integers(0, 255))
    if draw(st.integers(0, 3)) == 0:
        del data[draw(st.integers(0, len(data) - 1)):]
    if draw(st.integers(0, 5)) == 0:
        data = bytearray(draw(st.binary(max_size=200)))
    return "record" + ending, bytes(data)


def good_file(ending):
    here = Path(tempfile.mkdtemp())
    try:
        file = here / ("good" + ending)
        table = pd.DataFrame({"t_s": TIMES, "a_m_s2": SIGNAL})
        if ending == ".parquet":
            table.to_parquet(file)
        elif ending == ".wav":
            wavfile.write(file, 1000, SIGNAL.astype("float32"))
        elif ending == ".flac":
            soundfile.write(file, SIGNAL, 1000)
        elif ending == ".mat":
            savemat(file, {"t": TIMES, "a_m_s2": SIGNAL})
        elif ending == ".h5":
            with h5py.File(file, "w") as made:
                made["t"], made["a_m_s2"] = TIMES, SIGNAL
        else:
            table.to_csv(file, index=False)
        return file.read_bytes()
    finally:
        shutil.rmtree(here)


def check(named):
    name, data = named
    here = Path(tempfile.mkdtemp())
    try:
        file = here / name
        file.write_bytes(data)
        code, errors = outcome(main, ["features", str(file)])
        noted = all(line.startswith(f"note: {file}: ") for line in errors.splitlines())
        assert code == 0 and noted or code == 2 and errors.count("\n") == 1 and str(file) in errors, (code, errors)
        assert [p.name for p in here.iterdir()] == [name]
    finally:
        shutil.rmtree(here)


def check_parquet(table):
    """Tables that only a binary file can hold: any type in any column."""
    here = Path(tempfile.mkdtemp())
    try:
        file = here / "record.parquet"
        try:
            table.convert_dtypes().to_parquet(file)
        except Exception:  # noqa: BLE001  what pandas cannot write nobody can hand over
            return
        check((file.name, file.read_bytes()))
    finally:
        shutil.rmtree(here)


def check_run(run_json):
    """A run directory whose run.json is not ours."""
    here = Path(tempfile.mkdtemp())
    try:
        shutil.copytree(good_run(), here / "ratio_030")
        (here / "ratio_030" / "run.json").write_text(json.dumps(run_json))
        try:
            read = read_run(here / "ratio_030")
        except RecordError as error:
            assert "\n" not in str(error) and "run.json" in str(error)
        else:
            assert 0 <= read.gangue_ratio <= 1 and len(read.materials) > 0
    finally:
        shutil.rmtree(here)


def info():
    return json.loads((good_run() / "run.json").read_text())


@pytest.mark.parametrize("values", [[1e200], [1e308, -1e308], [5e-324]])
def test_samples_that_have_no_square_end_with_one_line(tmp_path, values):
    """And without the warnings of numpy, which a terminal would show."""
    signal_m_s2 = SIGNAL.copy() if max(values) > 1 else 0 * SIGNAL
    signal_m_s2[10:10 + len(values)] = values
    pd.DataFrame({"t_s": TIMES, "a_m_s2": signal_m_s2}).to_csv(tmp_path / "record.csv", index=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        code, errors = outcome(main, ["features", str(tmp_path / "record.csv")])
    assert code == 2 and errors.count("\n") == 1 and "record.csv" in errors


def test_a_reader_that_crashes_ends_with_one_line(tmp_path, monkeypatch):
    """As scipy does on some damaged MATLAB files."""
    (tmp_path / "record.mat").write_bytes(good_file(".mat"))
    monkeypatch.setattr("scipy.io.loadmat", lambda *_, **__: os.kill(os.getpid(), signal.SIGKILL))
    code, errors = outcome(main, ["features", str(tmp_path / "record.mat")])
    assert code == 2 and errors.count("\n") == 1 and "crashes" in errors


@pytest.mark.slow
def test_some_files():
    fuzz(check, files(), 40)
    fuzz(check_parquet, tables(), 10)


@pytest.mark.validate
def test_many_files():
    fuzz(check, files(), many("RECORDS", 2000))
    fuzz(check_parquet, tables(), 200)


def test_some_run_directories():
    fuzz(check_run, mutated(info()), 10)


@pytest.mark.validate
def test_many_run_directories():
    fuzz(check_run, mutated(info()), 300)
