"""What once hung, filled the memory or ended in a traceback ends with one line."""

import contextlib
import os
import re
import resource
import subprocess
import sys
import tomllib
import tracemalloc

import numpy as np
import pandas as pd
import pytest

import analysis.__main__
import plate_fem.__main__
import recognition.__main__
import report.__main__
from analysis import RecordError, read_run
from analysis.sweep.breakage import read_network
from common.scene.scene import changed_scene
from common.tables import InputError, Refused
from dem.__main__ import main
from dem.deck.plausible import momentum_warnings, unfinished_warnings, warnings_of, warnings_of_plate
from dem.stones.arrangement import stones_of
from plate_fem.__main__ import main as modes_of
from plate_fem.elements.mesh import default_mesh_size, mesh_lines
from recognition.plate.plate_model import PlateModel
from report.film.pictures import instants, read_arrays
from report.missing import MissingResult
from tests.analysis.synthetic import write_run, write_sweep
from tests.fuzz.mutations import outcome
from tests.report.synthetic_view import write_view
from tests.robustness.small import HERTZ, ROOT, SCENES, run


def ends_with_one_line(entry, arguments, code=2):
    """Returns the line."""
    found, errors = outcome(entry, [str(argument) for argument in arguments])
    errors = re.sub("(?m)^warning: .*\n", "", errors)
    assert found == code and errors.count("\n") == 1 and "Traceback" not in errors, (found, errors)
    return errors


@pytest.mark.parametrize("jobs", ["0", "-1", "1e3", "many", "99999999"])
@pytest.mark.parametrize("command", ["sweep", "dataset", "campaign"])
def test_no_run_at_a_time_or_too_many(tmp_path, command, jobs):
    assert "--jobs" in ends_with_one_line(main, [command, HERTZ, "--out", tmp_path / "out", "--jobs", jobs])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("rate", ["1e7", "1e9", "1e12", "1e300", "inf", "nan", "0", "-5"])
def test_a_rate_that_no_memory_holds(tmp_path, rate):
    write_run(tmp_path / "ratio_030", 0.3)
    told = ends_with_one_line(analysis.__main__.main, ["features", tmp_path / "ratio_030", "--resample", rate])
    assert told.startswith(f"--resample {float(rate):g}: ") and "at most 1000 times" in told


@pytest.mark.parametrize("change, words", [("stones.speed_m_s=1.7e308", ["stones.speed_m_s = 1.7e+308", "1000"]),
                                           ('materials.coal="' + 300 * "x" + '"', ["materials.coal", "xxx"])])
def test_a_speed_that_no_number_holds_squared_and_a_name_that_no_file_can_have(tmp_path, change, words):
    line = ends_with_one_line(main, ["deck", SCENES / "single.toml", "--set", change, "--out", tmp_path / "out"])
    assert all(word in line for word in words) and not any(tmp_path.iterdir())


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/random", "pipe"])
def test_devices_and_pipes_are_not_read(tmp_path, device):
    if device == "pipe":
        device = tmp_path / "pipe"
        os.mkfifo(device)
    for entry, arguments in [(main, ["deck", device, "--out", tmp_path / "out"]),
                             (main, ["sweep", device, "--out", tmp_path / "out"]),
                             (plate_fem.__main__.main, ["modes", device]),
                             (analysis.__main__.main, ["features", device]),
                             (recognition.__main__.main, ["recognise", tmp_path, "--model", device])]:
        assert str(device) in ends_with_one_line(entry, arguments)
    assert not (tmp_path / "out").exists()


def test_a_mesh_that_is_a_pipe_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "mesh.stl")
    (tmp_path / "scene.toml").write_text(
        f"base = '{SCENES / 'sizes.toml'}'\nstones.agglomerate.contact = 'faces'\nshapes.pipe = 'mesh.stl'\n"
        "[[stones.each]]\nmaterial = 'coal'\nshape = 'pipe'\nradius_m = 0.03\nplace_m = [0.1, 0.0]\n"
        "velocity_m_s = 3.0\n")
    told = ends_with_one_line(main, ["deck", tmp_path / "scene.toml", "--out", tmp_path / "out"])
    assert "mesh.stl: must be a regular file" in told and not (tmp_path / "out").exists()


@pytest.mark.parametrize("put", [os.mkfifo, os.mkdir])
def test_what_is_no_file_in_a_run_is_not_read(tmp_path, put):
    run = write_run(tmp_path / "ratio_050", 0.5)
    write_view(run)
    readers = {"signals.parquet": lambda: read_run(run), "breakage.parquet": lambda: read_run(run).breakage,
               "run.json": lambda: read_run(run), "deck/atoms.data": lambda: read_network(read_run(run)),
               "deck/bonds.txt": lambda: read_network(read_run(run)), "view.pvd": lambda: instants(run),
               "view/plate_0000.vtu": lambda: read_arrays(run / "view" / "plate_0000.vtu", ["points"])}
    for name, read in readers.items():
        (run / name).rename(tmp_path / "kept")
        put(run / name)
        with pytest.raises((RecordError, MissingResult, OSError)):
            read()
        (os.rmdir if put is os.mkdir else os.unlink)(run / name)
        (tmp_path / "kept").rename(run / name)
        read()


DEEP = ".".join(["a"] * 5000)


@pytest.mark.parametrize("text, words", [
    (f"seed = {'1' * 5001}", "digits"), (f"seed = 0x{'f' * 5000}", "digits"), (f"[{DEEP}]\nx = 1", "deep"),
    (f"{DEEP} = 1", "deep"), (f"x = {'[' * 300}{']' * 300}", "deep"), (f"x = {'{a=' * 300}1{'}' * 300}", "deep"),
])
def test_numbers_and_tables_beyond_all_measure(tmp_path, text, words):
    scene, campaign = tmp_path / "scene.toml", tmp_path / "campaign.toml"
    scene.write_text(f"{text}\n")
    (tmp_path / "base.toml").write_text("base = 'scene.toml'\n")
    campaign.write_text(f"scene = 'scene.toml'\n{text}\n")
    for entry, arguments in [(main, ["deck", scene, "--out", tmp_path / "out"]),
                             (main, ["deck", tmp_path / "base.toml", "--out", tmp_path / "out"]),
                             (main, ["campaign", campaign, "--out", tmp_path / "out"]),
                             (plate_fem.__main__.main, ["modes", scene])]:
        told = ends_with_one_line(entry, arguments)
        assert words in told and len(told) < 1000
    assert not (tmp_path / "out").exists()


def test_keys_and_values_beyond_all_measure_are_not_set(tmp_path):
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(f"scene = '{HERTZ}'\n[vary]\n'{DEEP}' = [1]\n")
    ends_with_one_line(main, ["campaign", campaign, "--out", tmp_path / "out"])
    for change in (f"{DEEP}=1", f"stones.seed={'1' * 5001}", f"stones.seed=0x{'f' * 5000}",
                   f"stones.each={'[' * 100}{']' * 100}"):
        ends_with_one_line(main, ["deck", HERTZ, "--set", change, "--out", tmp_path / "out"])
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ["run", "deck", "sweep"])
def test_a_path_that_is_no_text_is_refused_before_anything_is_done(tmp_path, command):
    before = sorted(os.listdir(os.fsencode(tmp_path)))
    told = ends_with_one_line(main, [command, HERTZ, "--out", os.fsdecode(os.fsencode(tmp_path) + b"/o\xff")])
    assert "UTF-8" in told and sorted(os.listdir(os.fsencode(tmp_path))) == before


def test_a_plate_that_the_engine_does_not_take(tmp_path):
    negative = ["--set", "plate.poisson_ratio=-0.9", "--out", tmp_path / "out"]
    assert "plate.poisson_ratio = -0.9" in ends_with_one_line(main, ["run", HERTZ, *negative])
    assert not list(tmp_path.iterdir())
    auxetic = (SCENES / "paper.toml").read_text().replace("poisson_ratio = 0.3   ", "poisson_ratio = -0.3  ")
    (tmp_path / "scene.toml").write_text(auxetic)
    assert "plate.poisson_ratio = -0.3" in ends_with_one_line(modes_of, ["modes", tmp_path / "scene.toml"])


@pytest.mark.parametrize("diameter_m", [2e-5, 2e-6, 1e-9])
def test_a_rod_too_thin_for_any_mesh_is_refused_at_once(diameter_m):
    rod = {"place_m": [0.05, 0.03], "diameter_m": diameter_m, "length_m": 0.1, "youngs_modulus_Pa": 2e11,
           "density_kg_m3": 7830.0}
    plate = changed_scene(SCENES / "elastic_plate.toml", {"plate.rods": [rod]}).plate
    tracemalloc.start()
    with pytest.raises(Refused, match="must leave"):
        mesh_lines(plate)
    assert tracemalloc.get_traced_memory()[1] < 5e6  # bytes: no line more than it takes to see that they are too many
    tracemalloc.stop()


def test_a_record_with_times_in_ms_is_refused(tmp_path):
    plate = PlateModel.from_scene(SCENES / "elastic_plate.toml", 1000.0)
    plate.save(tmp_path / "plate.json")
    rng = np.random.default_rng(1)
    table = {"t_s": 1e3 * np.arange(500) / 20000} | {f"acc_{name}_m_s2": rng.normal(size=500)
                                                      for name in plate.sensor_names}
    pd.DataFrame(table).to_csv(tmp_path / "ms.csv", index=False)
    told = ends_with_one_line(recognition.__main__.main, ["check", tmp_path / "ms.csv", "--plate",
                                                          tmp_path / "plate.json"])
    assert "20 samples a second" in told and "read in s: a column in ms must be called t [ms]" in told


@pytest.mark.parametrize("fault", ['RuntimeError("can\'t start new thread")', "MemoryError()",
                                   'ImportError("x.so: failed to map segment from shared object")'])
def test_too_little_memory_for_a_thread_or_a_library(fault):
    done = subprocess.run([sys.executable, "-c", "from common.process.command import run_command\n"
                           f"def fails(): raise {fault}\n"
                           "raise SystemExit(run_command('dem', fails))"], cwd=ROOT, capture_output=True, text=True,
                          check=False)
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and "not enough memory" in done.stderr


def test_a_scene_of_a_gigabyte_is_not_read(tmp_path):
    file = tmp_path / "scene.toml"
    with open(file, "wb") as sparse:
        sparse.truncate(10**9)
    assert "MB" in ends_with_one_line(main, ["deck", file, "--out", tmp_path / "out"])


def test_a_deck_that_is_there_is_refused_before_any_work(tmp_path, monkeypatch):
    monkeypatch.setattr("dem.commands.prepare", None)
    told = ends_with_one_line(main, ["deck", SCENES / "elastic_plate.toml", "--out", tmp_path])
    assert told == f"--out = {tmp_path}: must not exist yet\n"


@pytest.mark.parametrize("where", [".", "..", "/"])
def test_resume_of_no_run(where):
    told = ends_with_one_line(main, ["resume", where])
    assert told == f"--out = {where}: must not be the working directory or one above it\n"


@pytest.mark.parametrize("key, value, words", [
    ("materials.coal.density_kg_m3", 1e300, "osmium"),
    ("plate.density_kg_m3", 1e300, "osmium"),
    ("plate.density_kg_m3", 1e-300, "aerographene"),
    ("contacts.coal_plate.friction", 1e30, "rubber"),
    ("materials.coal.bond.tensile_strength_Pa", 3e-6, "loose"),
    ("materials.coal.bond.shear_strength_Pa", 3e-6, "loose"),
])
def test_physics_that_cannot_be_is_refused_with_its_reason(key, value, words):
    with pytest.raises(InputError, match=words) as refused:
        changed_scene(SCENES / "single.toml", {key: value})
    assert key.split(".")[-1] in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("key, last, first", [  # the last value that is taken, the first that is not
    ("materials.coal.density_kg_m3", 25_000.0, 25_001.0), ("plate.density_kg_m3", 25_000.0, 25_001.0),
    ("materials.gangue.density_kg_m3", 0.1, 0.099), ("plate.density_kg_m3", 0.1, 0.099),
    ("contacts.coal_plate.friction", 10.0, 10.01), ("materials.coal.bond.youngs_modulus_Pa", 5e6, 4.99e6),
    ("stones.radius_m", 5.0, 25.0), ("stones.agglomerate.damping_ratio", 1.0, 5.0),  # of mm and of percent
    ("materials.coal.bond.tensile_strength_Pa", 100.0, 99.9), ("materials.gangue.bond.shear_strength_Pa", 100.0, 99.9),
])
def test_limits_of_docs_safety(key, last, first):
    changed_scene(SCENES / "single.toml", {key: last})
    with pytest.raises(InputError, match=key.split(".")[-1]):
        changed_scene(SCENES / "single.toml", {key: first})


@pytest.mark.parametrize("key, value", [("plate.youngs_modulus_Pa", 1.7e308), ("plate.youngs_modulus_Pa", 1e200),
                                        ("plate.thickness_m", 1e-100), ("plate.density_kg_m3", 1e-300)])
def test_a_plate_of_which_no_modes_can_be_found(tmp_path, key, value):
    out = tmp_path / "out"
    told = ends_with_one_line(main, ["deck", SCENES / "small.toml", "--set", f"{key}={value}", "--out", out])
    assert "plate." in told and not (tmp_path / "out").exists()


def test_a_wavelength_that_no_float_holds():
    plate = changed_scene(SCENES / "small.toml", {"plate.max_frequency_Hz": 5e-324}).plate
    assert default_mesh_size(plate) == plate.size_m[0] / 4


def test_a_co_step_that_no_float_holds(tmp_path):
    huge = ["--set", f"time.co_step={10**400}", "--out", tmp_path / "out"]
    assert "time.co_step = 1000" in ends_with_one_line(main, ["deck", SCENES / "hertz_coal.toml", *huge])


@pytest.mark.parametrize("arrival_s", ["1e300", "1.01e6"])
def test_a_stone_that_arrives_after_all_time(tmp_path, arrival_s):
    each = f"stones.each=[{{material='coal',radius_m=0.03,place_m=[0.1,0.0],velocity_m_s=3.0,arrival_s={arrival_s}}}]"
    told = ends_with_one_line(main, ["deck", SCENES / "sizes.toml", "--set", each, "--out", tmp_path / "out"])
    assert f"stone 1 arrives at {float(arrival_s):g} s" in told and not (tmp_path / "out").exists()


def test_a_stone_that_spins_faster_than_anything(tmp_path):
    each = "stones.each=[{material='coal',radius_m=0.03,place_m=[0.1,0.0],velocity_m_s=3.0,spin_rad_s=[0.0,1e9,0.0]}]"
    told = ends_with_one_line(main, ["deck", SCENES / "sizes.toml", "--set", each, "--out", tmp_path / "out"])
    assert "stones.each.0.spin_rad_s" in told and "100000" in told


@pytest.mark.parametrize("changes, words", [
    ({"stones.speed_m_s": 1000.0}, ["strains coal", "small strains", "Hertz"]),
    ({"materials.coal.youngs_modulus_Pa": 5e12}, ["materials.coal.youngs_modulus_Pa = 5e+12", "diamond"]),
    ({"materials.coal.bond.youngs_modulus_Pa": 5e12}, ["materials.coal.bond.youngs_modulus_Pa", "diamond"]),
    ({"plate.youngs_modulus_Pa": 5e12}, ["plate.youngs_modulus_Pa", "diamond"]),
    ({"plate.rods": [{"place_m": [0.1, 0.0], "diameter_m": 0.02, "length_m": 0.1, "youngs_modulus_Pa": 5e12,
                      "density_kg_m3": 7830.0}]}, ["plate.rods.0.youngs_modulus_Pa", "diamond"]),
    ({"materials.coal.bond.tensile_strength_Pa": 200.0}, ["own weight"]),
    ({"materials.coal.density_kg_m3": 1.38}, ["materials.coal.density_kg_m3 = 1.38", "cork"]),  # g/cm^3
    ({"stones.gap_m": 0.5}, ["time.duration_s = 0.006", "before stone 1 touches"]),
    ({"plate.density_kg_m3": 7.83}, ["plate.density_kg_m3 = 7.83", "cork"]),
    ({"contacts.coal_plate.friction": 5.0}, ["contacts.coal_plate.friction = 5", "rubber"]),
    ({"stones.radius_m": 0.26}, ["radius of 0.26 m", "shorter side is 0.5 m"]),
    ({"time.gravity_m_s2": 9810.0}, ["time.gravity_m_s2 = 9810", "Jupiter"]),  # mm/s^2
    ({"materials.coal.bond.tensile_strength_Pa": 5e12}, ["tensile_strength_Pa = 5e+12", "without flaws"]),
    ({"materials.shale": "gangue"}, ["materials.shale", "stones.each"]),
])
def test_physics_beyond_the_laws_is_warned_of(changes, words):
    scene = changed_scene(SCENES / "single.toml", changes)
    said = "\n".join(warnings_of(scene, stones_of(scene, "scene")))
    assert all(word in said for word in words), said


COAL_Pa, COAL_kg_m3, PLATE_Pa, RADIUS_m, NU2 = 5.12e9, 1380.0, 2.07e11, 0.025, 0.09  # of single.toml
CONTACT_Pa = 1 / ((1 - NU2) / COAL_Pa + (1 - NU2) / PLATE_Pa)
STONE_kg = COAL_kg_m3 * 4 / 3 * np.pi * RADIUS_m**3


@pytest.mark.parametrize("key, limit, words, bonded", [
    ("materials.coal.youngs_modulus_Pa", 1.22e12, "diamond", True),
    # A fiftieth of the speed of a wave along a bar, sqrt(E / rho).
    ("stones.speed_m_s", 0.02 * np.sqrt(COAL_Pa / COAL_kg_m3), "small strains", True),
    # Hertz: (15 m v^2 / (16 E* R^(1/2)))^(2/5) = R / 10 (Johnson, Contact Mechanics, eq. 11.23).
    ("stones.speed_m_s", np.sqrt(16 * CONTACT_Pa * RADIUS_m**3 * 0.1**2.5 / (15 * STONE_kg)), "Hertz", False),
    # The pressure below a column as high as the stone.
    ("materials.coal.bond.tensile_strength_Pa", COAL_kg_m3 * 9.81 * 2 * RADIUS_m, "own weight", True),
])
def test_warnings_begin_where_docs_safety_says(key, limit, words, bonded):
    changes = {} if bonded else {"stones.agglomerate": None}
    below, above = (changed_scene(SCENES / "single.toml", changes | {key: float(factor * limit)})
                    for factor in (0.999, 1.001))
    warned = [any(words in line for line in warnings_of(scene, stones_of(scene, "scene"))) for scene in (below, above)]
    assert warned == ([True, False] if words == "own weight" else [False, True])


THICK = {"size_m": [0.2, 0.2], "thickness_m": 0.03}


@pytest.mark.parametrize("changes, left_out, words", [
    (THICK, 0.0, ["plate.thickness_m = 0.03", "6.67 of it"]),
    ({"size_m": [0.75, 0.1], "thickness_m": 0.01, "rods": ()}, 0.0, ["within the plane"]),
    ({"theory": "kirchhoff"}, 0.0, ["plate.theory = 'kirchhoff'", "without shear"]),
    ({}, 0.06, ["plate.max_frequency_Hz = 2e+04", "0.06"]),
    ({"mesh_size_m": 0.1}, 0.0, ["plate.mesh_size_m = 0.1: above 0.0", "modes up to 2e+04 Hz"]),
    ({"size_m": [0.43, 0.5]}, 0.0, ["plate.rods.0: stands 0.015 m from an edge"]),
    ({"youngs_modulus_Pa": 1e10}, 0.0, ["plate.rods.3.youngs_modulus_Pa = 2.07e+11", "nearest"]),
    ({"thickness_m": 2e-3}, 0.0, ["plate.rods.0.diameter_m = 0.02", "nearest"]),
])
def test_a_plate_beyond_its_theory_is_warned_of(changes, left_out, words):
    """And that of the paper is not."""
    plate = changed_scene(SCENES / "paper.toml", {}).plate
    assert warnings_of_plate(plate, 0.04) == [] == momentum_warnings(0.009) == momentum_warnings(None)
    said = "\n".join(warnings_of_plate(plate.model_copy(update=changes), left_out))
    assert all(word in said for word in words), said
    assert "0.02" in momentum_warnings(0.02)[0]


@pytest.mark.parametrize("scene", sorted(file.stem for file in SCENES.glob("*.toml")
                                         if "stones" in tomllib.loads(file.read_text())))
def test_no_shipped_scene_is_warned_of(scene):
    whole = changed_scene(SCENES / f"{scene}.toml", {})
    assert warnings_of(whole, stones_of(whole, scene)) == []


def test_a_warning_is_on_screen_and_in_run_json(tmp_path):
    """One of the scene, and one of the run: a thin plate deflects far."""
    import json

    thin = ("stones.speed_m_s=300.0", "plate.thickness_m=0.002", "plate.max_frequency_Hz=500.0", "plate.rods=[]",
            "time.duration_s=3e-4")
    changes = [word for change in thin for word in ("--set", change)]
    code, _, errors = run("dem", "run", SCENES / "elastic_plate.toml", *changes, "--out", tmp_path / "run")
    warned = json.loads((tmp_path / "run" / "run.json").read_text())["warnings"]
    assert code == 0 and all(f"elastic_plate.toml: {line}" in errors for line in warned)
    assert "Hertz" in warned[0] and "deflects by" in warned[-1]


def shell(command):
    return subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True, cwd=ROOT,
                          check=False, timeout=3000)


def test_a_reader_that_goes_away_and_a_full_disk_behind_standard_output(tmp_path):
    write_run(tmp_path / "ratio_030", 0.3)
    program = f"{sys.executable} -m analysis features {tmp_path / 'ratio_030'}"
    closed = shell(f"{program} | (exec 0<&-; sleep 0.1)")
    assert closed.stderr == "" and closed.returncode in (0, 141)  # 0 where all was written before
    full = shell(f"{program} > /dev/full")
    assert full.returncode == 1 and full.stderr == "analysis: No space left on device\n"


@contextlib.contextmanager
def write_limit(number_of_bytes):
    """Within, files of so many bytes may be written, as on a full disk. Bytecode that is cut off would fail later."""
    free = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "dont_write_bytecode", True)
        resource.setrlimit(resource.RLIMIT_FSIZE, (number_of_bytes, free[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, free)


@pytest.mark.slow
def test_a_disk_that_is_full_when_a_model_or_a_report_is_written(tmp_path, monkeypatch):
    sweep = write_sweep(tmp_path / "sweep", ratios=(0.0, 0.3, 0.7, 1.0))
    run = sweep / "ratio_030"
    monkeypatch.setattr("recognition.estimation.noise.COPIES", 2)
    for entry, arguments in [(recognition.__main__.main, ["fit", sweep, "--out", tmp_path / "model.json"]),
                             (report.__main__.main, [run])]:
        with write_limit(1000):
            code, errors = outcome(entry, [str(argument) for argument in arguments])
        # The cache may tell it too.
        lines = [line for line in errors.splitlines()
                 if "not kept for later runs" not in line and "_write(" not in line]
        assert code == 1 and len(lines) == 1 and "File too large" in lines[0], errors
    assert not (tmp_path / "model.json").exists() and not (run / "report.html").exists()
    assert not list(tmp_path.rglob("*.part"))


def test_names_with_blanks_reach_the_commands_of_make_whole():
    planned = subprocess.run(["make", "-n", "-o", "setup", "sweep", "OUT=my sweep", "SCENE=scenes/a b.toml"], cwd=ROOT,
                             capture_output=True, text=True, check=True).stdout
    assert "--out 'my sweep'" in planned and "sweep 'scenes/a b.toml'" in planned and "report 'my sweep'" in planned


@pytest.mark.parametrize("where, why", [("/dev/null", "no such directory"), (".", "no finished run ratio_*"),
                                        ("nowhere", "no such directory"), ("cut off", "no finished run ratio_*")])
def test_a_report_of_nothing(tmp_path, monkeypatch, where, why):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cut off" / "ratio_000").mkdir(parents=True)
    (tmp_path / "cut off" / "ratio_000" / "run.json").write_text('{"status": "fini')
    told = ends_with_one_line(report.__main__.main, [where])
    assert told.startswith(f"{where}: ") and why in told
    assert not list(tmp_path.rglob("*.html")) and not list(tmp_path.rglob("claims.csv"))


def test_a_stone_that_the_plate_pushes_at_the_end_is_told_of_but_none_that_lies():
    scene = changed_scene(SCENES / "hertz_coal.toml", {"time.gravity_m_s2": 9.8})
    warned = unfinished_warnings(scene, np.array([0.0, 900.0, 1.0]), np.array([3e3, 4e3, 1.1]), np.full(3, 0.1))
    assert len(warned) == 1 and "ends while stone 2 hits the plate, one of 1 such" in warned[0]


def test_a_crushing_strength_that_nothing_takes_is_told_of():
    told = [any("contact_strength_Pa" in line for line in warnings_of(scene, stones_of(scene, "scene"))) for scene in (
        changed_scene(SCENES / "single.toml", {"materials.coal.contact_strength_Pa": 1e8} | changes)
        for changes in ({}, {"stones.agglomerate": None}, {"stones.agglomerate.contact": "sub_spheres"}))]
    assert told == [False, True, True]
