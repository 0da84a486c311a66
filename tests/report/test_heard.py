"""The ratio over time of a stream that was listened to, beside what fell."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from analysis.sweep.runs import COLUMNS
from report.missing import MissingResult
from report.stream import HEARD_WINDOW_S, HeardStream, StreamResults, stop


def fallen(path):
    """A gangue stone of 0.3 kg, then coal of 0.1 kg, and one that never came."""
    path.mkdir()
    pd.DataFrame(0.0, index=range(3), columns=COLUMNS).assign(
        first_contact_s=[0.1, 0.2, np.nan], material=["rock", "coal", "coal"],
        mass_kg=[0.3, 0.1, 0.1]).to_parquet(path / "stones.parquet")
    scene = SimpleNamespace(kind_of={"rock": "gangue", "coal": "coal"}.get)
    return StreamResults(SimpleNamespace(path=path, scene=scene, t_s=np.array([0.0, 0.5])))


def test_truth_is_the_share_by_mass_of_the_last_window(tmp_path):
    results, heard = fallen(tmp_path / "ratio_040"), tmp_path / "heard"
    heard.mkdir()
    with pytest.raises(MissingResult, match="make recognise"):
        _ = results.heard
    pd.DataFrame({"t_s": [0.1], "gangue": [1.0], "alarm": [True], "mass_coal_kg": 0.1, "mass_gangue_kg": 0.3,
                  "mass_coal_sd_kg": 0.0, "mass_gangue_sd_kg": 0.0}).to_parquet(heard / "stones.parquet")
    pd.DataFrame({"ratio": [0.5]}).to_parquet(heard / "ratio.parquet")
    found = results.heard
    nearest = {t_s: np.argmin(abs(found.heard["t_s"] - t_s)) for t_s in (0.05, 0.15, 0.25, 0.35)}
    at = {t_s: found.heard["truth"].iloc[k] for t_s, k in nearest.items()}
    assert np.isnan(at[0.05]) and at[0.15] == 1.0 and at[0.25] == pytest.approx(0.75) and at[0.35] == 0.0
    assert found.heard_s.tolist() == found.alarm_s.tolist() == [0.1]
    assert HEARD_WINDOW_S == 0.2
    with pytest.raises(MissingResult, match="--stop-above"):
        stop.drawn(results)
    pd.DataFrame({"threshold": [2.0, 4.0], "false_alarms_1_h": [9.0, 1.0], "delay_s": [2.0, 4.0],
                  "chosen": [False, True]}).to_parquet(heard / "stop.parquet")
    lines = stop.drawn(StreamResults(results.run))[0].axes[0].lines
    assert [line.get_xydata().tolist() for line in lines] == [[[9.0, 2.0], [1.0, 4.0]], [[1.0, 4.0]]]
    pd.DataFrame({"ratio": [np.nan]}).to_parquet(heard / "ratio.parquet")
    with pytest.raises(MissingResult, match="did not trust"):
        _ = StreamResults(results.run).heard


def test_the_interval_covers_the_truth_at_half_of_the_times_that_have_both():
    heard = pd.DataFrame({"mass_low": 0.2, "mass_ratio": [0.3, 0.3, 0.3, np.nan], "mass_high": 0.4,
                          "truth": [0.4, 0.5, np.nan, 0.3]})
    assert HeardStream(heard, np.empty(0), np.empty(0)).covered == 0.5
