"""One command for everything: it does what the packages' own command lines do."""

import errno
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import plate_fem.modes
from analysis import read_record, signal_features
from common.tables import InputError, read_toml
from gangue.__main__ import main
from gangue.commands import COMMANDS
from gangue.completion import whole_parser
from gangue.parsers import parser_of
from gangue.results import RESULTS
from tests.analysis.synthetic import write_run, write_sweep

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
        words = [word for word in shlex.split(example) if word != "--json"]
        assert words[:2] == ["gangue", name]
        parser_of(name, COMMANDS[name]).parse_args(words[2:])


def test_help_imports_no_library_that_is_slow():
    code = "import sys\nfrom gangue.__main__ import main\ntry: main(['--help'])\nfinally: print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert "examples:" in done.stdout
    assert not {"numpy", "pandas", "pydantic", "scipy", "dem", "analysis"} & set(done.stdout.split())


@pytest.mark.parametrize("words, said", [
    ([], "command"), (["doctor", "x"], "unrecognized"),
    (["recognize"], "recognize"), (["--json", "campaign", "x.toml", "--out", "y"], "no result"),
    (["--json", "features", "nothing.csv"], "no such file"), (["--json", "modes", "nothing.toml"], "cannot be read"),
    (["completion", "fish"], "fish"), (["--json", "report", "compare", "a", "b"], "gangue report: unrecognized"),
    (["--json", "compare", "nowhere", "nothing"], "nowhere"),
])
def test_bad_input_ends_with_2_and_no_output(words, said, capsys):
    try:
        code = main(words)
    except SystemExit as end:
        code = end.code
    captured = capsys.readouterr()
    assert code == 2 and captured.out == "" and said in captured.err and captured.err.count("\n") == 1


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


def test_recognition_as_json(tmp_path, capsys):
    """The ratio of a run that the model was fitted to; one forty times as strong is unlike all of them."""
    runs, model = write_sweep(tmp_path / "paper"), tmp_path / "model.json"
    assert main(["--quiet", "--json", "fit", str(runs), "--out", str(model)]) == 0
    assert json.loads(capsys.readouterr().out) == {"model": str(model)}
    assert main(["recognise", str(runs / "ratio_030"), "--model", str(model), "--json", "--quiet"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["methods"][found["best"]]["ratio"] == pytest.approx(0.3, abs=0.03)
    table = pd.read_parquet(runs / "ratio_030" / "signals.parquet")
    table.iloc[:, 1:] *= 40.0
    table.to_parquet(tmp_path / "strange.parquet")
    assert main(["--json", "--quiet", "recognise", str(tmp_path / "strange.parquet"), "--model", str(model)]) == 3
    found = json.loads(capsys.readouterr().out)
    assert found["out_of_distribution"] and found["best"] is None


def test_modes_as_json(tmp_path, capsys, monkeypatch):
    """A free square plate: omega a^2 sqrt(rho h/D) = 13.468 and 19.596 above three motions as a rigid body."""
    plate = {**read_toml(ROOT / "scenes" / "paper.toml")["plate"], "rods": [], "sensors": [], "thickness_m": 0.005,
             "max_frequency_Hz": 200.0}
    text = "[plate]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in plate.items())
    (tmp_path / "free.toml").write_text(text)
    assert main(["--json", "modes", str(tmp_path / "free.toml")]) == 0
    frequency_Hz = json.loads(capsys.readouterr().out)["frequency_Hz"]
    stiffness = 2.07e11 * 0.005**3 / 12 / (1 - 0.3**2)
    unit_Hz = np.sqrt(stiffness / (7830.0 * 0.005)) / 0.5**2 / (2 * np.pi)
    # The cache has what the command found: the result does not find it again.
    monkeypatch.setattr(plate_fem.modes, "_compute", None)
    assert main(["--json", "modes", str(tmp_path / "free.toml")]) == 0
    assert json.loads(capsys.readouterr().out)["frequency_Hz"] == frequency_Hz
    assert frequency_Hz[3:5] == pytest.approx([13.468 * unit_Hz, 19.596 * unit_Hz], rel=5e-3)


def test_a_comparison_as_json(tmp_path, capsys):
    """The page is where the result says it is."""
    a, b = (write_run(tmp_path / name, 0.5) for name in ("first", "second"))
    for words in ([], ["--out", str(tmp_path / "page.html")]):
        assert main(["--json", "compare", str(a), str(b), *words]) == 0
        page = Path(json.loads(capsys.readouterr().out)["page"])
        assert page.parent == tmp_path and "</html>" in page.read_text()
    assert page.name == "page.html"


def test_the_result_of_a_calibration_is_the_file_of_the_rock(tmp_path):
    for rock, words in (("roof", ["--rock", "roof"]), ("coal", [])):
        (tmp_path / f"{rock}.toml").write_text(f'name = "{rock}"\n')
        words = ["coal", "--scene", "scenes/paper.toml", "--out", str(tmp_path), *words]
        options = parser_of("calibrate", COMMANDS["calibrate"]).parse_args(words)
        assert RESULTS["calibrate"](options, 0) == {"name": rock}


@pytest.mark.parametrize("raised, code, said", [
    (InputError("x.toml: speed = 'fast': must be a number"), 2, "x.toml: speed = 'fast': must be a number"),
    (KeyboardInterrupt(), 130, "interrupted; what is finished stays, the same command goes on"),
    (OSError(errno.ENOSPC, "No space left on device"), 1, "gangue: No space left on device"),
])
def test_what_ends_a_result_is_told_in_one_line(tmp_path, capsys, monkeypatch, raised, code, said):
    def result(*_):
        raise raised

    (tmp_path / "x.csv").write_text("t_s,a_m_s2\n" + "".join(f"{k / 1000},{k % 7}\n" for k in range(100)))
    monkeypatch.setitem(RESULTS, "features", result)
    assert main(["--json", "--quiet", "features", str(tmp_path / "x.csv")]) == code
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", f"{said}\n")


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


def test_a_quiet_sweep_and_its_json(tmp_path):
    """Hertz gives the peak forces (docs/validation.md); not a word but the result."""
    words = ["sweep", "scenes/hertz_coal.toml", "--out", str(tmp_path / "out"), "--quiet"]
    done = program("--json", *words)
    assert (done.returncode, done.stderr) == (0, "")
    runs = json.loads(done.stdout)["runs"]
    assert [run["peak_force_N"] for run in runs] == pytest.approx([4261.6, 7646.3], rel=1e-3)
    done = program(*words[:-1])
    assert "2 ratios, 0 to run" in done.stdout


def test_the_doctor_says_in_ten_lines_what_is_there(capsys, tmp_path):
    assert main(["doctor"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 10
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
    assert whole_parser({}).format_help().count("mixing ratio") >= 2
