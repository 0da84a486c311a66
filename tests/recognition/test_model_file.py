"""A model file holds exactly what a method needs; and which method is the best to ask."""

import copy

import numpy as np
import pytest

from recognition import Answer, FusionQ, Model
from recognition.__main__ import main
from recognition.estimation.window import Window
from recognition.model_file import decode, encode

RATIOS = np.arange(11) / 10


@pytest.fixture
def saved():
    return encode(FusionQ().fit(np.column_stack([RATIOS + k * RATIOS**2 for k in range(8)]), RATIOS))


def test_written_and_read(saved):
    assert encode(decode(saved, FusionQ)) == saved


@pytest.mark.parametrize("change", [
    lambda fit: fit.update(other=1.0), lambda fit: fit.pop("r2"), lambda fit: fit.update(r2="0.99"),
    lambda fit: fit.update(r2=True), lambda fit: fit.update(r2=float("nan")), lambda fit: fit.update(coefficients=[]),
    lambda fit: fit.update(coefficients=["0.1", "0.2"]), lambda fit: fit.update(coefficients=[0.1, float("inf")])])
def test_nothing_is_converted_or_filled_in(saved, change):
    changed = copy.deepcopy(saved)
    change(changed["fit_"])
    with pytest.raises((KeyError, TypeError, ValueError)):
        decode(changed, FusionQ)


@pytest.mark.parametrize(("draws", "columns_there", "expected"), [
    (22, True, "arrangement_likelihood"), (22, False, "energies_all"), (1, False, "energies_sensors")])
def test_the_best_method(draws, columns_there, expected):
    """A method that does not apply is passed over; after one draw, energies_all is not asked."""
    arrangement = Answer(0.3, 0.2, 0.4) if columns_there else Answer.none("no column")
    answers = {"fusion_q": Answer(0.3), "energies_sensors": Answer(0.3, 0.2, 0.4), "energies_all": Answer(0.3, 0.2, 0.4),
               "impulse": Answer.none("no column"), "arrangement_likelihood": arrangement}
    model = Model(Window(6667.0, 267), {}, {"groups": draws})
    assert model.best(answers)[0] == expected
    assert model.best({"fusion_q": Answer(0.3)}) is None


@pytest.mark.parametrize("method", ["fusion_q", "energies_sensors", "energies_all", "impulse", "arrangement_likelihood"])
def test_one_method_that_finds_a_misfit_vetoes_the_answers_of_all_others(method):
    answers = {name: Answer(0.3, 0.2, 0.4) for name in ("fusion_q", "energies_sensors", "energies_all", "impulse",
                                                        "arrangement_likelihood")}
    model = Model(Window(6667.0, 267), {}, {"groups": 22})
    assert model.best(answers) is not None
    answers[method] = Answer(0.3, 0.2, 0.4, "misfit 3, limit 2")
    assert model.best(answers) is None and model.vetoes(answers) == {method: "misfit 3, limit 2"}


def test_no_number_is_printed_where_one_method_vetoes(monkeypatch, tmp_path, capsys):
    model = Model(Window(6667.0, 267), {}, {"groups": 22})
    answers = {"fusion_q": Answer(0.31), "energies_all": Answer(0.32, 0.25, 0.45),
               "arrangement_likelihood": Answer(0.33, 0.2, 0.4, "misfit of the plate's model 7, limit 2")}
    monkeypatch.setattr(Model, "load", classmethod(lambda cls, path: model))
    monkeypatch.setattr(Model, "recognise", lambda self, signals, source: answers)
    (tmp_path / "record.csv").write_text("t_s,a_m_s2\n0,1\n0.1,2\n")
    assert main(["recognise", str(tmp_path / "record.csv"), "--model", "model.json"]) == 3
    said = capsys.readouterr().out
    assert "OUT OF DISTRIBUTION" in said and "misfit" in said and "%" not in said
    assert not any(number in said for number in ("31", "32", "33", "25", "45"))
    del answers["arrangement_likelihood"]
    assert main(["recognise", str(tmp_path / "record.csv"), "--model", "model.json"]) == 0
    assert "mixing ratio 32.0 %" in capsys.readouterr().out
