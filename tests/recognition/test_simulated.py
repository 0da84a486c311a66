"""On runs of the simulation (impacts.parquet): six draws of eleven ratios, and another plate."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression

from recognition.energies import CalibratedEnergies


@pytest.fixture(scope="module")
def impacts():
    table = pd.read_parquet(Path(__file__).with_name("data") / "impacts.parquet")
    keys, signals = zip(*table.groupby(["group", "gangue_ratio"]), strict=True)
    return np.array([k[0] for k in keys]), np.array([k[1] for k in keys]), signals


def test_a_draw_held_out_is_recognised_better_than_by_a_straight_line(impacts):
    groups, ratio, signals = impacts
    method = CalibratedEnergies("energies_rms")
    X = np.stack([method.prepare(s) for s in signals])
    errors, straight, inside = [], [], []
    for group in (g for g in np.unique(groups) if not g.startswith("thin")):
        train, test = (groups != group) & ~np.char.startswith(groups, "thin"), groups == group
        found = [method.fit(X[train], ratio[train], groups[train]).recognise(x) for x in X[test]]
        errors += [r.ratio - b for r, b in zip(found, ratio[test], strict=True)]
        inside += [r.low <= b <= r.high for r, b in zip(found, ratio[test], strict=True)]
        straight += list(LinearRegression().fit(np.exp(X[train, 0]), ratio[train]).predict(np.exp(X[test, 0])) - ratio[test])
    assert len(errors) == 66
    assert np.abs(errors).mean() < 0.06 and np.abs(errors).mean() < np.abs(straight).mean()
    assert 0.75 < np.mean(inside) <= 1


def test_another_plate_is_flagged(impacts):
    groups, ratio, signals = impacts
    thin = np.char.startswith(groups, "thin")
    method = CalibratedEnergies("energies_sensors")
    X = np.stack([method.prepare(s) for s in signals])
    method.fit(X[~thin], ratio[~thin], groups[~thin])
    assert sum(method.recognise(x).strange != "" for x in X[thin]) >= thin.sum() - 1
    assert np.mean([method.recognise(x).strange != "" for x in X[~thin]]) == 0
