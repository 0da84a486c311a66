"""The wheel works outside the checkout, with nothing but itself and the libraries that it asks for."""

import json
import math
import os
import shutil
import site
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("common", "dem", "plate_fem", "analysis", "recognition", "report", "gangue")

VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]


class Installed:
    """The wheel in a virtual environment of its own, where programs run in another directory than the checkout.

    Its libraries are those of the environment that runs the tests, whose link to the checkout stays behind: a path in a
    .pth file brings in packages, but not the .pth files beside them.
    """

    def __init__(self, directory):
        wheels, self.environment, self.work = (directory / name for name in ("wheels", "venv", "work"))
        self.work.mkdir()
        subprocess.run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", str(ROOT),
                        "--wheel-dir", str(wheels)], check=True)
        (wheel,) = wheels.glob("*.whl")
        venv.create(self.environment, symlinks=True)
        self.python = self.environment / "bin" / "python"
        subprocess.run([sys.executable, "-m", "pip", "--python", str(self.python), "install", "--quiet", "--no-deps",
                        "--no-compile", "--no-index", str(wheel)], check=True)
        (packages,) = self.environment.glob("lib/python*/site-packages")
        (packages / "libraries.pth").write_text("\n".join(site.getsitepackages()))
        self.variables = {name: value for name, value in os.environ.items()
                          if name not in ("PYTHONPATH", "LIGGGHTS_BONDED", "MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
        self.variables["XDG_CACHE_HOME"] = str(directory / "cache")

    def run(self, *words):
        """What a program writes to its output."""
        done = subprocess.run([self.python, *map(str, words)], cwd=self.work, env=self.variables, capture_output=True,
                              text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout


INSPECT = """
import importlib, json
from common.resources import resource
from common.tables import InputError
from dem.coupling.launch import ENGINE, check_engine

modules = [importlib.import_module(f"{package}.__main__") for package in PACKAGES if package != "common"]
try:
    check_engine()
    refusal = None
except InputError as error:
    refusal = str(error)
print(json.dumps({"packages": {package: importlib.import_module(package).__file__ for package in PACKAGES},
                  "data": str(resource("")), "engine": str(ENGINE), "refusal": refusal}))
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    return Installed(tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def found(installed):
    """Where the wheel's packages, data and engine are; every command line of it has been imported."""
    return json.loads(installed.run("-c", f"PACKAGES = {PACKAGES}\n{INSPECT}"))


def test_every_package_comes_from_the_wheel_and_is_typed(installed, found):
    for file in map(Path, found["packages"].values()):
        assert installed.environment in file.parents
        assert file.with_name("py.typed").is_file()


@pytest.mark.parametrize("name", ["templates", "scenes", "workflow"])
def test_the_files_beside_the_code_are_there(installed, found, name):
    inside = Path(found["data"]) / name
    assert installed.environment in inside.parents
    assert _files(inside) == _files(ROOT / name)


def _files(directory):
    """All below a directory but what Python compiles."""
    files = (file for file in directory.rglob("*") if file.is_file() and file.parent.name != "__pycache__")
    return {str(file.relative_to(directory)) for file in files}


def test_the_wheel_has_one_command_for_everything(installed):
    command = installed.environment / "bin" / "gangue"
    done = subprocess.run([command, "--version"], cwd=installed.work, env=installed.variables, capture_output=True,
                          text=True, check=True)
    assert done.stdout.split() == ["gangue", VERSION]


def test_a_missing_engine_is_refused_with_the_command_that_builds_it(found):
    assert "gangue build-engine" in found["refusal"]


def test_features_of_a_record_are_those_of_the_checkout(installed, tmp_path):
    record = tmp_path / "record.csv"
    record.write_text("t_s,a_m_s2\n" + "".join(f"{k / 6667:.9f},{(k % 17 - 8) * (-1) ** k}\n" for k in range(400)))
    here = subprocess.run([sys.executable, "-m", "analysis", "features", str(record)], cwd=ROOT, capture_output=True,
                          text=True, check=True)
    assert installed.run("-m", "analysis", "features", record) == here.stdout


def hertz_peak_force_N(scene):
    """(K^2 (5 m v^2 / 4)^3)^(1/5), K = 4/3 E* sqrt(R)."""
    stones, coal = scene["stones"], scene["materials"]["coal"]
    softness = sum((1 - body["poisson_ratio"] ** 2) / body["youngs_modulus_Pa"] for body in (coal, scene["plate"]))
    stiffness = 4 / 3 * stones["radius_m"] ** 0.5 / softness
    mass_kg = 4 / 3 * math.pi * stones["radius_m"] ** 3 * coal["density_kg_m3"]
    return (stiffness**2 * (1.25 * mass_kg * stones["speed_m_s"] ** 2) ** 3) ** 0.2


def check_build_and_run(installed, found):
    """Build the engine and run a scene of the wheel, a sphere on a rigid plate, whose largest force is Hertz'."""
    assert Path(installed.variables["XDG_CACHE_HOME"]) in Path(found["engine"]).parents
    assert installed.run("-m", "dem", "build-engine").split()[-1] == found["engine"]
    shutil.rmtree(installed.work / "run", ignore_errors=True)
    installed.run("-m", "dem", "run", Path(found["data"]) / "scenes" / "hertz_coal.toml", "--out", "run")
    run = json.loads((installed.work / "run" / "run.json").read_text())
    assert run["peak_force_N"] == pytest.approx(hertz_peak_force_N(run["scene"]), rel=1e-3)


@pytest.mark.slow
def test_a_scene_of_the_wheel_runs_on_the_engine_it_builds(installed, found):
    """With what the checkout's engine was made of, copied to be newer than the wheel's sources: make only links."""
    directory = Path(found["engine"]).parent
    directory.mkdir(parents=True)
    for kind in ("*.h", "*.cpp", "*.o"):  # objects come last, as they depend on the others
        for file in (ROOT / "build" / "engine").glob(kind):
            shutil.copy(file, directory)
    check_build_and_run(installed, found)


@pytest.mark.validate
def test_the_wheel_builds_the_engine_from_nothing(installed, found):
    shutil.rmtree(Path(found["engine"]).parent, ignore_errors=True)
    check_build_and_run(installed, found)
