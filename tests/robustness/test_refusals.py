"""What once hung, filled the memory or ended in a traceback ends with one line."""

import os
import re
import subprocess
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
from plate_fem.__main__ import main as modes_of
from plate_fem.elements.mesh import default_mesh_size, mesh_lines
from recognition.plate.plate_model import PlateModel
from report.film.pictures import instants, read_arrays
from report.missing import MissingResult
from tests.analysis.synthetic import write_run
from tests.fuzz.mutations import outcome
from tests.report.synthetic_view import write_view
from tests.robustness.small import HERTZ, ROOT, SCENES


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
