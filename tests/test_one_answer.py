"""What a command says in words it says as JSON, and no more: of clean, faulty and foreign records, with options."""

import inspect
import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis import as_record, resample
from analysis.sweep.run_table import TableResult
from common.result import Result
from dem.batch.sweep import SweepResult
from dem.commands import BatchResult, CalibrationResult, DeckResult, EngineResult, PlateEnergy, RunResult
from gangue.__main__ import main
from gangue.commands import COMMANDS, commands_of, parser_of
from gangue.learn_forces import LearntForces
from gangue.scenes import ScenesResult
from lab.known_truth.faulty_records import volley, with_fault
from lab.known_truth.simulated import draw_stones, stream_of
from plate_fem.commands import ModesResult, MotionResult
from recognition.commands import EvaluateResult
from recognition.estimation.answer import Answer
from recognition.estimation.window import Window
from recognition.models import Model
from recognition.physics.arrangement_method import ArrangementLikelihood
from recognition.plate.plate_model import PlateModel
from recognition.sensors.channel_check import CheckResult
from recognition.stone_forces.forces import StoneForces, save_forces
from recognition.stream.heard import UNTAPPED, Alarms, ListenResult
from recognition.stream.live import LiveResult
from recognition.stream.stones import NONE_KNOWN
from recognition.tapping.tapped import TapResult
from recognition.volley.recognise import RATE_Hz, VolleyResult
from report.comparison import ComparisonResult
from report.page import ReportResult
from tests.analysis.synthetic import write_sweep
from tests.recognition.elastic_stones import CHANNELS, elastic_stone
from tests.recognition.test_arrangement_likelihood import NAMES, SAMPLES, SAMPLE_s, draw, plate
from tests.recognition.test_volley import record as stones_at_once

NUMBER = r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?(?![\w.]*\w)"
HALF_Hz = "3333.3333333"  # of the rate of the records
LEVEL = 90.0  # per cent, of every interval
WHY_NOT = {"refused": "REFUSED", "not_explained": "NOT EXPLAINED", "out_of_distribution": "OUT OF DISTRIBUTION"}


def leaves(found, key=""):
    """Each value of a JSON object, with the key that leads to it."""
    if isinstance(found, dict):
        for name, value in found.items():
            yield from leaves(value, name)
    elif isinstance(found, list):
        for value in found:
            yield from leaves(value, key)
    else:
        yield key, found


def forms(value):
    """How words may write a number: in its unit, in per cent, in thousands."""
    for scaled in (value, 100 * value, value / 1e3):
        yield from (f"{scaled:.{digits}f}" for digits in range(6))
        yield from (f"{scaled:.6g}", f"{scaled:.1e}")


def check_same(words, found):
    """Words and JSON of one answer."""
    check_numbers(words, found)
    for key, value in leaves(found):
        if key == "ratio" and value is not None:
            assert f"{100 * value:.1f} %" in words or f"{100 * value:.2f} %" in words, (words, key, value)
        if key in {*WHY_NOT, "warnings", "told"} and value:
            assert value in words, (words, value)
    for key, verdict in WHY_NOT.items():
        assert (verdict in words) == bool(found.get(key)), (words, found)


def check_numbers(words, found):
    """Every number of the words stands in the JSON."""
    values = list(leaves(found))
    known = {form for _, one in values if isinstance(one, int | float) for form in forms(one)}
    known |= {str(number) for number in range(1, len(values) + 1)} | {f"{LEVEL:.0f}"}  # of rows
    for text in sorted({str(one) for pair in values for one in pair}, key=len, reverse=True):
        words = words.replace(text, " ") if re.search(r"[A-Za-z].*\d|\d.*[A-Za-z]", text) else words
    assert not set(re.findall(NUMBER, words)) - known, (words, found)


def both(capsys, words, code):
    """What a command says in words and as JSON, of one answer: its function is called once."""
    command, answers = COMMANDS[words[0]], []
    function = command.load()

    def once(**options):
        if not answers:
            answers.append(function(**options))
        return answers[0]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command.function.replace(":", "."), once)
        assert main(words) == code
        said = capsys.readouterr()
        assert main(["--json", *words]) == code
    return said, json.loads(capsys.readouterr().out)


def write_record(file, signals, names, step_s):
    pd.DataFrame({"t_s": np.arange(signals.shape[1]) * step_s, **dict(zip(names, signals, strict=True))}).to_csv(
        file, index=False)


RATIOS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A model of a sweep, and three records of one of its runs: as it is, with a dead sensor, forty times as strong."""
    here = tmp_path_factory.mktemp("runs")
    write_sweep(here / "paper", RATIOS)
    assert main(["--quiet", "fit", str(here / "paper"), "--out", str(here / "model.json")]) == 0
    table = pd.read_parquet(here / "paper" / "ratio_030" / "signals.parquet")
    table.to_csv(here / "clean.csv", index=False)
    table.assign(acc_B_m_s2=0.0).to_csv(here / "dead.csv", index=False)
    foreign = table.copy()
    foreign.iloc[:, 1:] *= 40.0
    foreign.to_csv(here / "foreign.csv", index=False)
    return here


@pytest.fixture(scope="module")
def tapped(tmp_path_factory):
    """A model that knows of the plate, that plate as taps would teach it, and records on it."""
    here, (X, ratios) = tmp_path_factory.mktemp("tapped"), draw(13, 1)
    method = ArrangementLikelihood(exact_trigger=True).fit(X[1:], ratios[1:], groups=np.arange(12))
    model = Model(Window(1 / SAMPLE_s, 4 * SAMPLES), {"arrangement_likelihood": method}, {"groups": 12})
    model.save(here / "model.json")
    PlateModel.from_scene(plate(), plate().max_frequency_Hz).save(here / "plate.json")
    noise = np.random.default_rng(0).standard_normal((len(NAMES), 3 * SAMPLES))
    signals = np.hstack([X[0].signals, 1e-3 * X[0].signals.std(axis=1)[:, None] * noise])
    dead = signals.copy()
    dead[1] = 0.0
    for name, values in (("clean", signals), ("dead", dead), ("foreign", np.roll(signals, 1, axis=0))):
        write_record(here / f"{name}.csv", values, NAMES, SAMPLE_s)
    return here


@pytest.mark.parametrize("record, code", [("clean", 0), ("dead", 3), ("foreign", 3), ("nowhere", 2)])
@pytest.mark.parametrize("options", [[], ["--plate"]])
def test_recognise(runs, tapped, capsys, record, code, options):
    here = tapped if options else runs
    words = ["recognise", str(here / f"{record}.csv"), "--model", str(here / "model.json")]
    said, found = both(capsys, words + options + [str(here / "plate.json") for _ in options], code)
    if code == 2:
        assert found == {"error": said.err.removesuffix("\n"), "exit_code": 2} and said.out == ""
        return
    check_same(said.out, found)
    assert (found["best"] is None) == (code != 0)
    if code == 0:
        best = found["methods"][found["best"]]
        assert said.out.startswith(f"mixing ratio {100 * best['ratio']:.1f} %, 90 % interval {100 * best['low']:.1f} ")
    else:
        assert found["methods"] == {}  # nothing that nobody should trust


@pytest.mark.slow
def test_recognise_a_record_of_another_rate_in_g(runs, capsys):
    clean = pd.read_csv(runs / "clean.csv")
    rate_Hz, g = 20e3, 9.80665
    other = {name: resample(as_record(clean[name], 1 / np.diff(clean["t_s"]).mean()), rate_Hz).values
             for name in clean.columns.drop("t_s")}
    table = pd.DataFrame({"t_s": np.arange(len(other["a_m_s2"])) / rate_Hz, **other})
    table[[name for name in table if name.startswith("acc_")]] /= 10 * g
    table.to_csv(runs / "other.csv", index=False)
    words = ["recognise", "--model", str(runs / "model.json")]
    _, same = both(capsys, [*words, str(runs / "clean.csv")], 0)
    _, refused = both(capsys, [*words, str(runs / "other.csv")], 2)
    assert "20000 Hz" in refused["error"] and "--resample" in refused["error"]
    said, found = both(capsys, [*words, str(runs / "other.csv"), "--resample", "--scale", "10", "--unit", "g"], 0)
    check_same(said.out, found)
    best = same["best"]
    assert found["best"] == best and best is not None
    assert found["methods"][best]["ratio"] == pytest.approx(same["methods"][best]["ratio"], abs=0.02)
    table["acc_B_m_s2"] = table["acc_B_m_s2"].clip(upper=0.3 * table["acc_B_m_s2"].max())
    table.to_csv(runs / "clipped.csv", index=False)
    _, refused = both(capsys, [*words, str(runs / "clipped.csv"), "--resample", "--scale", "10", "--unit", "g"], 3)
    assert "acc_B_m_s2: clipped" in refused["refused"][0]


@pytest.mark.parametrize("record", ["clean", "dead", "foreign"])
@pytest.mark.parametrize("options", [[], ["--column", "acc_B_m_s2"], ["--time", "t_s"], ["--resample", HALF_Hz],
                                     ["--scale", "9.81", "--unit", "m/s^2"], ["--resample", HALF_Hz, "--no-filter"]])
def test_features(runs, capsys, record, options):
    refused = record == "dead" and "acc_B_m_s2" in options  # nothing moves
    said, found = both(capsys, ["features", str(runs / f"{record}.csv"), *options], 2 if refused else 0)
    if refused:
        assert found == {"error": said.err.removesuffix("\n"), "exit_code": 2}
        return
    check_same(said.out, found)
    head, _, *lines = said.out.splitlines()
    assert head == f"# {found['record']}, {found['samples']} samples at {found['rate_Hz']:.6g} Hz"
    for line, feature in zip(lines, found["features"].values(), strict=True):
        name, value, *_ = line.split()
        assert name == feature["name"] and value == ("nan" if feature["value"] is None else f"{feature['value']:.6g}")


@pytest.mark.parametrize("options", [[], ["--rate", "6667"]])
def test_features_of_a_file_without_times(runs, capsys, options):
    pd.read_csv(runs / "clean.csv")[["a_m_s2"]].to_csv(runs / "timeless.csv", index=False)
    said, found = both(capsys, ["features", str(runs / "timeless.csv"), *options], 0 if options else 2)
    if options:
        check_same(said.out, found)
    else:
        assert found == {"error": said.err.removesuffix("\n"), "exit_code": 2}


@pytest.mark.slow
def test_fit(runs, capsys):
    said, found = both(capsys, ["fit", str(runs / "paper"), "--out", str(runs / "again.json")], 0)
    check_same(said.out, found)
    assert found["gangue_ratios"] == pytest.approx(RATIOS)
    assert "arrangement_likelihood" in found["not_fitted"]


@pytest.fixture(scope="module")
def struck(tmp_path_factory):
    """A plate, and records of stones on it."""
    here = tmp_path_factory.mktemp("struck")
    there, rate_Hz = PlateModel.from_scene("scenes/small.toml", 2000.0, shape_sd=0.03), 20e3
    there.save(here / "plate.json")
    clean = volley(there, rate_Hz, np.random.default_rng(0))
    for name, fault in (("clean", "none"), ("dead", "dead"), ("foreign", "swapped")):
        values = with_fault(clean, fault, rate_Hz, np.random.default_rng(0))
        write_record(here / f"{name}.csv", values, [f"acc_{one}_m_s2" for one in there.sensor_names], 1 / rate_Hz)
    return here


@pytest.mark.parametrize("record, code", [("clean", 0), ("dead", 3), ("foreign", 3)])
def test_check(struck, capsys, record, code):
    said, found = both(capsys, ["check", str(struck / f"{record}.csv"), "--plate", str(struck / "plate.json")], code)
    check_same(said.out, found)
    assert (found["misfit"] is None) == (record == "dead")


def write_records(here, clean, plate):
    """A record as it is, with a dead sensor, and with two sensors swapped."""
    records = {"clean": clean, "dead": clean * [[1.0], [0.0], [1.0], [1.0]], "foreign": clean[[1, 0, 2, 3]]}
    for name, values in records.items():
        write_record(here / f"{name}.csv", values, [f"acc_{one}_m_s2" for one in plate.sensor_names], 1 / RATE_Hz)
    return here


@pytest.fixture(scope="module")
def at_once(tmp_path_factory):
    """Ten stones at once on the paper's plate: the record as it is, with a dead sensor, with two sensors swapped."""
    here, there = tmp_path_factory.mktemp("at_once"), PlateModel.from_scene("scenes/paper.toml", 6000.0)
    there.save(here / "plate.json")
    return write_records(here, stones_at_once(there, 5, np.random.default_rng(8)), there)


@pytest.mark.parametrize("record, code", [("clean", 0), ("dead", 3), ("foreign", 3)])
def test_volley(at_once, capsys, record, code):
    words = ["volley", str(at_once / f"{record}.csv"), "--plate", str(at_once / "plate.json"), "--stones", "10",
             "--radius", "0.025", "--speed", "3"]
    said, found = both(capsys, words, code)
    check_same(said.out, found)


@pytest.fixture(scope="module")
def one_by_one(tmp_path_factory):
    """Twelve elastic stones one after another, and their law: the record, with a dead sensor, with two swapped."""
    here, there = tmp_path_factory.mktemp("one_by_one"), PlateModel.from_scene("scenes/single.toml", 12000.0)
    there.save(here / "plate.json")
    stones, rng = [elastic_stone(k % 2 == 1, 0.025, 2.2 + 0.16 * k) for k in range(10)], np.random.default_rng(5)
    save_forces(StoneForces.fit(stones), here / "law.json")
    clean = stream_of(there, CHANNELS, stones, draw_stones(stones, 12, 60.0, 0.2, 0.5, rng), RATE_Hz, 20.0, rng).values
    return write_records(here, clean, there)


@pytest.mark.slow
@pytest.mark.parametrize("record, known, code", [("clean", [], 0), ("clean", ["--coal-first", "1"], 0), ("dead", [], 3),
                                                 ("foreign", [], 3)])
def test_listen(one_by_one, capsys, record, known, code):
    here = one_by_one
    words = ["listen", str(here / f"{record}.csv"), "--plate", str(here / "plate.json"), "--law",
             str(here / "law.json"), "--radius", "0.025", "0.025", "--speed", "2", "4", "--out",
             str(here / f"heard_{record}"), *known]
    said, found = both(capsys, words, code)
    check_same(said.out, found)
    assert (NONE_KNOWN in said.out) == (code == 0 and not known)


ANSWER, WIDE = Answer(0.4123, 0.3711, 0.4489), Answer(0.5, 0.2, 0.81)
HERE, RUN = Path("here"), RunResult(Path("runs/ratio_030"), "paper", 0.3, "finished", 28123.45, 1.25, 9000, 812, 3.2e-4,
                                    {"engine and plate": 7.25, "output": 1.5}, "abc")
MODES = {"number": [3, 4], "frequency_Hz": [101.25, 230.5], "frequency_sd": [1e-3, 2e-3], "damping_ratio": [0.01, 0.02],
         "damping_sd": [0.1, 0.2], "shape_sd": [0.03, 0.04], "identified": [True, False]}
SENSORS = {"north": {"gain": 1.021, "gain_sd": 0.004, "misfit": 0.031, "noise": 0.012}}
#: What commands whose work takes long may answer.
CANNED = [
    ("run", RUN), ("resume", RUN), ("sweep", SweepResult(HERE, (RUN,), {"ratio_100": "stone.toml: no memory"})),
    ("dataset", BatchResult(HERE, 7, 5, {"one/000/ratio_050": "failed"})),
    ("campaign", BatchResult(HERE, 3, 3, {})), ("check", CheckResult(("north: hum at 50 Hz taken away",), ())),
    ("deck", DeckResult(HERE)), ("plate", PlateEnergy(0.12345678, 1e-9, 0.25)), ("build-engine", EngineResult(HERE)),
    ("calibrate", CalibrationResult(HERE, HERE, {"modulus_Pa": 5e9})),
    ("modes", ModesResult("Mindlin", 12, 39.15, (0.0, 101.23456), (0.0, 0.01234), None)),
    ("motion", MotionResult(((0.1, 0.0), (0.05, -0.2)), (1e-4, 2e-4), (0.5, 0.25), (300.0, 412.5), HERE, 2_400_000)),
    ("table", TableResult(({"run": "ratio_030", "stones.speed_m_s": 2.5, "peak_force_N": 28123.45},),
                          ("ratio_040: not finished",), HERE)),
    ("scenes", ScenesResult({"paper.toml": "ten stones"})), ("scenes", ScenesResult({"paper.toml": "ten"}, HERE)),
    ("evaluate", EvaluateResult(HERE)), ("report", ReportResult(HERE)), ("compare", ComparisonResult(HERE)),
    ("tap", TapResult(HERE, 12_345, MODES, SENSORS, "", 4, 3)),
    ("tap", TapResult(None, 0, MODES, SENSORS, "sensor 'north': 40% of its taps, limit 30%")),
    ("listen", ListenResult(HERE, HERE, 12, {"number": ANSWER, "mass": WIDE}, (UNTAPPED, WIDE.warning))),
    ("listen", ListenResult(HERE, HERE, 12, {"number": ANSWER}, stop=Alarms(0.4, 0.2, (35.2,), 3.9, 4.2, 0.8, False))),
    ("listen", ListenResult(HERE, HERE, 12, {"number": ANSWER}, stop=Alarms(0.4, 0.2, (), 3.9, 64.0, 20.0, True))),
    ("listen", ListenResult(HERE, HERE, 12, not_explained="the plate is another")),
    ("listen", ListenResult(refused="north: dead: it hardly moves")),
    ("listen", LiveResult(120, 1, 6.25)), ("listen", LiveResult(t_s=1.5, refused="north: dead: it hardly moves")),
    ("listen", LiveResult(12, 0, 1.5, not_explained="the plate is another")),
    ("learn-forces", LearntForces(HERE, 24, 23, {"stone_0007": "no memory"})),
    ("volley", VolleyResult(0.0512, 1.04, {"number": ANSWER, "mass": WIDE}, {"with one stone more": 0.52})),
    ("volley", VolleyResult(refused="nothing is heard")), ("volley", VolleyResult(not_explained="misfit 3.2, limit 2")),
]
ON_SCENE = ["x.toml", "--out", "y"]
LEAST = {"resume": ["y"], "calibrate": ["coal", "--out", "y", "--scene", "x.toml"], "build-engine": [],
         "modes": ["x.toml"], "motion": ["y", "--at", "0.1", "0"], "table": ["y"], "scenes": [],
         "evaluate": ["y"], "report": ["y"], "compare": ["a", "b"],
         "tap": ["taps.toml", *ON_SCENE],
         "listen": ["r.csv", "--plate", "p.json", "--radius", "1", "2", "--speed", "1", "2", "--out", "y"],
         "learn-forces": [*ON_SCENE, "--radius", "1", "2", "--speed", "1", "2"],
         "volley": ["r.csv", "--plate", "p.json", "--stones", "10", "--radius", "0.025", "--speed", "3"],
         "check": ["r.csv", "--plate", "p.json"]}


@pytest.mark.parametrize("name, result", CANNED, ids=lambda value: value if isinstance(value, str) else "")
def test_words_and_json_of_a_result_are_one_answer(monkeypatch, capsys, name, result):
    monkeypatch.setattr(COMMANDS[name].function.replace(":", "."), lambda **_: result)
    said, found = both(capsys, [name, *LEAST.get(name, ON_SCENE)], result.exit_code)
    check_same(said.out, found)
    assert said.out.splitlines() == list(result.words()) and found == result.as_json()


def test_what_other_programs_print_is_no_part_of_the_json(monkeypatch, capfd):
    loud = ["echo", "loud"]
    monkeypatch.setattr("dem.commands.deck", lambda **_: subprocess.run(loud, check=True) and DeckResult(HERE))
    for switches, told in (["--json"], "loud\n"), (["--json", "--quiet"], ""):
        assert main([*switches, "deck", *ON_SCENE]) == 0
        said = capfd.readouterr()
        assert json.loads(said.out) == {"deck": "here"} and said.err == told


def test_every_command_is_tested():
    here = {"recognise", "features", "fit", "check"} | {name for name, _ in CANNED}
    assert here == COMMANDS.keys() - {"doctor", "completion"}  # which tests/test_gangue.py has


@pytest.mark.parametrize("name", COMMANDS)
def test_the_arguments_of_a_command_are_the_parameters_of_its_function(name):
    """All that is given reaches the function, by a name that it has."""
    function = COMMANDS[name].load()
    given = {action.dest for action in commands_of(parser_of())[name]._actions} - {"help", "json", "quiet"}
    assert given == inspect.signature(function).parameters.keys()
    assert issubclass(inspect.get_annotations(function, eval_str=True)["return"], Result)
