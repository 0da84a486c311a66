"""How often a good record is vetoed: its draw of arrangement and packing was not trained on, all else is as there."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom

from recognition.regression.feature_regression import FeatureRegression

IMPACTS = Path(__file__).resolve().parents[1] / "recognition" / "data" / "impacts.parquet"
BY_DESIGN = 0.05  # of held-out runs are beyond the quantile that a limit is 1.5 times of


@pytest.mark.validate
def test_good_records_are_seldom_vetoed_and_those_of_another_plate_always():
    """Records of one draw are alike in all but their ratio, so draws are counted: as many of them may have a veto as
    have it by chance in 95 of 100 cases."""
    keys, signals = zip(*pd.read_parquet(IMPACTS).groupby(["group", "gangue_ratio"]), strict=True)
    groups, ratio = (np.array(values) for values in zip(*keys, strict=True))
    good = ~np.char.startswith(groups, "thin_plate")
    draws = np.unique(groups[good])
    vetoed = np.zeros(len(groups), bool)
    method = FeatureRegression("energies_sensors")
    features = np.stack([method.prepare(table) for table in signals])
    for train, test in [*((good & (groups != draw), groups == draw) for draw in draws), (good, ~good)]:
        method.fit(features[train], ratio[train], groups=groups[train])
        vetoed[test] = [answer.out_of_distribution != "" for answer in method.answer(features[test])]
    of_draws = [vetoed[groups == draw].any() for draw in draws]
    print(f"vetoed: {vetoed[good].sum()} of {good.sum()} good records, {sum(of_draws)} of {len(draws)} draws; "
          f"{vetoed[~good].sum()} of {(~good).sum()} of another plate")
    assert good.sum() == 66 and sum(of_draws) <= binom.ppf(0.95, len(draws), BY_DESIGN)
    assert vetoed[~good].all()
