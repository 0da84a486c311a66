"""The numbers of a figure as CSV are those that were drawn."""

import io

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from analysis import read_sweep
from report.drawing.data import to_csv
from report.response import stress_maps
from report.sweep_results import SweepResults
from report.theory import Theory
from tests.analysis.synthetic import write_sweep


def read_back(figure):
    """The lines that name the axes, and the table."""
    text = to_csv(figure)
    return [line for line in text.splitlines() if line.startswith("# ")], pd.read_csv(io.StringIO(text), comment="#")


def test_curves_and_discs_come_back_whatever_their_names_are():
    figure = Figure()
    axis, other = figure.subplots(2)
    axis.set_title('force, 50 % of "all"', loc="left")
    axis.set_xlabel("time, s")
    values = np.array([1.0, np.nan, 1 / 3, -2e-17])
    axis.plot([0, 1, 2, 3], values, label="_30 %")
    other.scatter([0.1, 0.2], [3, 4], c=[5, 6])
    names, table = read_back(figure)
    assert names == ['# force, 50 % of "all": x = time, s, y = -', "# panel 2: x = -, y = -"]
    curve, discs = table[table["series"] == "30 %"], table[table["series"] == "discs"]
    assert set(curve["panel"]) == {'force, 50 % of "all"'} and curve["value"].isna().all()
    assert curve["x"].tolist() == [0, 1, 2, 3]
    assert curve["y"].to_numpy() == pytest.approx(values, rel=1e-4, nan_ok=True)
    assert discs[["x", "y", "value"]].to_numpy().tolist() == [[0.1, 3, 5], [0.2, 4, 6]]


def test_a_figure_without_data_has_the_names_of_the_columns():
    assert to_csv(Figure()) == "panel,series,x,y,value\n"


def test_maps_of_stress_are_at_their_places_in_data_and_picture():
    """In the picture the colour at a point is that of the value there."""
    x_m, y_m = np.linspace(-0.2, 0.2, 41), np.linspace(0.0, 0.1, 21)
    field_Pa = 1e6 * (2.0 + 5.0 * x_m[:, None] + 10.0 * y_m)
    figure = stress_maps((x_m, y_m), [field_Pa, 0.5 * field_Pa], np.array([0.1, 0.9]), np.zeros((1, 2)))
    table = read_back(figure)[1]
    first = table[(table["series"] == "map") & (table["panel"] == "10 %")]
    assert first["value"].to_numpy() == pytest.approx(2.0 + 5.0 * first["x"] + 10.0 * first["y"], rel=1e-4)
    assert np.unique(first["x"]) == pytest.approx(x_m) and np.unique(first["y"]) == pytest.approx(y_m)
    figure.savefig(picture := io.BytesIO(), dpi=200)
    pixels = matplotlib.image.imread(io.BytesIO(picture.getvalue()), format="png")
    axis = figure.axes[0]
    for place in ((-0.1, 0.08), (0.15, 0.02), (0.05, 0.05)):
        column, row = figure.dpi_scale_trans.inverted().transform(axis.transData.transform(place)) * 200
        colour = matplotlib.colormaps["cividis"]((2.0 + 5.0 * place[0] + 10.0 * place[1]) / 4.0)
        assert pixels[-int(row), int(column)] == pytest.approx(colour, abs=0.02)


def test_total_forces_are_sums_of_single_peaks(tmp_path):
    """By Hertz' closed form ten of coal or of gangue push a rigid plate by 42.6 and 76.5 kN."""
    theory = Theory(SweepResults(read_sweep(write_sweep(tmp_path / "paper", ratios=(0.0, 1.0)))))
    assert theory.beam_totals_N["PH"] == pytest.approx(np.linspace(42.6e3, 76.5e3, 11), abs=50)
    places_m, order = theory.setup.places_m, theory.setup.gangue_order
    peaks_N = {kind: one["FN"] for kind, one in theory.single_peaks_N(places_m[:, 0]).items()}
    changed = np.array(order[:3]) - 1
    three_N = peaks_N["coal"].sum() + (peaks_N["gangue"] - peaks_N["coal"])[changed].sum()
    assert theory.beam_totals_N["FN"][3] == pytest.approx(three_N, rel=1e-12)
