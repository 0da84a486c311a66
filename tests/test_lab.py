"""The laboratory: the product does without it, its results say what made them, and pages have its tables."""

import ast
import os
import warnings
from functools import partial
from pathlib import Path

import pandas as pd
import pytest

from dem.batch.sweep import run_all
from lab import results, tables
from lab.__main__ import age, main, options_of
from lab.cases import CASES
from lab.results import RESULTS, hash_of, read_result, write_result
from lab.study import Row, made

ROOT = Path(__file__).resolve().parents[1]
PRODUCT = ("common", "dem", "plate_fem", "analysis", "recognition", "report", "gangue")
NOT_THE_PRODUCT = {"lab", "tests"}


def imported(text):
    """Top names of what a module imports, at its top or late, and of what it asks importlib or __import__ for."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add(node.module.split(".")[0])
        elif isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in ("import_module", "__import__", "run_module", "find_spec", "resolve_name"):
                found |= {part.value.split(".")[0].split(":")[0] for part in ast.walk(node)
                          if isinstance(part, ast.Constant) and isinstance(part.value, str)}
    return found


@pytest.mark.parametrize("text", [
    "import lab.study", "from lab import cases", "def f():\n    from lab.rock import stone",
    "import importlib\nimportlib.import_module('lab.cases')", "f = __import__('lab')",
    "from importlib import import_module\nimport_module(f'lab.{name}')", "import runpy\nrunpy.run_module('tests.x')"])
def test_every_way_of_importing_is_seen(text):
    assert imported(text) & NOT_THE_PRODUCT


@pytest.mark.parametrize("package", PRODUCT)
def test_the_product_imports_nothing_of_the_laboratory(package):
    wrong = [file.relative_to(ROOT) for file in (ROOT / package).rglob("*.py")
             if imported(file.read_text()) & NOT_THE_PRODUCT]
    assert not wrong


def test_the_wheel_has_no_laboratory():
    import tomllib

    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert not {"/lab", "/tests"} & set(wheel["include"])


@pytest.mark.parametrize("name", CASES)
def test_a_case_has_its_function_and_its_sources(name):
    case = CASES[name]
    assert callable(case.load("rows")) and callable(case.load("table")) and hash_of(case.sources)
    assert all(isinstance(default, (str, int, float, tuple)) for default in options_of(case).values())


def test_results_are_those_of_cases():
    """A result of today's code is told from an older one; which are older is a warning, since they take hours."""
    kept = {file.stem: read_result(file)[0] for file in RESULTS.glob("*.csv")}
    assert set(kept) <= set(CASES)
    for name, head in kept.items():
        assert head["command"].startswith(f"python -m lab run {name}") and head["date"][:2] == "20"
    older = [f"{name} ({head['date']})" for name, head in kept.items() if "older" in age(CASES[name])]
    if older:
        warnings.warn(f"results older than the code they speak of: {', '.join(older)}", stacklevel=1)


def test_a_result_is_older_than_its_code_once_a_source_changes(tmp_path, monkeypatch):
    monkeypatch.setattr(results, "ROOT", tmp_path)
    monkeypatch.setattr(results, "_commit", lambda sources: "abc1234")
    (tmp_path / "engine").mkdir()
    (tmp_path / "engine" / "fix.cpp").write_text("int a;")
    made_of = pd.DataFrame({"a": [1.23456789], "b": ["x, y"]})
    write_result(made_of, tmp_path / "case.csv", "python -m lab run case", ["engine"])
    head, table = read_result(tmp_path / "case.csv")
    assert head["sources"] == hash_of(["engine"]) and table.to_dict("list") == {"a": ["1.23457"], "b": ["x, y"]}
    (tmp_path / "engine" / "fix.cpp").rename(tmp_path / "engine" / "bond.cpp")  # a name is not the code
    assert head["sources"] == hash_of(["engine"])
    (tmp_path / "engine" / "bond.cpp").write_text("int b;")
    assert head["sources"] != hash_of(["engine"])
    with pytest.raises(FileNotFoundError, match="gone"):
        hash_of(["gone"])


def test_no_head_has_the_name_of_a_machine_or_a_path(tmp_path):
    import socket

    write_result(pd.DataFrame({"a": [1]}), tmp_path / "case.csv", "python -m lab run case", ["lab/cases.py"])
    text = (tmp_path / "case.csv").read_text()
    assert str(tmp_path) not in text and str(ROOT) not in text and socket.gethostname() not in text.split()
    assert [line.split(":")[0] for line in text.splitlines()[:5]] == [f"# {key}" for key in results.HEAD]


PAGE = """Before.

<!-- table: impacts where rock=coal | speed_m_s: speed, m/s | area_cm2: broken area, cm²: .1f -->
old
<!-- end -->

After.
"""


@pytest.fixture
def kept(tmp_path):
    table = pd.DataFrame({"rock": ["coal", "coal", "gangue"], "speed_m_s": [3, 4, 3], "area_cm2": [3.84, 260.0, 0.0]})
    write_result(table, tmp_path / "impacts.csv", "python -m lab run impacts", ["lab/cases.py"])
    return tmp_path


def test_a_page_has_the_table_of_a_result(kept):
    page = tables.rendered(PAGE, kept)
    rows = "|speed, m/s|broken area, cm²|\n|---|---|\n|3|3.8|\n|4|260.0|\n"
    assert f"{rows}\n`python -m lab run impacts`, 20" in page and "old" not in page and "gangue" not in page
    assert page.startswith("Before.") and page.endswith("<!-- end -->\n\nAfter.\n")
    assert tables.rendered(page, kept) == page


@pytest.mark.parametrize(("old", "new", "said"), [
    ("impacts", "other", "no such result"), ("area_cm2:", "area:", "no column 'area'"),
    ("rock=", "stone=", "no column 'stone'"), ("=coal", "=chalk", "no row")])
def test_a_table_that_is_not_there_is_refused(kept, old, new, said):
    with pytest.raises(ValueError, match=said):
        tables.rendered(PAGE.replace(old, new), kept)


def test_check_tells_a_page_with_another_table(kept, monkeypatch, capsys):
    monkeypatch.setattr(tables, "RESULTS", kept)
    page = kept / "page.md"
    page.write_text(PAGE)
    assert tables.main(["--check", str(page)]) == 1 and page.read_text() == PAGE
    assert "page.md" in capsys.readouterr().out
    assert tables.main([str(page)]) == 0 and tables.main(["--check", str(page)]) == 0 and page.read_text() != PAGE


def test_pages_have_the_tables_of_the_results():
    assert tables.main(["--check"]) == 0


def test_rows_are_made_once_and_kept_as_they_come(tmp_path):
    made_now = []

    def row(name, value, fails=False):
        def work():
            if fails:
                raise RuntimeError(name)
            made_now.append(name)
            return {"found": value}
        return Row({"name": name, "noise": None, "share": 0.1 + 0.2}, work)

    file = tmp_path / "rows.csv"
    with pytest.raises(RuntimeError, match="b"):
        made([row("a", 1.5), row("b", 2.5, fails=True)], file)
    table = made([row("a", 1.5), row("b", 2.5)], file)
    assert made_now == ["a", "b"] and table["found"].tolist() == [1.5, 2.5]
    assert made([row("b", 2.5)], file)["found"].tolist() == [2.5] and made_now == ["a", "b"]
    assert made([row(str(k), k) for k in range(4)], tmp_path / "others.csv", jobs=2)["found"].tolist() == [0, 1, 2, 3]


def test_rows_made_side_by_side_may_start_processes(tmp_path):
    def work():
        return {"found": list(run_all([partial(int, "3")], 1, os.open(tmp_path, os.O_RDONLY)))[0][2]}

    assert made([Row({"k": k}, work) for k in (1, 2)], tmp_path / "rows.csv", jobs=2)["found"].tolist() == [3, 3]


def test_list_names_every_case_and_a_wrong_word_is_refused(capsys):
    assert main(["list"]) == 0
    said = capsys.readouterr().out
    assert all(f"{name} " in said and age(case) in said for name, case in CASES.items())
    for words, reason in ((["none"], "case 'none'"), (["tolerance", "x=1"], "option 'x'"),
                          (["two_stones", "packings=1"], "options need --out")):
        with pytest.raises(SystemExit) as ended:
            main(["run", *words])
        assert ended.value.code == 2 and reason in capsys.readouterr().err
