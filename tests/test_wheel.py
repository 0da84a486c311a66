"""The wheel works outside the checkout, with nothing but itself and the libraries that it asks for."""

import json
import os
import shutil
import site
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("common", "dem", "plate_fem", "analysis", "recognition", "report")
RECORD = ROOT / "tests" / "recognition" / "data" / "impacts.parquet"


class Installed:
    """The wheel in a virtual environment of its own, where programs run in another directory than the checkout.

    The libraries are those of the environment that runs the tests, whose own link to the checkout is left behind: a path
    in a .pth file brings in packages, but not the .pth files beside them.
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
                        "--no-index", str(wheel)], check=True)
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

    def value(self, code):
        """What an expression prints, in Python with common.resources.resource."""
        return self.run("-c", f"from common.resources import resource; print({code})").strip()


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    return Installed(tmp_path_factory.mktemp("wheel"))


def test_every_package_comes_from_the_wheel_and_is_typed(installed):
    for package in PACKAGES:
        file = Path(installed.run("-c", f"import {package}; print({package}.__file__)").strip())
        assert installed.environment in file.parents
        assert file.with_name("py.typed").is_file()


def test_the_files_beside_the_code_are_there(installed):
    for name in ("templates", "scenes", "workflow"):
        inside = Path(installed.value(f"resource({name!r})"))
        assert installed.environment in inside.parents
        files = {str(file.relative_to(ROOT / name)) for file in (ROOT / name).rglob("*") if file.is_file()}
        assert {str(file.relative_to(inside)) for file in inside.rglob("*") if file.is_file()} == files


@pytest.mark.parametrize("package", ["plate_fem", "analysis", "recognition", "report", "dem"])
def test_every_command_answers(installed, package):
    assert f"python -m {package}" in installed.run("-m", package, "--help")


def test_features_of_a_record_are_those_of_the_checkout(installed, tmp_path):
    record = tmp_path / "record.csv"
    record.write_text("t_s,a_m_s2\n" + "".join(f"{k / 6667:.9f},{(k % 17 - 8) * (-1) ** k}\n" for k in range(400)))
    here = subprocess.run([sys.executable, "-m", "analysis", "features", str(record)], cwd=ROOT, capture_output=True,
                          text=True, check=True)
    assert installed.run("-m", "analysis", "features", record) == here.stdout


def test_a_run_without_the_engine_says_how_to_get_it(installed):
    done = subprocess.run([installed.python, "-m", "dem", "run", installed.value("resource('scenes/hertz_coal.toml')"),
                           "--out", "none"], cwd=installed.work, env=installed.variables, capture_output=True, text=True,
                          check=False)
    assert done.returncode == 2
    assert "python -m dem build-engine" in done.stderr


def run_hertz_coal(installed):
    """Build the engine and run the scene of the wheel; the force is Hertz' for a sphere on a rigid plate."""
    engine = Path(installed.run("-m", "dem", "build-engine").split()[-1])
    assert engine.parent.parent == Path(installed.variables["XDG_CACHE_HOME"]) / "coal-gangue-impact"
    shutil.rmtree(installed.work / "run", ignore_errors=True)
    installed.run("-m", "dem", "run", installed.value("resource('scenes/hertz_coal.toml')"), "--out", "run")
    return json.loads((installed.work / "run" / "run.json").read_text())


def hertz_peak_force_N(scene):
    """(K^2 (5 m v^2 / 4)^3)^(1/5), K = 4/3 E* sqrt(R)."""
    stones, plate, coal = scene["stones"], scene["plate"], scene["materials"]["coal"]
    softness = sum((1 - body["poisson_ratio"] ** 2) / body["youngs_modulus_Pa"] for body in (coal, plate))
    mass = 4 / 3 * 3.141592653589793 * stones["radius_m"] ** 3 * coal["density_kg_m3"]
    stiffness = 4 / 3 * stones["radius_m"] ** 0.5 / softness
    return (stiffness**2 * (1.25 * mass * stones["speed_m_s"] ** 2) ** 3) ** 0.2


def test_a_scene_of_the_wheel_runs_on_the_engine_it_builds(installed):
    """With the object files of the checkout's engine, newer than the sources of the wheel, so that make only links."""
    directory = Path(installed.run("-c", "from dem.coupling.launch import ENGINE; print(ENGINE.parent)").strip())
    directory.mkdir(parents=True)
    for file in (ROOT / "build" / "engine").iterdir():
        if file.suffix in (".h", ".o"):
            shutil.copy(file, directory)
    run = run_hertz_coal(installed)
    assert run["peak_force_N"] == pytest.approx(hertz_peak_force_N(run["scene"]), rel=2e-3)


@pytest.mark.validate
def test_the_wheel_builds_the_engine_from_nothing(installed):
    shutil.rmtree(Path(installed.variables["XDG_CACHE_HOME"]) / "coal-gangue-impact", ignore_errors=True)
    run = run_hertz_coal(installed)
    assert run["peak_force_N"] == pytest.approx(hertz_peak_force_N(run["scene"]), rel=2e-3)
