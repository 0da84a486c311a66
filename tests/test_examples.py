"""Public names of the packages, and the examples in their docstrings, which run where scenes/ and runs/paper are."""

import doctest
import logging
import re
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest

from tests.analysis.synthetic import write_sweep
from tests.test_docs import calibrate_at_once

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ["analysis", "plate_fem", "recognition"]
OTHERS = ["common.hertz", "common.scene.scene", "report.page", "gangue.__main__"]  # that export nothing


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    directory = tmp_path_factory.mktemp("examples")
    write_sweep(directory / "runs" / "paper")
    (directory / "scenes").symlink_to(ROOT / "scenes")
    return directory


@pytest.fixture(scope="module")
def start():
    """What is known after the lines that docs/from_python.md gives for the examples."""
    text = (ROOT / "docs" / "from_python.md").read_text()
    (lines,) = re.findall(r"Examples in docstrings .*?```python\n(.*?)```", text, re.DOTALL)
    names = {}
    exec(lines, names)  # noqa: S102  our own page
    return names


@pytest.mark.parametrize("package", [*PACKAGES, "dem"])
def test_a_package_shows_what_it_exports(package):
    module = import_module(package)
    names = dir(module)
    modules = {found.name for found in iter_modules(module.__path__)}
    assert not modules & set(names), "a module that is imported would take the place of what has its name"
    assert names == sorted(module.__all__) and len(names) == len(set(names)) > 4
    assert all(getattr(module, name) is not None for name in names)
    with pytest.raises(AttributeError, match=f"'{package}' has no attribute 'nothing'"):
        module.nothing  # noqa: B018


@pytest.mark.parametrize("package, name", [
    (package, name) for package in PACKAGES for name in dir(import_module(package)) if not name.isupper()])
def test_the_example_of_a_public_name_runs(package, name, here, start, monkeypatch):
    monkeypatch.chdir(here)
    (found,) = doctest.DocTestFinder(recurse=False).find(getattr(import_module(package), name), name, globs=dict(start))
    assert found.examples, f"{package}.{name} has no example"
    assert doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(found).failed == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.validate] if name == "campaign" else [])
                                  for name in dir(import_module("dem"))])
def test_the_example_of_a_command_that_runs_the_engine_runs(name, tmp_path, monkeypatch):
    """A calibration with the strengths of the shipped gangue, which its targets are."""
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(logging.root.manager, "disable", logging.INFO)  # a command that ran here may have turned it on
    calibrate_at_once(monkeypatch, compressive_Pa=34.51e6, tensile_Pa=4.93e6)
    command = getattr(import_module("dem"), name)
    names = dict(vars(import_module(command.__module__)))
    (found,) = doctest.DocTestFinder(recurse=False).find(command, name, globs=names)
    assert found.examples and doctest.DocTestRunner().run(found).failed == 0


@pytest.mark.parametrize("module", OTHERS)
def test_the_examples_of_other_packages_run(module, here, monkeypatch):
    monkeypatch.chdir(here)
    found = [test for test in doctest.DocTestFinder().find(import_module(module)) if test.examples]
    assert found and all(doctest.DocTestRunner().run(test).failed == 0 for test in found)
