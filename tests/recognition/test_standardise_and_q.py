import numpy as np
import pytest

from recognition import FusionQ, NotRecognised, RecognitionError
from recognition.paper.fusion import Fusion, MinMaxByTrend, trend
from recognition.paper.q_parameter import fit_polynomial

RATIOS = np.arange(11) / 10

# Table 2 of the paper: standardised parameters, one row each.
TABLE_2 = np.array([
    [0, 0.0561, 0.106, 0.237, 0.323, 0.353, 0.488, 0.502, 0.720, 0.702, 1],
    [0, 0.0784, 0.144, 0.303, 0.396, 0.429, 0.564, 0.577, 0.774, 0.758, 1],
    [0, 0.0712, 0.136, 0.240, 0.334, 0.413, 0.516, 0.606, 0.733, 0.838, 1],
    [0, 0.0860, 0.170, 0.255, 0.339, 0.462, 0.586, 0.709, 0.832, 0.916, 1],
    [0, 0.0950, 0.176, 0.298, 0.401, 0.482, 0.583, 0.667, 0.780, 0.870, 1],
    [0, 0.0191, 0.188, 0.255, 0.2579, 0.368, 0.428, 0.562, 0.730, 0.747, 1],
    [0, 0.0547, 0.112, 0.187, 0.271, 0.365, 0.468, 0.583, 0.710, 0.848, 1],
    [0, 0.158, 0.263, 0.572, 0.696, 0.619, 0.719, 0.631, 0.811, 0.762, 1],
]).T  # fmt: skip
# Table 3: Q of the paper at the eleven ratios.
TABLE_3 = np.array(
    [0, 0.077357, 0.161858, 0.293548, 0.37705, 0.436385, 0.5441, 0.604659, 0.761186, 0.805206, 1]
)


def test_table_2_gives_q_of_table_3():
    model = FusionQ().learn(TABLE_2, RATIOS)
    np.testing.assert_allclose(model.q_of(TABLE_2), TABLE_3, atol=2e-4)


def test_quadratic_of_table_3_to_the_printed_digits():
    fit = fit_polynomial(RATIOS, TABLE_3, 2)
    np.testing.assert_allclose(fit.coefficients, [0.00614, 0.79954, 0.15488], atol=5.1e-6)
    assert fit.r2 == pytest.approx(0.99263, abs=5e-6)
    assert fit.r2_adjusted == pytest.approx(0.99079, abs=5e-6)


def test_the_papers_own_example_of_inversion():
    """Q = 0.077357 is said to be 8.7586 % of mixing ratio... (the printed differences allow 0.0004)."""
    model = FusionQ().learn(TABLE_2, RATIOS)
    model.fit_ = fit_polynomial(RATIOS, TABLE_3, 2)
    assert model.invert(0.077357) == pytest.approx(0.087586, abs=5e-4)


@pytest.mark.parametrize(("bend", "middle"), [(1.0, 0.3), (-1.0, 0.7)])
def test_of_two_roots_the_one_where_q_rises_is_the_answer(bend, middle):
    """Q = +-(beta - middle)^2 is 0.04 off its vertex at 0.2 to either side, and rises on one of them."""
    model = FusionQ()
    model.fit_ = fit_polynomial(RATIOS, bend * (RATIOS - middle) ** 2, 2)
    assert model.invert(bend * 0.04) == pytest.approx(0.5, abs=1e-9)


def test_leave_one_ratio_out_of_table_2():
    """Checked independently: mean 3.4, worst 10.4 points of mixing ratio."""
    errors = []
    for out in range(11):
        keep = np.arange(11) != out
        fit = fit_polynomial(RATIOS[keep], TABLE_3[keep], 2)
        c, b, a = fit.coefficients
        errors.append(100 * abs((-b + np.sqrt(b * b - 4 * a * (c - TABLE_3[out]))) / (2 * a) - RATIOS[out]))
    assert np.mean(errors) == pytest.approx(3.4, abs=0.05)
    assert np.max(errors) == pytest.approx(10.4, abs=0.05)


def test_standardisation_by_trend():
    x = np.array([[1.0, 9.0], [2.0, 5.0], [5.0, 1.0]])
    directions = trend(x, np.array([0.0, 0.5, 1.0]))
    assert directions.tolist() == [1, -1]
    scaler = MinMaxByTrend().fit(x, directions)
    np.testing.assert_allclose(scaler.transform(x), [[0, 0], [0.25, 0.5], [1, 1]])
    np.testing.assert_allclose(
        scaler.transform(np.array([[9.0, -3.0]])), [[2.0, 1.5]]
    )  # outside: not clipped


def test_constant_parameter_and_response_are_refused():
    with pytest.raises(RecognitionError, match="same value"):
        MinMaxByTrend().fit(np.array([[1.0, 2.0], [1.0, 3.0]]), np.array([1, 1]))
    with pytest.raises(RecognitionError, match="total_J"):
        Fusion("energy").fit(np.arange(45.0).reshape(3, 3, 5) * [[1], [1], [0]])


def test_no_root_is_said_and_not_clipped():
    model = FusionQ().learn(TABLE_2, RATIOS)
    assert model.invert(model.fit_(1.03)) == pytest.approx(1.03, abs=1e-9)
    with pytest.raises(NotRecognised, match="root"):
        model.invert(1.5)
    with pytest.raises(NotRecognised):
        model.invert(-0.5)


def test_intervals_keep_nine_tenths_of_what_was_held_out():
    """Parameters rise with a ratio that is known with an error of 8 points: so wide are the intervals, and so many hold."""
    rng = np.random.default_rng(4)

    def drawn(count):
        ratios = rng.integers(11, size=count) / 10
        return (ratios + 0.08 * rng.standard_normal(count))[:, None, None] * np.linspace(1, 2, 8), ratios

    X, y = drawn(200)
    model = FusionQ().fit(X, y, groups=np.arange(200) // 4)
    assert model.width_ == pytest.approx(1.645 * 0.08, rel=0.2)
    others, truth = drawn(400)
    held = [one.low <= ratio <= one.high for one, ratio in zip(model.answer(others), truth, strict=True) if one.has_interval]
    assert len(held) > 350 and np.mean(held) == pytest.approx(0.9, abs=0.05)
    assert FusionQ().fit(X[:3], np.array([0.0, 0.5, 1.0])).width_ == 1.0  # too few to hold any out
