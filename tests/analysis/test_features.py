import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from analysis import RecordError, as_record, base_parameters, signal_features
from analysis.signals.features import BASE_PARAMETERS, FEATURES, time_features
from gangue.__main__ import main


def by_name(values, rate_Hz=1000.0):
    return {f.name: f.value for f in time_features(as_record(np.asarray(values), rate_Hz))}


def test_sine_has_its_closed_forms():
    """Whole periods of A sin: every parameter is known (Gamma functions for x_r)."""
    amplitude = 3.0
    found = by_name(amplitude * np.sin(2 * np.pi * (np.arange(200_000) + 0.5) / 200_000))
    root = (math.gamma(0.75) / (math.sqrt(math.pi) * math.gamma(1.25))) ** 2
    expected = {
        "square_root_amplitude": amplitude * root,
        "absolute_mean": amplitude * 2 / math.pi,
        "variance": amplitude**2 / 2,
        "peak_to_peak": 2 * amplitude,
        "rms": amplitude / math.sqrt(2),
        "waveform_index": math.pi / (2 * math.sqrt(2)),
        "kurtosis_index": 1.5,
        "kurtosis_central": 1.5,
        "margin_index": 1 / root,
    }
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-6), name
    for name in ("mean", "skewness_raw", "skewness_normalised"):
        assert abs(found[name]) < 1e-12


def test_two_level_signal_has_its_closed_forms():
    """A share p of samples at 1, the rest at 0: moments of a Bernoulli variable."""
    p = 0.25
    found = by_name([1.0, 0.0, 0.0, 0.0] * 50)
    assert found["mean"] == found["skewness_raw"] == p
    assert found["variance"] == pytest.approx(p * (1 - p))
    assert found["square_root_amplitude"] == pytest.approx(p**2)
    assert found["margin_index"] == pytest.approx(1 / p**2)
    assert found["kurtosis_index"] == pytest.approx(1 / p)
    assert found["skewness_normalised"] == pytest.approx((1 - 2 * p) / math.sqrt(p * (1 - p)))
    assert found["kurtosis_central"] == pytest.approx(3 + (1 - 6 * p * (1 - p)) / (p * (1 - p)))


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-1e3, 1e3, allow_nan=False), min_size=4, max_size=60).filter(
        lambda x: np.ptp(x) > 1e-3
    )
)
def test_naive_twin_agrees(x):
    n = len(x)
    m = sum(x) / n
    square = sum(v * v for v in x) / n
    var = sum((v - m) ** 2 for v in x) / n
    root = (sum(math.sqrt(abs(v)) for v in x) / n) ** 2
    absolute = sum(abs(v) for v in x) / n
    twin = {
        "square_root_amplitude": root,
        "absolute_mean": absolute,
        "mean": m,
        "variance": var,
        "peak_to_peak": max(x) - min(x),
        "rms": math.sqrt(square),
        "waveform_index": math.sqrt(square) / absolute,
        "kurtosis_index": sum(v**4 for v in x) / n / square**2,
        "kurtosis_central": sum((v - m) ** 4 for v in x) / n / var**2,
        "skewness_raw": sum(v**3 for v in x) / n,
        "skewness_normalised": sum((v - m) ** 3 for v in x) / n / var**1.5,
        "margin_index": max(abs(v) for v in x) / root,
    }
    found = by_name(x)
    assert set(found) == set(twin)
    scale = max(abs(v) for v in x)
    for name, value in twin.items():
        power = FEATURES[name].power
        assert found[name] == pytest.approx(value, rel=1e-7, abs=1e-8 * scale**power), name


def test_unit_scales_as_its_power():
    rng = np.random.default_rng(3)
    x = rng.standard_normal(500)
    metres, micrometres = by_name(x), by_name(1e6 * x)
    for name, value in metres.items():
        assert micrometres[name] == pytest.approx(value * 1e6 ** FEATURES[name].power, rel=1e-9)


def test_base_parameters_are_the_eight_of_the_paper():
    record = as_record(np.random.default_rng(1).standard_normal(267), 6667.0)
    assert base_parameters(record).shape == (8,) == (len(BASE_PARAMETERS),)
    assert set(BASE_PARAMETERS) <= set(signal_features(record))
    assert BASE_PARAMETERS == ["square_root_amplitude", "absolute_mean", "variance", "peak_to_peak", "rms",
                               "marginal_spectrum_energy", "skewness_raw", "margin_index"]


def test_constant_record_is_refused():
    with pytest.raises(RecordError, match="changing"):
        signal_features(as_record(np.ones(10), 100.0))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_number_that_cannot_be_is_refused():
    with pytest.raises(RecordError, match="too large or too small|deviation 0"):
        signal_features(as_record(1e-170 * np.sin(np.arange(50.0)), 100.0))


def test_energies_of_the_imfs_are_integrals_of_their_squares():
    """Of two tones: A^2 T/2 each in unit^2 s, shares that add up, and twice the energy in the marginal spectrum, which
    has the squared envelope."""
    t = np.arange(4000) / 8000.0
    record = as_record(3 * np.sin(2 * np.pi * 900 * t) + 2 * np.sin(2 * np.pi * 110 * t), 8000.0)
    found = {name: one.value for name, one in signal_features(record).items()}
    energies = [value for name, value in found.items() if name.startswith("imf_") and name.endswith("_energy")]
    shares = [value for name, value in found.items() if name.endswith("_energy_share")]
    assert energies[:2] == pytest.approx([9 * 0.5 / 2, 4 * 0.5 / 2], rel=0.03)
    assert sum(shares) == pytest.approx(1, rel=1e-9)
    assert [signal_features(as_record(record, unit=u))["imf_1_energy"].unit for u in ("1", "m")] == ["s", "(m)^2 s"]
    assert found["marginal_spectrum_energy"] == pytest.approx(2 * sum(energies), rel=0.03)


def test_imfs_that_overshoot_are_nowhere_and_it_is_said(tmp_path, capsys):
    """Some samples of ringing in a long quiet: splines swing far beyond what they join."""
    values = np.zeros(600)
    values[300:310] = np.random.default_rng(0).standard_normal(10)
    record = as_record(values, 1000.0)
    with pytest.warns(UserWarning, match="left out: signal: IMFs .* times the record's energy, where at most 2"):
        found = signal_features(record)
    assert found.keys() == {f.name for f in time_features(record)}
    assert base_parameters(record).size == 8  # as the paper takes them
    np.savetxt(tmp_path / "x.csv", record.values, header="a_m_s2", comments="")
    assert main(["features", str(tmp_path / "x.csv"), "--rate", "1000"]) == 0
    said = capsys.readouterr().out
    assert "left out: " in said and "imf_1_energy" not in said


def test_a_record_without_imfs_has_no_energy_of_them():
    with pytest.warns(UserWarning, match="too few extrema"):
        found = signal_features(as_record(np.arange(30.0) ** 2, 100.0))
    assert "marginal_spectrum_energy" not in found and found["peak_to_peak"].value == 841.0
