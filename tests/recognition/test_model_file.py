"""A model file holds exactly what a method needs; and which method is the best to ask."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest

from recognition import Answer, FusionQ, Model
from recognition.__main__ import main
from recognition.estimation.window import Window
from recognition.models import decode, encode

RATIOS = np.arange(11) / 10


@pytest.fixture
def saved():
    return encode(FusionQ().fit(np.column_stack([RATIOS + k * RATIOS**2 for k in range(8)])[:, None], RATIOS))


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


def known(**errors):
    """A model whose methods have these errors on runs that were held out."""
    return Model(Window(6667.0, 267), {name: SimpleNamespace(error_=error) for name, error in errors.items()}
                 | {"fusion_q": SimpleNamespace()}, {"groups": 22})


def test_the_best_method_is_that_of_the_least_held_out_error():
    """One that does not apply, or gives no interval, is passed over."""
    answers = {"fusion_q": Answer(0.3), "energies_sensors": Answer(0.3, 0.2, 0.4), "arrangement_likelihood": Answer(0.3, 0.2, 0.4)}
    assert known(energies_sensors=0.05, arrangement_likelihood=0.01).best(answers)[0] == "arrangement_likelihood"
    assert known(energies_sensors=0.05, arrangement_likelihood=0.06).best(answers)[0] == "energies_sensors"
    answers["arrangement_likelihood"] = Answer(np.nan, reason="no column")
    assert known(energies_sensors=0.05, arrangement_likelihood=0.01).best(answers)[0] == "energies_sensors"
    assert known(arrangement_likelihood=0.01).best({"fusion_q": Answer(0.3)}) is None


@pytest.mark.parametrize("method", ["fusion_q", "energies_sensors", "arrangement_likelihood"])
def test_one_method_that_finds_a_misfit_vetoes_the_answers_of_all_others(method):
    """Unless a method that seeks the moment of the impact knows the record."""
    answers = {name: Answer(0.3, 0.2, 0.4) for name in ("fusion_q", "energies_sensors")}
    if method == "arrangement_likelihood":
        answers[method] = Answer(0.3, 0.2, 0.4)
    model = known(energies_sensors=0.05, arrangement_likelihood=0.01)
    assert model.best(answers) is not None
    answers[method] = Answer(0.3, 0.2, 0.4, "misfit 3, limit 2")
    assert model.best(answers) is None and model.vetoes(answers) == {method: "misfit 3, limit 2"}
    if method != "arrangement_likelihood":
        answers["arrangement_likelihood"] = Answer(0.3, 0.2, 0.4)
        assert model.best(answers)[0] == "arrangement_likelihood" and model.vetoes(answers) == {}


def test_no_number_is_printed_where_one_method_vetoes(monkeypatch, tmp_path, capsys):
    model = known(energies_sensors=0.05, arrangement_likelihood=0.01)
    answers = {"fusion_q": Answer(0.31), "energies_sensors": Answer(0.32, 0.25, 0.45),
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
