import json
import math
import re

import pytest

from analysis import read_sweep
from common.files.whole import SEAL, seal
from recognition import Model, RecognitionError
from recognition.__main__ import main
from recognition.commands import RecogniseResult
from recognition.estimation.answer import Answer
from recognition.methods import METHODS
from recognition.models import PreparedRuns
from tests.analysis.synthetic import write_sweep

RATIOS = (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)


@pytest.fixture(scope="module")
def sweep_path(tmp_path_factory):
    return write_sweep(tmp_path_factory.mktemp("runs") / "paper", ratios=RATIOS)


@pytest.fixture(scope="module")
def model(sweep_path):
    return Model.fit(read_sweep(sweep_path).runs)


@pytest.mark.slow
def test_unseen_ratios_are_recognised(model, tmp_path):
    """Runs with other second impacts (another seed) than those of the training."""
    sweep = read_sweep(write_sweep(tmp_path / "x", ratios=(0.3, 0.7), seed=91))
    for run in sweep.runs:
        for method, answer in model.recognise(run.signals).items():
            if method == "arrangement_likelihood":  # these runs have no fast stream to learn it from
                assert "whose stones fall at once" in answer.reason
                continue
            assert answer.ratio == pytest.approx(run.gangue_ratio, abs=0.03), method


@pytest.mark.slow
def test_held_out_ratios(sweep_path):
    runs = read_sweep(sweep_path).runs
    prepared = PreparedRuns.of(runs)
    for held_out, run in enumerate(runs):
        answers = prepared.answers_without(held_out)
        assert answers["fusion_q"].ratio == pytest.approx(run.gangue_ratio, abs=0.05)
        assert answers["energy_fusion_modified"].ratio == pytest.approx(run.gangue_ratio, abs=0.05)


@pytest.mark.slow
def test_saved_model_answers_the_same_and_holds_no_code(model, sweep_path, tmp_path):
    model.save(tmp_path / "model.json")
    again = Model.load(tmp_path / "model.json")
    signals = read_sweep(sweep_path).runs[4].signals
    expected = model.recognise(signals)
    assert {name: str(a) for name, a in again.recognise(signals).items()} == {name: str(expected[name]) for name in again.methods}
    saved = json.loads((tmp_path / "model.json").read_text())
    assert saved["version"] == 11 and len(saved["provenance"]["runs"]) == len(RATIOS)
    assert saved["provenance"]["runs"][3]["seeds"] == {"packing": 10007}


@pytest.mark.parametrize(
    "change",
    [{"version": 99}, {"format": "other"}, {"methods": {}}, {"methods": 3}, {"parameters": ["rms"]}],
)
def test_broken_models_are_refused_in_one_line(model, tmp_path, change):
    model.save(tmp_path / "model.json")
    data = json.loads((tmp_path / "model.json").read_text())
    (tmp_path / "model.json").write_text(json.dumps(seal({k: v for k, v in (data | change).items() if k != SEAL})))
    with pytest.raises(RecognitionError, match="model.json") as error:
        Model.load(tmp_path / "model.json")
    assert "\n" not in str(error.value)


def same_content(damaged, whole):
    try:
        return json.loads(damaged) == json.loads(whole)
    except ValueError:
        return False


def test_no_bit_of_a_model_can_change_unnoticed(model, tmp_path):
    """200 flipped bits, evenly over the file: each that changes what it says is refused in one line."""
    file = tmp_path / "model.json"
    model.save(file)
    whole = file.read_bytes()
    Model.load(file)
    for k in range(200):
        damaged = bytearray(whole)
        damaged[k * len(whole) // 200] ^= 1 << k % 8
        file.write_bytes(damaged)
        if same_content(damaged, whole):  # 1e-05 and 1E-05 are one number
            continue
        with pytest.raises(RecognitionError, match="model.json"):
            Model.load(file)


def test_a_model_is_written_over_a_model_only(sweep_path, tmp_path, capsys):
    notes = tmp_path / "notes.json"
    notes.write_text("mine")
    for out in (str(notes), f"{tmp_path}/", str(tmp_path)):
        assert main(["fit", str(sweep_path), "--out", out]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert notes.read_text() == "mine" and [p.name for p in tmp_path.iterdir()] == ["notes.json"]


@pytest.mark.parametrize("name", ["model", "model.toml", "model.JSON"])
def test_a_models_name_ends_in_json(sweep_path, tmp_path, capsys, name):
    assert main(["fit", str(sweep_path), "--out", str(tmp_path / name)]) == 2
    assert "the name must end in .json" in capsys.readouterr().err and not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "why"), [("", "no finished run"), ("nowhere", "no such directory")])
def test_runs_to_fit_that_are_not_there_are_named(tmp_path, capsys, name, why):
    assert main(["fit", str(tmp_path / name), "--out", str(tmp_path / "x.json")]) == 2
    told = capsys.readouterr().err
    assert f"{tmp_path / name}: {why}; needs FAMILY/GROUP/ratio_*" in told and "ratio_* of `gangue sweep`" in told


def test_acceleration_alone_is_enough_for_q(model, sweep_path):
    run = read_sweep(sweep_path).runs[RATIOS.index(0.6)]
    answers = model.recognise(run.signals[["t_s", "a_m_s2"]])
    assert answers["fusion_q"].ratio == pytest.approx(0.6, abs=0.02)
    assert "internal_J" in answers["energy_fusion_modified"].reason


@pytest.mark.slow
def test_energies_of_other_sensors_than_the_training_has_give_no_ratio(model, sweep_path):
    """Pooled over three of four, they are as far off as a record of less gangue."""
    signals = read_sweep(sweep_path).runs[4].signals
    north, *_ = (name for name in signals if name.startswith("acc_"))
    for other in (signals.drop(columns=north), signals.rename(columns={north: "acc_attic_m_s2"})):
        answer = model.recognise(other)["energies_sensors"]
        assert math.isnan(answer.ratio) and "the training has acc_" in answer.reason
    assert not model.recognise(signals)["energies_sensors"].reason


def test_a_method_that_finds_a_record_unlike_its_training_says_no_ratio():
    result = RecogniseResult("x", "a", {"a": Answer(0.4, 0.4, 0.4), "b": Answer(0.1, 0.0, 0.2, "misfit 9, limit 2")})
    assert list(result.words())[-1].split(maxsplit=1) == ["b", "out of distribution: misfit 9, limit 2"]


@pytest.mark.slow
def test_command_line(sweep_path, tmp_path, capsys):
    out = tmp_path / "model.json"
    assert main(["fit", str(sweep_path), "--out", str(out)]) == 0
    assert main(["recognise", str(sweep_path / "ratio_030"), "--model", str(out)]) == 0
    said = capsys.readouterr().out
    assert re.search(r"^mixing ratio (29|30|31)\.\d %, 90 % interval", said, re.MULTILINE)
    answers = re.findall(r"^(\S+) +([\d.]+) %$", said, re.MULTILINE)
    assert {name for name, _ in answers} == set(METHODS) - {"arrangement_likelihood"}
    assert all(abs(float(value) - 30) < 2 for _, value in answers)
    (tmp_path / "other.csv").write_text("t_s,a_m_s2\n0,1\n0.1,2\n0.2,0\n")
    for arguments in (
        ["recognise", str(tmp_path / "other.csv"), "--model", str(out)],
        ["recognise", str(sweep_path / "ratio_030"), "--model", str(tmp_path / "none.json")],
        ["fit", str(tmp_path), "--out", str(out)],
    ):
        assert main(arguments) == 2
        captured = capsys.readouterr()
        assert captured.out == "" and captured.err.count("\n") == 1


@pytest.mark.parametrize(("low", "high", "reach"), [(0.4, 0.5, "10.0"), (0.5, 0.56, "6.0"), (0.45, 0.55, ""), (0.5, 0.5, "")])
def test_a_wide_interval_is_warned_of(low, high, reach):
    answer = Answer(0.5, low, high)
    first, *lines, last = RecogniseResult("x", "one", {"one": answer}, tuple(filter(None, [answer.warning]))).words()
    assert first.startswith("mixing ratio 50.0 %") and last.startswith("one")
    assert ["WARNING" in line and f"{reach} points" in line for line in lines] == ([True] if reach else [])


@pytest.mark.slow
def test_too_few_ratios(sweep_path):
    with pytest.raises(RecognitionError, match="6 runs at 3 mixing ratios; needs at least 4"):
        Model.fit(2 * read_sweep(sweep_path).runs[:3])
