"""The cache of a user: found once, shared by processes, never trusted when damaged, bounded."""

import ast
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from common.files import cache
from common.files.cache import BeingFound, cached, entry_file, key_of, not_waiting, used_modules
from common.process.messages import PACKAGES

ROOT = Path(__file__).resolve().parents[1]
KEY = key_of(Path(__file__), "a key")
ARRAYS = {"values": np.arange(1000) / 7, "scalar": np.float64(3.0), "turned": np.arange(12.0).reshape(3, 4).T}

ASK = """
import sys, time
from pathlib import Path
import numpy as np
from common.files.cache import cached
directory, key, log = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
def find():
    with log.open("a") as file:
        file.write("found\\n")
    time.sleep(float(sys.argv[4]))
    return {"values": np.arange(1000) / 7}
print(cached(directory, "test", key, find)["values"].sum())
"""


def ask(tmp_path, seconds):
    """A process that asks for KEY and takes `seconds` to find it."""
    command = [sys.executable, "-c", ASK, str(tmp_path / "cache"), KEY, str(tmp_path / "log"), str(seconds)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


@pytest.mark.slow
def test_many_processes_find_an_entry_once(tmp_path):
    processes = [ask(tmp_path, 0.5) for _ in range(5)]
    assert {float(p.communicate(timeout=60)[0]) for p in processes} == {ARRAYS["values"].sum()}
    assert (tmp_path / "log").read_text() == "found\n"


def test_a_process_that_is_killed_while_it_finds_holds_up_nobody(tmp_path):
    first = ask(tmp_path, 1000)
    while not (tmp_path / "log").exists():
        assert first.poll() is None
        time.sleep(0.01)
    second = ask(tmp_path, 0)
    first.send_signal(signal.SIGKILL)
    assert float(second.communicate(timeout=60)[0]) == ARRAYS["values"].sum()
    first.communicate()
    assert (tmp_path / "log").read_text() == "found\nfound\n"


def test_who_does_not_wait_is_told_that_another_process_finds_the_entry(tmp_path):
    first = ask(tmp_path, 1000)
    while not (tmp_path / "log").exists():
        assert first.poll() is None
        time.sleep(0.01)
    with not_waiting(), pytest.raises(BeingFound):
        cached(tmp_path / "cache", "test", KEY, lambda: pytest.fail("found beside another"))
    first.kill()
    first.communicate()
    with not_waiting():
        assert len(cached(tmp_path / "cache", "test", KEY, lambda: ARRAYS)) == 3


def test_what_is_kept_is_the_same_to_the_bit_and_in_its_order(tmp_path):
    found = cached(tmp_path, "test", KEY, lambda: ARRAYS)
    kept = cached(tmp_path, "test", KEY, lambda: pytest.fail("found again"))
    for name, value in ARRAYS.items():
        assert found[name].tobytes() == kept[name].tobytes() == np.asarray(value).tobytes()
        assert found[name].strides == kept[name].strides


def _cut(data):
    return data[: len(data) // 2]


def _one_bit(data):
    return data[:-300] + bytes([data[-300] ^ 1]) + data[-299:]


@pytest.mark.parametrize("damage", [_cut, _one_bit, lambda data: b"", lambda data: b"x" * 32 + data[32:]])
def test_a_damaged_file_is_made_anew(tmp_path, damage):
    cached(tmp_path, "test", KEY, lambda: ARRAYS)
    file = entry_file(tmp_path, "test", KEY)
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    again = cached(tmp_path, "test", KEY, lambda: ARRAYS)
    assert np.array_equal(again["values"], ARRAYS["values"]) and file.read_bytes() == whole


def test_an_entry_under_another_name_is_foreign(tmp_path):
    cached(tmp_path, "test", KEY, lambda: ARRAYS)
    other = key_of(Path(__file__), "another key")
    entry_file(tmp_path, "test", KEY).rename(entry_file(tmp_path, "test", other))
    assert cached(tmp_path, "test", other, lambda: {"values": np.zeros(2)})["values"].tolist() == [0, 0]


def test_what_was_not_used_for_longest_makes_room(tmp_path, monkeypatch):
    keys = [key_of(tmp_path / "code.py", number) for number in range(4)]
    cached(tmp_path, "test", keys[0], lambda: ARRAYS)
    monkeypatch.setattr(cache, "LARGEST_MB", 3.5e-6 * entry_file(tmp_path, "test", keys[0]).stat().st_size)
    half_written = entry_file(tmp_path, "test", keys[0]).with_suffix(".cache.99.part")
    others = [tmp_path / name for name in ("thesis.cache", "notes.cache.txt", "modes-1.cache", f"x-{KEY}.cache.bak")]
    for file in (half_written, *others):
        file.write_bytes(b"x")
        os.utime(file, (0, 0))
    for number, key in enumerate(keys[:3]):
        cached(tmp_path, "test", key, lambda: ARRAYS)
        os.utime(entry_file(tmp_path, "test", key), (number, number))
    cached(tmp_path, "test", keys[0], lambda: pytest.fail("found again"))  # used now
    cached(tmp_path, "test", keys[3], lambda: ARRAYS)
    assert [entry_file(tmp_path, "test", key).exists() for key in keys] == [True, False, True, True]
    assert not half_written.exists()
    assert all(file.exists() for file in others)  # of the user's, who shares the directory


def test_without_a_place_to_write_results_are_found_and_a_warning_tells(tmp_path):
    (tmp_path / "file").write_text("no directory")
    with pytest.warns(UserWarning, match="nothing is kept"):
        assert np.array_equal(cached(tmp_path / "file", "test", KEY, lambda: ARRAYS)["values"], ARRAYS["values"])


def test_a_find_that_fails_leaves_nothing(tmp_path):
    with pytest.raises(ZeroDivisionError):
        cached(tmp_path, "test", KEY, lambda: {"values": 1 // 0})
    assert not entry_file(tmp_path, "test", KEY).exists()
    assert len(cached(tmp_path, "test", KEY, lambda: ARRAYS)) == 3


@pytest.mark.parametrize("name", ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"])
def test_what_was_found_with_other_threads_is_another_entry(tmp_path, monkeypatch, name):
    """Modes of the paper's plate differ in their last bits, and after 0.6 s the bonds that break."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    keys = set()
    for threads in ("1", "2", "1"):
        monkeypatch.setenv(name, threads)
        keys.add(key_of(tmp_path / "code.py", "modes"))
    assert len(keys) == 2


KEPT_BY = ["dem/stones/contact_patch.py", "plate_fem/modes.py", "dem/stones/packing.py"]


@pytest.mark.parametrize("code, used, unused", [
    (KEPT_BY[0], "common/scene/stones.py", "plate_fem/solution/eigen.py"),
    (KEPT_BY[2], "dem/stones/solids.py", "dem/stones/bonds.py"),
    (KEPT_BY[1], "plate_fem/solution/model.py", "plate_fem/commands.py"),
    (KEPT_BY[1], "common/scene/plate.py", "common/scene/scene.py")])
def test_the_key_is_another_where_a_module_that_is_used_has_changed(tmp_path, code, used, unused):
    keys = []
    for number, changed in enumerate([None, unused, used]):
        copy = tmp_path / str(number)
        for package in ("common", "dem/stones", "plate_fem", "analysis"):
            shutil.copytree(ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__", "data"))
        (copy / "dem" / "__init__.py").touch()
        if changed:
            (copy / changed).write_text((copy / changed).read_text() + "# changed\n")
        keys.append(key_of(copy / code, 1))
    assert keys[0] == keys[1] == key_of(ROOT / code, 1) != keys[2]


def parsed(file, found):
    """Files that a module imports of the packages, by Python's own parser."""
    if file in found or not file.is_file():
        return found
    found.add(file)
    for node in ast.walk(ast.parse(file.read_text())):
        names = [node.module] if isinstance(node, ast.ImportFrom) else []
        names += [f"{node.module}.{one.name}" for one in node.names] if names else []
        names += [one.name for one in node.names] if isinstance(node, ast.Import) else []
        for name in names:
            if name.split(".")[0] in PACKAGES:
                place = ROOT.joinpath(*name.split("."))
                parsed(place.with_suffix(".py"), found)
                parsed(place / "__init__.py", found)
    return found


@pytest.mark.slow
def test_modules_that_are_used_are_those_that_the_parser_finds():
    for code in [*KEPT_BY, "dem/run/run.py", "report/page.py", "recognition/methods.py"]:
        assert set(used_modules(ROOT / code)) == parsed(ROOT / code, set()), code
