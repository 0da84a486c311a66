"""Whatever a command line says: a result, or one line; nothing is written but the output that it names."""

import importlib
import os
import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import strategies as st

import gangue.commands
from tests.fuzz.mutations import HOSTILE, fuzz, good_run, many, outcome

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = {
    "dem": ["run", "deck", "plate", "sweep", "campaign", "dataset", "resume", "calibrate"],
    "plate_fem": ["modes"], "analysis": ["features"],
    "recognition": ["fit", "recognise", "evaluate", "tap", "check", "listen", "volley"], "report": ["compare"],
    "gangue": sorted({*gangue.commands.COMMANDS} - {"build-engine"}),
}
OPTIONS = ["--out", "--gangue", "--set", "--jobs", "--overwrite", "--walltime", "--profile", "--scene", "--model",
           "--plate", "--taps", "--radius", "--speed", "--window", "--step", "--max-frequency", "--json", "--quiet", "--rock",
           "--column", "--rate", "--scale", "--unit", "--resample", "--no-filter"]
WORDS = ["bad.toml", "short.toml", "record.csv", "run", "out", "mine", "mine/file", ".", "..", "nowhere/at/all", "0", "-1", "1",
         "nan", "1e12", "coal", "stones.speed_m_s=2.0", "time.duration_s=-1", "=", "a.b.c=[", "/dev/null", "/dev/zero", "/",
         *[word for word in HOSTILE if "\x00" not in word]]


@st.composite
def command_lines(draw):
    """A package and arguments, often nearly right; no scene among them can run, so that nothing takes long."""
    package = draw(st.sampled_from(sorted(COMMANDS)))
    words = [draw(st.sampled_from(COMMANDS[package]))] if COMMANDS[package] and draw(st.integers(0, 9)) else []
    for _ in range(draw(st.integers(0, 6))):
        words.append(draw(st.sampled_from(OPTIONS) | st.sampled_from(WORDS) | st.sampled_from(WORDS)))
    if package == "dem" and draw(st.booleans()):
        words += ["--out", draw(st.sampled_from(["out", "mine", ".", "run", "a/b/c"]))]
    return package, words


def tree(directory):
    return {str(file.relative_to(directory)): file.read_bytes() for file in directory.rglob("*")
            if file.is_file() and not file.is_symlink()}


def check(line):
    package, words = line
    here, before = Path(tempfile.mkdtemp()), os.getcwd()
    try:
        (here / "bad.toml").write_text("name = 3\n")
        (here / "short.toml").write_text("[stones]\ncount = 1\n")
        (here / "record.csv").write_text("t_s,a_m_s2\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(200)))
        (here / "mine").mkdir()
        (here / "mine" / "file").write_text("years of work")
        shutil.copytree(good_run(), here / "run")
        there = tree(here)
        os.chdir(here)
        code, errors = outcome(importlib.import_module(f"{package}.__main__").main, words)
        assert code in (0, 1, 2, 3), (line, code, errors)
        assert errors.count("\n") <= 1, (line, errors)
        os.chdir(before)
        after = tree(here)
        assert all(after.get(name) == content for name, content in there.items()), line
        new = {Path(name).parts[0] for name in set(after) - set(there)}
        assert new <= set(words) | {"a", ".modes"}, (line, new)
    finally:
        os.chdir(before)
        shutil.rmtree(here)


@pytest.mark.slow
def test_some_command_lines():
    fuzz(check, command_lines(), 60)


@pytest.mark.validate
def test_many_command_lines():
    fuzz(check, command_lines(), many("LINES", 1000))
