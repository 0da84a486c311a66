"""A model file holds exactly what a method needs; and which method is the best to ask."""

import copy

import numpy as np
import pytest

from recognition import Answer, FusionQ, Model
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


@pytest.mark.parametrize(("draws", "places_known", "expected"), [
    (22, True, "arrangement_likelihood"), (22, False, "energies_all"), (1, False, "energies_sensors")])
def test_the_best_method(draws, places_known, expected):
    """A record that no arrangement explains goes to the next method; after one draw, energies_all is not asked."""
    answers = {"fusion_q": Answer(0.3), "energies_sensors": Answer(0.3, 0.2, 0.4), "energies_all": Answer(0.3, 0.2, 0.4),
               "impulse": Answer.none("no column"),
               "arrangement_likelihood": Answer(0.3, 0.2, 0.4, "" if places_known else "misfit", places_known)}
    model = Model(Window(6667.0, 267), {}, {"groups": draws})
    assert model.best(answers)[0] == expected
    assert model.best({"fusion_q": Answer(0.3)}) is None
    only = {"arrangement_likelihood": Answer(0.3, 0.2, 0.4, "misfit", False)}
    assert model.best(only)[1].out_of_distribution
