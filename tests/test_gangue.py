"""One command for everything: it does what the packages' own command lines do."""

import errno
import json
import os
import shlex
import subprocess
import sys
import time
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from analysis import read_record, signal_features
from common.process import messages
from common.scene.scene import read_scene
from common.tables import InputError, read_toml
from dem.coupling.pipes import STOPPED
from gangue import doctor
from gangue.__main__ import main
from gangue.commands import COMMANDS, commands_of, parser_of
from tests.analysis.synthetic import write_run

ROOT = Path(__file__).resolve().parents[1]


def program(*words, env=None):
    return subprocess.run([sys.executable, "-m", "gangue", *words], cwd=ROOT, env={**os.environ, **(env or {})},
                          capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_help_has_examples_that_the_command_accepts(name, capsys):
    assert main([name, "--help"]) == 0
    text = capsys.readouterr().out
    assert text.startswith(f"usage: gangue {name}") and len(COMMANDS[name].examples) > 0
    for example in COMMANDS[name].examples:
        assert example in text
        words = [word for word in shlex.split(example.partition(">")[0]) if word != "--json"]
        assert words[:2] == ["gangue", name]
        parser_of().parse_args(words[1:])


def test_help_imports_no_library_that_is_slow():
    code = "import sys\nfrom gangue.__main__ import main\ntry: main(['--help'])\nfinally: print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert "examples:" in done.stdout
    assert not {"numpy", "pandas", "pydantic", "scipy", "dem", "analysis"} & set(done.stdout.split())


@pytest.mark.parametrize("words, said", [
    ([], "command"), (["doctor", "x"], "unrecognized"),
    (["recognize"], "recognize"), (["campaign", "x.toml", "--out", "y"], "x.toml"),
    (["features", "nothing.csv"], "no such file"), (["modes", "nothing.toml"], "cannot be read"),
    (["completion", "fish"], "fish"), (["report", "compare", "a", "b"], "gangue report: unrecognized"),
    (["compare", "nowhere", "nothing"], "nowhere"), (["fit", "nowhere", "--out", "x.json"], "nowhere"),
])
def test_bad_input_ends_with_2_and_one_line_and_as_json_with_an_object_that_repeats_it(words, said, capsys):
    assert main(words) == 2
    told = capsys.readouterr()
    assert told.out == "" and said in told.err and told.err.count("\n") == 1
    for as_json in (["--json", *words], [*words, "--json"]):
        assert main(as_json) == 2
        again = capsys.readouterr()
        assert again.err == told.err and json.loads(again.out) == {"error": told.err.removesuffix("\n"), "exit_code": 2}


def test_features_as_json_are_those_of_the_package(tmp_path, capsys):
    t_s = np.arange(1000) / 5000.0
    pd.DataFrame({"t_s": t_s, "a_m_s2": np.sin(2 * np.pi * 200 * t_s)}).to_csv(tmp_path / "x.csv", index=False)
    assert main(["features", str(tmp_path / "x.csv"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert main(["features", str(tmp_path / "x.csv"), "--quiet"]) == 0
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""
    expected = signal_features(read_record(tmp_path / "x.csv"))
    assert {name: one["value"] for name, one in found["features"].items()} == {
        f.name: f.value for f in expected.values()}
    assert found["features"]["rms"]["value"] == pytest.approx(np.sqrt(0.5), rel=1e-5)


def test_modes_as_json(tmp_path, capsys):
    """A free square plate: omega a^2 sqrt(rho h/D) = 13.468 and 19.596 above three motions as a rigid body."""
    plate = {**read_toml(ROOT / "scenes" / "paper.toml")["plate"], "rods": [], "sensors": [], "thickness_m": 0.005,
             "max_frequency_Hz": 200.0}
    text = "[plate]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in plate.items())
    (tmp_path / "free.toml").write_text(text)
    assert main(["--json", "modes", str(tmp_path / "free.toml")]) == 0
    frequency_Hz = json.loads(capsys.readouterr().out)["frequency_Hz"]
    stiffness = 2.07e11 * 0.005**3 / 12 / (1 - 0.3**2)
    unit_Hz = np.sqrt(stiffness / (7830.0 * 0.005)) / 0.5**2 / (2 * np.pi)
    assert frequency_Hz[3:5] == pytest.approx([13.468 * unit_Hz, 19.596 * unit_Hz], rel=5e-3)


@pytest.mark.slow
def test_a_comparison_as_json(tmp_path, capsys):
    """The page is where the result says it is."""
    a, b = (write_run(tmp_path / name, 0.5) for name in ("first", "second"))
    for words in ([], ["--out", str(tmp_path / "page.html")]):
        assert main(["--json", "compare", str(a), str(b), *words]) == 0
        page = Path(json.loads(capsys.readouterr().out)["page"])
        assert page.parent == tmp_path and "</html>" in page.read_text()
    assert page.name == "page.html"


@pytest.mark.parametrize("raised, code, said", [
    (InputError("x.toml: speed = 'fast': must be a number"), 2, "x.toml: speed = 'fast': must be a number"),
    (KeyboardInterrupt(), 130, "interrupted; what is finished stays, the same command goes on"),
    (OSError(errno.ENOSPC, "No space left on device"), 1, "gangue: No space left on device"),
])
def test_what_ends_a_command_is_told_in_one_line(capsys, monkeypatch, raised, code, said):
    def result(*_, **__):
        raise raised

    monkeypatch.setattr("analysis.commands.features", result)
    assert main(["--json", "--quiet", "features", "x.csv"]) == code
    captured = capsys.readouterr()
    assert captured.err == f"{said}\n" and json.loads(captured.out) == {"error": said, "exit_code": code}


def test_an_interrupt_before_the_command_begins_gives_one_line():
    code = ("import os, signal, gangue.__main__ as line\n"
            "line.run_command = lambda *_: os.kill(os.getpid(), signal.SIGINT)\nline.main()")
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (130, 1) and done.stderr.startswith("interrupted")


@pytest.mark.parametrize("words", [["--json", "doctor"], ["completion", "bash"], ["features", "--help"]])
def test_a_closed_pipe_and_a_full_disk_give_no_traceback(words):
    reading, writing = os.pipe()
    os.close(reading)
    full = os.open("/dev/full", os.O_WRONLY)
    for output, code, said in ((writing, 141, ""), (full, 1, "gangue: No space left on device\n")):
        done = subprocess.run([sys.executable, "-m", "gangue", *words], cwd=ROOT, stdout=output,
                              stderr=subprocess.PIPE, text=True, check=False)
        os.close(output)
        assert (done.returncode, done.stderr) == (code, said)


@pytest.mark.slow
def test_a_quiet_sweep_and_its_json(tmp_path, capfd):
    """Hertz gives the peak forces (docs/validation.md); not a word but the result."""
    words = ["sweep", "scenes/hertz_coal.toml", "--out", str(tmp_path / "out"), "--quiet"]
    done = program("--json", *words)
    assert (done.returncode, done.stderr) == (0, "")
    runs = json.loads(done.stdout)["runs"]
    assert [run["peak_force_N"] for run in runs] == pytest.approx([4261.6, 7646.3], rel=1e-3)
    assert main(["--json", *words[:-1]]) == 0
    again = capfd.readouterr()
    assert json.loads(again.out)["runs"] == runs and "2 runs, 0 to run" in again.err
    assert main(words[:-1]) == 0
    first, *lines, last = capfd.readouterr().out.splitlines()
    assert first.endswith("2 runs, 0 to run") and last.endswith("2 of 2 ratios finished")
    for line, run in zip(lines, runs, strict=True):
        assert f"peak force {run['peak_force_N']:9.1f} N, {run['n_bonds_broken']} of" in line


@pytest.mark.parametrize("available_kB, code", [(2_000_000, 0), (900_000, 1)])
def test_the_doctor_says_in_eleven_lines_what_is_there(available_kB, code, capsys, tmp_path, monkeypatch):
    """Memory that keeps files is no reason to refuse."""
    memory = tmp_path / "meminfo"
    memory.write_text(f"MemTotal: 4000000 kB\nMemFree: 100000 kB\nMemAvailable: {available_kB} kB\n")
    monkeypatch.setattr(doctor, "MEMORY", memory)
    assert main(["doctor"]) == code
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 11 and f"{available_kB * 1024e-9:.1f} GB of memory free" in lines[1]
    done = program("--json", "doctor", env={"LIGGGHTS_BONDED": str(tmp_path / "nowhere")})
    (engine,) = [line for line in json.loads(done.stdout) if line["name"] == "engine"]
    assert done.returncode == 1 and not engine["there"] and "build-engine" in engine["text"]


def test_completion_knows_commands_options_and_files(tmp_path):
    script = program("completion", "bash").stdout
    (tmp_path / "gangue.sh").write_text(script)
    (tmp_path / "scene.toml").write_text("")
    for words, expected in ((["fea"], "features"), (["sweep", "--jo"], "--jobs"), (["sweep", "sce"], "scene.toml")):
        line = " ".join(["gangue", *words])
        code = (f"source gangue.sh; COMP_WORDS=({line}); COMP_CWORD={len(words)}; COMP_LINE='{line}'; "
                f"COMP_POINT={len(line)}; _shtab_gangue gangue {words[-1]} x; echo ${{COMPREPLY[@]}}")
        done = subprocess.run(["bash", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert expected in done.stdout.split(), (line, done.stdout, done.stderr)
    assert commands_of(parser_of()).keys() == COMMANDS.keys()


def test_the_help_names_the_exit_code_of_a_run_that_stopped():
    assert f"exit code {STOPPED}" in " ".join(commands_of(parser_of())["run"].format_help().split())


def test_shipped_scenes_are_listed_and_a_copy_is_the_scene_wherever_it_is(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["--json", "scenes"]) == 0
    shipped = json.loads(capsys.readouterr().out)["scenes"]
    assert len(shipped) > 10 and "campaign.toml" not in shipped and all(shipped.values())
    for name in shipped:
        assert main(["--quiet", "scenes", name.removesuffix(".toml")]) == 0
        assert read_scene(tmp_path / name) == read_scene(ROOT / "scenes" / name)
    assert main(["scenes"]) == 0 and set(shipped) == {line.split()[0] for line in capsys.readouterr().out.splitlines()}
    for words, line in ((["paper"], "is there"), (["nothing"], "paper.toml"), (["--out", "x.toml"], "left out")):
        assert main(["scenes", *words]) == 2 and line in capsys.readouterr().err


WITHOUT_UNIX = """
import os, signal, sys

sys.modules |= dict.fromkeys(("fcntl", "resource", "pwd", "grp", "termios"))  # an import of one of them fails
del signal.SIGKILL, signal.SIGHUP, os.fork, os.setsid, os.sched_getaffinity

import analysis, recognition, plate_fem

for package in (analysis, recognition, plate_fem):
    for name in dir(package):
        getattr(package, name)

from gangue.__main__ import main

sys.exit(main(["features", sys.argv[1]]))
"""


@pytest.mark.slow
def test_what_needs_no_engine_works_without_what_windows_lacks(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("t_s,a_m_s2\n" + "".join(f"{k / 1000},{(7 * k) % 13 - 6}\n" for k in range(200)))
    done = subprocess.run([sys.executable, "-c", WITHOUT_UNIX, file], capture_output=True, text=True, check=False,
                          cwd=ROOT)
    assert done.returncode == 0 and "rms" in done.stdout, done.stderr


def test_the_lock_file_and_the_container_have_what_the_project_asks_for():
    from dem.coupling.launch import LIGGGHTS_VERSION

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    locked = dict(line.split("==") for line in lines if not line.startswith("#"))
    extras = project["optional-dependencies"]
    for text in (*project["dependencies"], *extras["report"], *extras["records"], *extras["tables"]):
        wanted = Requirement(text)
        assert wanted.specifier.contains(locked[canonicalize_name(wanted.name)]), text
    container = (ROOT / "Containerfile").read_text()
    assert f"LIGGGHTS={LIGGGHTS_VERSION}\n" in container


@pytest.mark.parametrize("on_terminal, told_there", [(True, "x: packing ...\n"), (False, "")])
def test_a_stage_that_lasts_is_named_on_a_terminal(monkeypatch, capsys, on_terminal, told_there):
    messages.show_messages()
    monkeypatch.setattr(sys.stderr, "isatty", lambda: on_terminal)
    with messages.told("x: packing"):
        time.sleep(5 * messages.PATIENCE_s)
    with messages.told("x: deck"):
        pass
    with messages.told(""):
        time.sleep(2 * messages.PATIENCE_s)
    assert capsys.readouterr().err == told_there


def test_a_warning_of_python_is_one_line_without_code():
    messages.show_messages(quiet=True)
    assert warnings.formatwarning(UserWarning("x: no"), UserWarning, "a.py", 3, "code()") == "warning: x: no\n"


@pytest.mark.parametrize("words, allowed", [
    ("--jobs 1.5", "1.5: must be a whole number"), ("--walltime soon", "soon: must be a time in s")])
def test_a_number_that_is_none_is_refused_in_the_users_words(words, allowed, capsys):
    command = "sweep" if "jobs" in words else "run"
    assert main([command, "x.toml", "--out", "y", *words.split()]) == 2 and allowed in capsys.readouterr().err
