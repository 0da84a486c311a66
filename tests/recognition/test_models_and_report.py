import csv
import json
import re

import pytest

from analysis import read_sweep
from recognition import Model, RecognitionError, leave_one_out
from recognition.__main__ import main
from recognition.methods import METHODS
from report.__main__ import main as report_main
from report.page import write_report
from tests.analysis.synthetic import write_run, write_sweep


@pytest.fixture(scope="module")
def sweep_path(tmp_path_factory):
    return write_sweep(tmp_path_factory.mktemp("runs") / "paper")


@pytest.fixture(scope="module")
def model(sweep_path):
    return Model.fit(read_sweep(sweep_path).runs)


def test_unseen_ratios_are_recognised(model, tmp_path):
    """Runs with other second impacts (another seed) than those of the training."""
    sweep = read_sweep(write_sweep(tmp_path / "x", ratios=(0.3, 0.7), seed=91))
    for run in sweep.runs:
        for method, answer in model.recognise(run.signals).items():
            if method == "arrangement_likelihood":  # these runs have no fast stream to learn it from
                assert "whose stones fall at once" in answer.reason
                continue
            assert answer.ratio == pytest.approx(run.gangue_ratio, abs=0.03), method


def test_held_out_ratios(sweep_path):
    runs = read_sweep(sweep_path).runs
    for run, answers in zip(runs, leave_one_out(runs), strict=True):
        assert answers["fusion_q"].ratio == pytest.approx(run.gangue_ratio, abs=0.05)
        assert answers["energy_fusion_modified"].ratio == pytest.approx(run.gangue_ratio, abs=0.05)


def test_saved_model_answers_the_same_and_holds_no_code(model, sweep_path, tmp_path):
    model.save(tmp_path / "model.json")
    again = Model.load(tmp_path / "model.json")
    signals = read_sweep(sweep_path).runs[4].signals
    expected = model.recognise(signals)
    assert {name: str(a) for name, a in again.recognise(signals).items()} == {name: str(expected[name]) for name in again.methods}
    saved = json.loads((tmp_path / "model.json").read_text())
    assert saved["version"] == 5 and len(saved["provenance"]["runs"]) == 11
    assert saved["provenance"]["runs"][3]["seeds"] == {"packing": 10007}


@pytest.mark.parametrize(
    "change",
    [{"version": 99}, {"format": "other"}, {"methods": {}}, {"methods": 3}, {"parameters": ["rms"]}],
)
def test_broken_models_are_refused_in_one_line(model, tmp_path, change):
    model.save(tmp_path / "model.json")
    data = json.loads((tmp_path / "model.json").read_text())
    (tmp_path / "model.json").write_text(json.dumps(data | change))
    with pytest.raises(RecognitionError, match="model.json") as error:
        Model.load(tmp_path / "model.json")
    assert "\n" not in str(error.value)


def test_acceleration_alone_is_enough_for_q(model, sweep_path):
    run = read_sweep(sweep_path).runs[6]
    answers = model.recognise(run.signals[["t_s", "a_m_s2"]])
    assert answers["fusion_q"].ratio == pytest.approx(0.6, abs=0.02)
    assert "internal_J" in answers["energy_fusion_modified"].reason


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


def test_command_line_of_the_report(tmp_path, capsys):
    assert report_main([str(tmp_path / "none")]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1


EVALUATION = """method,held_out,noise_db,n,mean_abs_error_points,p95_points,worst_points,bias_points,coverage_90,case,answered,\
flagged,reason
rms_line,packing,,30,4.25,8.5,9.75,-0.5,0.9,many runs,30,0.0,
rms_line,packing,20.0,30,5.25,9.5,10.75,-0.5,0.8,many runs,30,0.0,
fusion_q,packing,20.0,30,,,,,,many runs,0,0.0,too few runs
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """Of an incomplete sweep: some ratios are missing, one directory is no run."""
    path = write_sweep(tmp_path_factory.mktemp("some") / "paper", ratios=(0.0, 0.2, 0.5, 0.6, 0.8, 1.0))
    (path / "ratio_010").mkdir()
    (path.parent / "dataset").mkdir()
    (path.parent / "dataset" / "evaluation.csv").write_text(EVALUATION)
    return write_report(path)


def test_report_holds_everything_inside(report):
    html = report.read_text()
    assert not re.search(r'(?:src|href)="(?!data:|#)', html)
    targets = re.findall(r'href="#([^"]+)"', html)
    assert set(targets) <= set(re.findall(r'id="([^"]+)"', html))
    for number in (7, 8, 9, 10, 13, 14, 15, 16, 17, 18, 19, 21, 22, 23, 24, 25, 26, 27, 28, 29, 33, 37, 38):
        assert f'id="fig-{number}"' in html
    assert "Figure 11 is not at hand" in html and "table-2" in html
    # A rigid plate has no modes: its stress is not drawn, and that is said. Everything else is.
    not_drawn = re.findall(r'<figure id="([^"]+)">(?:(?!</figure>).)*Not drawn:', html, re.DOTALL)
    assert not_drawn == ["fig-21", "fig-21-contact"]
    assert 'id="table-rules"' in html
    assert re.search(r"many runs</td>\s*<td>RMS and a straight line</td>\s*<td>-</td>\s*<td>30.of.30</td>\s*<td>4.25", html)


def test_report_of_an_incomplete_sweep_says_so(report):
    html = report.read_text()
    assert re.search(r"Missing:\s+10, 30, 40, 70, 90", html)
    assert "Passed over" in html


def test_report_of_one_run_says_what_it_cannot_give(tmp_path):
    write_run(tmp_path / "paper" / "ratio_050", 0.5)
    report = write_report(tmp_path / "paper")
    html = report.read_text()
    assert "needs at least 4 different mixing ratios" in html
    assert "evaluation.csv: no such file; `make dataset` writes it" in html
    assert "Not given:" in html and 'src="data:' in html
    assert ",not tested," in report.with_name("claims.csv").read_text()


def test_claims_table_is_beside_the_report(report):
    rows = list(csv.reader(report.with_name("claims.csv").open()))
    assert rows[0] == ["claim", "where", "verdict", "value", "expected"]
    assert len(rows) > 25 + 1
    assert {row[2] for row in rows[1:]} <= {"held", "partly", "not held", "not tested"}
    verdict = {row[0]: row[2] for row in rows[1:]}
    # What the synthetic runs are made to be: forces by the ratio, coal breaking more, one area for each.
    assert verdict["The largest total contact force rises with the ratio"] == "held"
    assert verdict["After the first collision one coal is broken much more than one gangue"] == "held"
    assert verdict["The broken area of a single coal or gangue does not change with the ratio"] == "held"
    assert verdict["The totally broken area increases with the ratio (against Fig. 15)"] == "not held"
    assert verdict["The overall stress under the particles rises with the ratio"] == "not tested"


def test_too_few_ratios(tmp_path):
    write_run(tmp_path / "ratio_000", 0.0)
    with pytest.raises(RecognitionError, match="at least 4"):
        Model.fit(read_sweep(tmp_path).runs)
