"""What is read from runs afterwards: the plate's motion anywhere, and tables of runs and stones."""

import json

import numpy as np
import pandas as pd
import pytest

from common.scene.scene import changed_scene
from dem.run.run import run_scene
from gangue.__main__ import main
from plate_fem.motion import FILE, RecordedMotion

PLACES = {"north": (0.0, 0.17), "corner": (-0.25, 0.25), "west": (-0.153, 0.0471)}
KINDS = {"acceleration": ("acc", "m_s2", "a_m_s2"), "velocity": ("vel", "m_s", "v_m_s"), "displacement": ("disp", "m", "u_m")}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A coarse stone at two speeds, with sensors of each kind."""
    out = tmp_path_factory.mktemp("runs")
    for speed_m_s in (1.5, 3.0):
        scene = changed_scene("tests/single.toml", {
            "stones.agglomerate.contact": "sub_spheres", "stones.agglomerate.subspheres": 60, "stones.speed_m_s": speed_m_s, "time.duration_s": 3e-3,
            "plate.max_frequency_Hz": 5000.0, "time.view_interval_s": None,
            "plate.sensors": [{"name": f"{name}_{kind[0]}", "place_m": [x, y], "kind": kind}
                              for name, (x, y) in PLACES.items() for kind in KINDS]})
        run_scene(scene, "single.toml", out / f"speed_{speed_m_s:g}")
    return out


def test_the_motion_of_a_place_is_what_a_sensor_there_records(runs):
    run = runs / "speed_3"
    signals, found = pd.read_parquet(run / "signals.parquet"), RecordedMotion.read(run).at(list(PLACES.values()))
    for kind, (begin, unit, name) in KINDS.items():
        for k, place in enumerate(PLACES):
            sensor = signals[f"{begin}_{place}_{kind[0]}_{unit}"].to_numpy()
            assert abs(sensor).max() > 0
            np.testing.assert_allclose(found[name][:, k], sensor, atol=2e-6 * abs(sensor).max())
    assert (run / FILE).stat().st_size < 5e5


def test_motion_is_written_and_said(runs, tmp_path, capsys):
    run, out = runs / "speed_3", tmp_path / "motion.csv"
    words = ["--json", "motion", str(run), "--at", "0", "0.17", "--at", "-0.25", "0.25", "--out", str(out)]
    assert main(words) == 0
    said, table = json.loads(capsys.readouterr().out), pd.read_csv(out)
    assert main(words) == 2 and "is there" in capsys.readouterr().err
    sensor = pd.read_parquet(run / "signals.parquet")["acc_north_a_m_s2"]
    np.testing.assert_allclose(table["a_1_m_s2"], sensor, atol=2e-6 * abs(sensor).max())
    assert list(table) == ["t_s", *(f"{name}_{k}_{unit}" for k in (1, 2) for name, unit in (("u", "m"), ("v", "m_s"),
                                                                                        ("a", "m_s2")))]
    assert said["max_a_m_s2"] == pytest.approx(abs(table[["a_1_m_s2", "a_2_m_s2"]]).max().tolist(), rel=1e-12)
    assert said["modes_bytes"] == (run / FILE).stat().st_size
    assert main(words) == 2 and "motion.csv: is there" in capsys.readouterr().err
    assert main(["motion", str(run), "--at", "0", "0"]) == 0 and "without the low pass of" in capsys.readouterr().out
    for wrong, line in ((["--at", "0.26", "0"], "x = 0.26"), (["--at", "0", "0", "--out", str(run / "run.json")], ".csv")):
        assert main(["motion", str(run), *wrong]) == 2
        assert line in capsys.readouterr().err
    assert main(["motion", str(tmp_path), "--at", "0", "0"]) == 2 and FILE in capsys.readouterr().err


def test_a_row_a_run_and_a_row_a_stone(runs, tmp_path, capsys):
    assert main(["--quiet", "table", str(runs), "--out", str(tmp_path / "a.csv")]) == 0
    table = pd.read_csv(tmp_path / "a.csv")
    assert list(table["run"]) == ["speed_1.5", "speed_3"] and list(table["stones.speed_m_s"]) == [1.5, 3.0]
    assert not [name for name in table if "." in name and name != "stones.speed_m_s"]  # all else is the same
    peak = [json.loads((runs / run / "run.json").read_text())["peak_force_N"] for run in table["run"]]
    assert list(table["peak_force_N"]) == peak and peak[1] > 1.5 * peak[0]
    assert main(["--quiet", "table", str(runs), "--stones", "--out", str(tmp_path / "b.csv")]) == 0
    stones = pd.read_csv(tmp_path / "b.csv")
    assert list(stones["run"]) == ["speed_1.5", "speed_3"] and list(stones["stone"]) == [1, 1]
    pytest.importorskip("openpyxl")
    assert main(["--quiet", "table", str(runs), "--out", str(tmp_path / "c.xlsx")]) == 0
    sheets = pd.read_excel(tmp_path / "c.xlsx", sheet_name=None)
    pd.testing.assert_frame_equal(sheets["runs"], table, check_dtype=False)
    pd.testing.assert_frame_equal(sheets["stones"], stones, check_dtype=False)
    for wrong, line in ((["--out", str(tmp_path / "c.xlsx")], "is there"), (["--out", "x.ods"], ".xlsx")):
        assert main(["table", str(runs), *wrong]) == 2 and line in capsys.readouterr().err
    assert main(["table", str(tmp_path)]) == 2 and "no finished run" in capsys.readouterr().err
