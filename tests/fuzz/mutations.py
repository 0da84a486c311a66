"""Valid input, changed at random places: what the fuzz tests share."""

import atexit
import contextlib
import copy
import io
import json
import math
import os
import shutil
import signal
import tempfile
from functools import cache
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings, strategies as st

from tests.analysis.synthetic import write_run

# What a careless or a hostile hand writes into a field.
HOSTILE = [
    "", " ", "a\nshell rm -rf x", "a & shell", "${HOME}", "$(id)", "`id`", '"', "'", "..", "../../x", "/etc/passwd",
    "x" * 5000, "Kohle", "煤", "\u202e", "\x00", "{{ 7 * 7 }}", "{% raw %}", "nan", "1e400", "-1", "NULL", "<b>",
]  # fmt: skip
NUMBERS = [
    0, -1, 1, 2, 3, 10**6, 10**12, 2**31, 2**63, 10**400, 0.0, -0.0, 0.05, 0.3, 0.5, 0.9999, 1.0, 1.5, 2.0, 1e-3, 1e-6, 1e-9, 1e-300,
    5e-324, 1e3, 1e6, 1e9, 1e12, 1e30, 1e300, 1.7e308, math.inf, -math.inf, math.nan,
]  # fmt: skip
values = st.one_of(
    st.sampled_from(HOSTILE), st.sampled_from(NUMBERS), st.text(max_size=20),
    st.floats(), st.integers(), st.booleans(), st.just([]), st.just({}), st.lists(st.integers(-2, 3), max_size=4),
    st.dictionaries(st.text(max_size=5), st.floats(), max_size=2),
)  # fmt: skip


@st.composite
def places(draw, data):
    """A place in nested dicts and lists: the table and the key in it. Small tables count as much as large ones."""
    while True:
        key = draw(st.sampled_from(sorted(data, key=repr) if isinstance(data, dict) else range(len(data))))
        inner = data[key]
        if not isinstance(inner, (dict, list)) or not inner or draw(st.integers(0, 4)) == 0:
            return data, key
        data = inner


@st.composite
def mutated(draw, valid, most=3):
    """A copy of `valid` with up to `most` places changed, left out, renamed or scaled; most often a number becomes
    another one, since such a copy may still be valid and so gets far."""
    data = copy.deepcopy(valid)
    for _ in range(draw(st.sampled_from([1, 1, *range(1, most + 1)]))):
        table, key = draw(places(data))
        value = table[key]
        how = draw(st.sampled_from([*4 * ["scale"], *4 * ["number"], "replace", "leave out", "rename"]))
        if how == "number" and isinstance(value, (int, float)) and not isinstance(value, bool):
            table[key] = draw(st.sampled_from([n for n in NUMBERS if isinstance(n, float) or isinstance(value, int)]))
        elif how == "scale" and isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 2**63:
            table[key] = value * draw(st.sampled_from([0.0, 1e-6, 1e-3, 0.1, 0.5, 2, 10, 1e3, 1e6, 1e12, -1]))
        elif how == "leave out":
            del table[key]
        elif how == "rename" and isinstance(table, dict):
            table[draw(st.sampled_from(HOSTILE) | st.text(max_size=8))] = table.pop(key)
        else:
            table[key] = draw(values)
        if not data:
            break
    return data


@cache
def good_run():
    """A run directory, made once."""
    here = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, here)
    return write_run(here / "ratio_030", 0.3)


def as_toml(data):
    """Nested dicts as TOML text, one line a key, tables inline."""
    return "".join(f"{_text(key)} = {_inline(value)}\n" for key, value in data.items())


def _inline(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_text(k)} = {_inline(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return _text(value) if isinstance(value, str) else str(value).lower() if isinstance(value, (bool, float)) else str(value)


def _text(value):
    # JSON's escapes are TOML's, but for lone surrogates, which no text file holds, and DEL.
    return json.dumps(value, ensure_ascii=False).encode(errors="replace").decode().replace("\x7f", "\\u007f")


def outcome(main, arguments):
    """Exit code of a command line and what it wrote to stderr; an exception but argparse's passes through."""
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
        try:
            code = main(arguments)
        except SystemExit as end:
            code = end.code
    return code, errors.getvalue()


def many(name, cases):
    """How many cases a long fuzz has: FUZZ_NAME in the environment, or so many."""
    return int(os.environ.get(f"FUZZ_{name}", cases))


LONGEST_s = 20.0  # of processor time; a case that takes longer hangs


def in_time(check, case):
    """`check` a case; AssertionError if it uses more than LONGEST_s of the processor, which does not depend on what
    else the machine does, or waits for thirty times as long."""
    def hangs(number, frame):
        raise AssertionError(f"no end after {LONGEST_s:g} s of the processor, or {30 * LONGEST_s:g} s in all")

    timers = {signal.SIGPROF: (signal.ITIMER_PROF, LONGEST_s), signal.SIGALRM: (signal.ITIMER_REAL, 30 * LONGEST_s)}
    before = {number: signal.signal(number, hangs) for number in timers}
    for timer, limit_s in timers.values():
        signal.setitimer(timer, limit_s)
    try:
        check(case)
    finally:
        for number, (timer, _) in timers.items():
            signal.setitimer(timer, 0)
            signal.signal(number, before[number])


def fuzz(check, strategy, cases):
    """`check` every one of so many cases, the same ones each time. One that fails is shown as it is: to make it smaller
    takes hundreds of others."""
    settings(max_examples=cases, deadline=None, derandomize=True, database=None, phases=[Phase.generate],
             suppress_health_check=list(HealthCheck))(given(strategy)(lambda case: in_time(check, case)))()  # fmt: skip
