"""The tutorials run from top to bottom, and what they show is right."""

import json
from pathlib import Path

import numpy as np
import pytest

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

TUTORIALS = Path(__file__).resolve().parents[1] / "docs" / "tutorials"


def cells(name):
    notebook = json.loads((TUTORIALS / name).read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    return notebook["cells"]


def run(name, directory, monkeypatch):
    """The names of a notebook after its last cell, run in `directory`."""
    monkeypatch.chdir(directory)
    names = {"__name__": name}
    for number, cell in enumerate(cells(name)):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{name}, cell {number}", "exec"), names)  # noqa: S102  our own
    return names


@pytest.mark.parametrize("file", sorted(TUTORIALS.glob("*.ipynb")), ids=lambda file: file.name)
def test_a_tutorial_is_kept_without_what_a_machine_made_of_it(file):
    for cell in cells(file.name):
        assert not cell.get("outputs") and cell.get("execution_count") is None


@pytest.mark.slow
def test_from_a_scene_to_a_picture(tmp_path, monkeypatch):
    names = run("scene_to_picture.ipynb", tmp_path, monkeypatch)
    summary, scene = names["summary"], names["scene"]
    mass_kg = sum(4 / 3 * np.pi * scene.stones.radius_m**3 * scene.materials[name].density_kg_m3
                  for name in summary["materials"])
    # Momentum: the plate's push less the weight, which acts throughout.
    weight_N_s = mass_kg * scene.time.gravity_m_s2 * scene.time.duration_s
    assert summary["momentum_change_kg_m_s"] == pytest.approx(summary["impulse_N_s"] - weight_N_s, rel=1e-3)
    lowest_m = names["modes"].node_m[np.argmin(names["deflection_m"])]
    below_m = min(np.hypot(*(lowest_m - place)) for place in scene.stones.positions_m)
    assert below_m < scene.stones.radius_m  # it is below a stone
    for picture in ("tutorial_signals.png", "tutorial_plate.png"):
        assert (tmp_path / "runs" / picture).stat().st_size > 10_000


@pytest.mark.slow
def test_my_own_record(tmp_path, monkeypatch):
    names = run("own_record.ipynb", tmp_path, monkeypatch)
    resolution_Hz = names["frequency_Hz"][1]
    assert names["record"].rate_Hz == pytest.approx(10_000.0) and names["record"].unit == "m/s^2"
    np.testing.assert_allclose(names["found_Hz"], [220.0, 640.0], atol=resolution_Hz)
    np.testing.assert_allclose(names["record"].values, names["hit"], atol=0.05 * 5)  # but for the noise
