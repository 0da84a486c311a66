"""Energies and the Gaussian process on them: against scikit-learn's own, and against records of another kind."""

import numpy as np
import pandas as pd
import pytest
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from analysis import RecordError
from analysis.signals.features import log_rms
from recognition import RecognitionError
from recognition.models import decode, encode
from recognition.regression.feature_regression import FeatureRegression, fit_process

T = np.arange(267) / 6667


def records(count, seed, frequency_Hz=600.0):
    """Four sensors; the louder, the more gangue, with scatter of 1 %."""
    rng = np.random.default_rng(seed)
    ratio = rng.uniform(0, 1, count)
    found = []
    for b in ratio:
        size = (1 + 0.6 * b + 0.2 * b**2) * (1 + 0.01 * rng.standard_normal(4))
        wave = [s * np.exp(-30 * T) * np.sin(2 * np.pi * frequency_Hz * (1 + 0.3 * k) * T) for k, s in enumerate(size)]
        found.append(pd.DataFrame({"t_s": T, **{f"acc_{k}_m_s2": 200 * w for k, w in enumerate(wave)}}))
    return found, ratio


def test_rms_of_a_sine_by_window_and_band():
    x = np.sin(2 * np.pi * 50 / 400 * np.arange(400))[None]
    found = np.exp(log_rms(3 * x, (0, 0.5, 1.0), (0, 0.2, 0.3, 1.0)))
    assert found[:2] == pytest.approx(3 / np.sqrt(2), rel=1e-9)
    assert found[3] == pytest.approx(3 * 200, rel=1e-9)  # one line at 0.25 of half the rate, n/2 high
    assert max(found[2], found[4]) < 1e-9 * found[3]
    with pytest.raises(RecordError, match="silent"):
        log_rms(np.zeros((1, 400)))


def test_any_feature_of_a_record_is_taken_of_each_accelerometer():
    signals = pd.DataFrame({f"acc_{k}_m_s2": np.sin(2 * np.pi * 5 * T / T[-1]) + k for k in range(4)})
    mean = FeatureRegression("mean").prepare(signals)
    assert mean[0] == pytest.approx(np.arange(4), abs=1e-9) and mean.shape == (9, 4)
    with pytest.raises(RecognitionError, match="waveform_index of a sensor is no number"):
        FeatureRegression("waveform_index").prepare(0 * signals)
    with pytest.raises(RecognitionError, match="marginal_spectrum_energy.*choose among"):
        FeatureRegression("marginal_spectrum_energy")


def test_the_model_answers_as_scikit_learn_does(monkeypatch):
    monkeypatch.setattr("recognition.estimation.noise.COPIES", 0)
    signals, y = records(40, 1)
    features = np.stack([FeatureRegression("energies_sensors").prepare(s)[0] for s in signals])
    n = fit_process(features, y)
    kernel = ConstantKernel(n.constant) * Matern(n.length, nu=2.5)
    new = (np.stack([FeatureRegression("energies_sensors").prepare(s)[0] for s in records(10, 2)[0]]) - n.mean) / n.scale
    by_sklearn = n.offset + n.size * kernel(new, (features - n.mean) / n.scale) @ n.weights
    assert [n.ratio(n.mean + n.scale * z) for z in new] == pytest.approx(by_sklearn, abs=1e-9)
    assert np.abs([n.ratio(x) for x in features] - y).mean() < 0.02


@pytest.mark.parametrize("seed", range(8))
def test_the_process_does_not_take_all_for_noise(seed):
    """A line through eight related features with noise of 0.4: that is what may be left, not the spread of y."""
    rng = np.random.default_rng(seed)
    X = rng.standard_normal((310, 8))
    X[:, 1:] = 0.7 * X[:, :1] + 0.5 * X[:, 1:]
    y = X[:, 0] + 0.6 * X[:, 3] - 0.8 * X[:, 5]
    model = fit_process(X[:110], y[:110] + 0.4 * rng.standard_normal(110))
    assert np.std([model.ratio(x) for x in X[110:]] - y[110:]) < 0.25 < 0.3 * np.std(y)


@pytest.mark.slow
def test_ratio_interval_and_warning(monkeypatch):
    signals, y = records(80, 3)
    method = FeatureRegression("energies_sensors")
    method.fit(np.stack([method.prepare(s) for s in signals]), y)
    method = decode(encode(method), FeatureRegression)
    others, true = records(200, 4)
    with monkeypatch.context() as patch:
        patch.setattr("recognition.estimation.noise.COPIES", 0)
        like = method.answer([method.prepare(s) for s in others])  # that have no noise
    assert np.abs([r.ratio - b for r, b in zip(like, true, strict=True)]).mean() < 0.02
    assert 0.83 < np.mean([r.low <= b <= r.high for r, b in zip(like, true, strict=True)]) < 0.97
    assert np.mean([r.out_of_distribution != "" for r in like]) < 0.02
    other = method.answer([method.prepare(s) for s in records(20, 5, frequency_Hz=400.0)[0]])
    assert all(r.out_of_distribution for r in other)
    with pytest.raises(RecognitionError, match="3 features; the model has 8"):
        method.answer([method.prepare(signals[0])[:, :3]])
