"""Splits never share a group, noise is as loud as it says, and the table holds what was asked for."""

import numpy as np
import pandas as pd
import pytest

from lab.recognition.baselines import EVALUATED
from recognition import RecognitionError
from recognition.estimation.noise import with_noise
from recognition.evaluation import (
    CASES,
    ONE_THING,
    Case,
    DataSet,
    Evaluation,
    _kin,
    evaluate,
    read_dataset,
    summary,
    write_evaluation,
)
from tests.analysis import synthetic

FAMILIES = {"paper": (1, 11), "clean": (44, 1), "damping": (12, 1), "speed": (12, 1), "stones": (12, 1), "natural": (4, 11),
            "wide": (12, 1), **dict.fromkeys(ONE_THING, (12, 1))}


MANY = next(case for case in CASES if case.name == "clean")


def only(*names):
    return {name: EVALUATED[name] for name in names}


def rows():
    rng = np.random.default_rng(1)
    return pd.DataFrame([
        {"family": name, "group": f"{name}/{g:03d}", "gangue_ratio": k / 10 if runs == 11 else rng.integers(11) / 10,
         "kin": "paper" if name == "paper" else str(g % 8), "speed_m_s": rng.uniform(2, 4), "damping_ratio": rng.uniform(0.005, 0.02)}
        for name, (groups, runs) in FAMILIES.items() for g in range(groups) for k in range(runs)])


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_what_is_held_out_is_not_in_the_training(case):
    data = DataSet([], rows(), [])
    tested = []
    for train, test in Evaluation(data).splits(case):
        seen, held = data.table.iloc[train], data.table.iloc[test]
        assert len(train) and len(test)
        assert not set(seen["kin"]) & set(held["kin"])
        tested.append(test)
    assert sorted(np.concatenate(tested)) == sorted(data.of(*case.families))  # each once


def test_kin_have_something_in_common_if_only_by_way_of_others():
    order, packing = pd.Series(list("aabcdd")), pd.Series(list("uvvwxy"))
    found = _kin(pd.Series(range(6)), order, packing)
    alike = {(i, j): order[i] == order[j] or packing[i] == packing[j] for i in range(6) for j in range(6)}
    assert [set(np.flatnonzero(found == one).tolist()) for one in found] == [{0, 1, 2}, {0, 1, 2}, {0, 1, 2}, {3}, {4, 5}, {4, 5}]
    assert not alike[0, 2]  # they are kin by way of 1 alone


def test_a_case_without_runs_says_so():
    data = DataSet([], rows().query("family == 'clean'"), [])
    with pytest.raises(RecognitionError, match="no run of the families free"):
        list(Evaluation(data).splits(Case("x", "positions", ("free",))))


def test_a_data_set_of_other_families_is_refused(tmp_path):
    data = DataSet([], rows()[lambda table: table["family"] == "speed"].assign(family="mine"), [])
    with pytest.raises(RecognitionError, match="families mine; needs one of paper, clean, stones"):
        write_evaluation(data, tmp_path, only("rms_line"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("db", [20.0, 40.0])
def test_noise_is_as_loud_as_it_says_and_the_same_again(db):
    t = np.arange(5000) / 6667
    signals = pd.DataFrame({"t_s": t, "v_m_s": 1e-3 * np.sin(300 * t), "a_m_s2": 400.0 * np.cos(900 * t)})
    found = with_noise(signals, db, np.random.default_rng(3))
    assert found["t_s"].equals(signals["t_s"])
    was, added = signals[["v_m_s", "a_m_s2"]], (found - signals)[["v_m_s", "a_m_s2"]]
    level = 20 * np.log10(np.sqrt((added**2).mean()) / np.sqrt((was**2).mean()))
    assert level.to_numpy() == pytest.approx(-db, abs=0.2)
    pd.testing.assert_frame_equal(found, with_noise(signals, db, np.random.default_rng(3)))
    assert with_noise(signals, None, np.random.default_rng(3)) is signals


@pytest.fixture(scope="module")
def monkeypatch_module():
    with pytest.MonkeyPatch.context() as patch:
        yield patch


@pytest.fixture(scope="module")
def synthetic_set(tmp_path_factory, monkeypatch_module):
    out = tmp_path_factory.mktemp("dataset")
    synthetic.SCENE["plate"]["damping_ratio"] = 0.01
    order = list(synthetic.SCENE["stones"]["gangue_order"])
    for group in range(3):  # each an arrangement and packings of its own
        monkeypatch_module.setitem(synthetic.SCENE["stones"], "seed", 1000 * group)
        monkeypatch_module.setitem(synthetic.SCENE["stones"], "gangue_order", order[group:] + order[:group])
        for k in (0, 3, 5, 8, 10):
            synthetic.write_run(out / "clean" / f"{group:03d}" / f"ratio_{10 * k:03d}", k / 10, 100 * group + k, 0.02)
    return out


@pytest.mark.slow
def test_evaluation_csv(synthetic_set):
    path = write_evaluation(read_dataset(synthetic_set), synthetic_set, only("rms_line"))
    found = pd.read_csv(path, comment="#")
    assert list(found.columns[:9]) == ["method", "held_out", "noise_db", "n", "mean_abs_error_points", "p95_points",
                                       "worst_points", "bias_points", "coverage_90"]
    many = found[(found["case"] == "clean") & found["noise_db"].isna()].set_index("method")
    assert (many["n"] == 15).all() and (many["answered"] == 15).all()
    assert (many["mean_abs_error_points"] < 4).all() and (many["worst_points"] >= many["p95_points"]).all()
    assert (many["coverage_90"] > 0.7).all()
    free = found[found["case"] == "free alone"]
    assert free["reason"].str.contains("no run of the families free").all()


@pytest.mark.slow
def test_the_table_counts_as_one_counts_by_hand(synthetic_set):
    data = read_dataset(synthetic_set)
    results = evaluate(data, only("rms_line"), [MANY], [None], progress=lambda line: None)
    answers, row = results[0].answers, summary(results[0])
    error = [100 * (a - b) for a, b in zip(answers["ratio"], answers["true"], strict=True)]
    assert row["mean_abs_error_points"] == pytest.approx(sum(map(abs, error)) / 15)
    assert row["worst_points"] == pytest.approx(max(map(abs, error)))
    assert row["bias_points"] == pytest.approx(sum(error) / 15)
    inside = [low <= b <= high for low, b, high in zip(answers["low"], answers["true"], answers["high"], strict=True)]
    assert row["coverage_90"] == pytest.approx(sum(inside) / 15)


def test_every_method_says_which_column_it_misses():
    signals = pd.DataFrame({"t_s": np.arange(300) / 6667, "other": np.ones(300)})
    for entry in EVALUATED.values():
        with pytest.raises(RecognitionError, match="no column"):
            entry.make().prepare(signals)


def test_a_method_that_the_records_do_not_allow_says_why(synthetic_set):
    """These runs have no forces of single stones."""
    (result,) = Evaluation(read_dataset(synthetic_set)).run(MANY, *only("arrangement_likelihood").popitem(), (None,))
    assert "fall at once and on the same places" in result.reason and summary(result)["answered"] == 0
