import numpy as np
import pandas as pd
import pytest

from recognition import FUSIONS, Fusion, RecognitionError, fuse, kalman_filter


def naive_kalman(signals, ratio):
    """Scalar filter by hand: m equal measurements are one, of their mean, with variance 1/m."""
    mean, variance = signals.mean(axis=0), 1 / len(signals)
    x, p, out = mean[0], variance, [mean[0]]
    for y in mean[1:]:
        p += ratio
        gain = p / (p + variance)
        x, p = x + gain * (y - x), (1 - gain) * p
        out.append(x)
    return np.array(out)


@pytest.mark.parametrize("count", [1, 3, 6])
def test_filter_equals_its_scalar_twin(count):
    signals = np.random.default_rng(count).standard_normal((count, 200))
    np.testing.assert_allclose(fuse(signals, 0.3), naive_kalman(signals, 0.3), atol=1e-9)


def test_many_records_at_once_equal_one_by_one():
    signals = np.random.default_rng(7).standard_normal((4, 3, 50))
    np.testing.assert_allclose(fuse(signals), [fuse(one) for one in signals], rtol=1e-12)


def test_filter_equals_filterpy_step_by_step():
    from filterpy.kalman import KalmanFilter

    signals = np.random.default_rng(2).standard_normal((3, 40))
    kalman = KalmanFilter(dim_x=1, dim_z=3)
    kalman.x, kalman.P = np.array([[signals[:, 0].mean()]]), np.array([[1 / 3]])
    kalman.F, kalman.H, kalman.Q, kalman.R = np.eye(1), np.ones((3, 1)), 0.1 * np.eye(1), np.eye(3)
    means = kalman.batch_filter([column[:, None] for column in signals.T[1:]])[0]
    np.testing.assert_allclose(fuse(signals, 0.1)[1:], means[:, 0, 0], rtol=1e-12)


def test_steady_gain_is_that_of_the_riccati_equation():
    """A long unit step: the error decays by 1 - K, K from the stationary Riccati equation."""
    q = 0.1
    p = (q + np.sqrt(q * q + 4 * q)) / 2
    gain = p / (p + 1)
    step = np.r_[np.zeros(100), np.ones(30)]
    error = 1 - kalman_filter(step, q)[100:]
    np.testing.assert_allclose(error, (1 - gain) ** np.arange(1, 31), rtol=1e-9)


def test_filter_is_linear_in_the_unit():
    signal = np.random.default_rng(1).standard_normal(50)
    np.testing.assert_allclose(kalman_filter(1e-6 * signal), 1e-6 * kalman_filter(signal), rtol=1e-12)


def test_fluctuation_becomes_smaller():
    signal = np.random.default_rng(4).standard_normal(2000)
    assert np.std(kalman_filter(signal)) < 0.5 * np.std(signal)


def table(scale=1.0):
    t = np.linspace(0, 1, 40)
    names = ["internal_J", "kinetic_J", "total_J", "a_m_s2", "v_m_s", "u_m"]
    return pd.DataFrame({name: scale * np.sin((i + 2) * t) * (-1) ** i for i, name in enumerate(names)})


@pytest.mark.parametrize("kind", FUSIONS)
def test_normalised_training_data_fill_zero_to_one(kind):
    fusion = Fusion(kind)
    responses = np.stack([fusion.prepare(run) for run in (table(), table(2.0))])
    values = fusion.fit(responses).normalised(responses)
    assert values.shape == (2, len(FUSIONS[kind]), 40)
    np.testing.assert_allclose(values.min(axis=(0, 2)), 0.0, atol=1e-15)
    np.testing.assert_allclose(values.max(axis=(0, 2)), 1.0)
    fused = fusion.transform(responses[0])
    assert np.all(fused >= values[0].min()) and np.all(fused <= values[0].max())


def test_the_absolute_fusion_takes_sizes():
    signals = table()
    taken = Fusion("absolute").prepare(signals)
    for row, name in zip(taken, ("a_m_s2", "v_m_s", "u_m"), strict=True):
        assert row.tolist() == [max(value, -value) for value in signals[name]]


def test_missing_response_and_unknown_fusion_are_named():
    with pytest.raises(RecognitionError, match="total_J"):
        Fusion("energy").prepare(table().drop(columns="total_J"))
    with pytest.raises(RecognitionError, match="composite"):
        Fusion("all").prepare(table())


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused(bad):
    responses = np.random.default_rng(0).standard_normal((4, 3, 20))
    fusion, spoilt = Fusion("energy").fit(responses), responses.copy()
    spoilt[1, 2, 3] = bad
    for use in (lambda: fuse(spoilt), lambda: kalman_filter(spoilt), lambda: fusion.transform(spoilt),
                lambda: Fusion("energy").fit(spoilt), lambda: fuse(responses, bad), lambda: kalman_filter([1.0, 2.0], bad)):
        with pytest.raises(RecognitionError, match="finite"):
            use()


@pytest.mark.parametrize("signals", [1.0, [1.0, 2.0], np.empty((2, 0)), np.empty((0, 5)), [["a", "b"]], np.array([[1j, 1]])])
def test_what_are_no_signals_is_refused(signals):
    with pytest.raises(RecognitionError, match="signals"):
        fuse(signals)


def test_another_number_of_responses_is_refused():
    fusion = Fusion("energy")
    for responses in (np.ones((4, 2, 20)), np.ones((4, 20)), np.ones((0, 3, 20))):
        with pytest.raises(RecognitionError, match="shape"):
            fusion.fit(responses)
    with pytest.raises(RecognitionError, match="at least 0"):
        fuse(np.ones((2, 5)), -0.1)
