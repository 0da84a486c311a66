import numpy as np
import pytest

from recognition import RecognitionError, Rule, Strategy
from recognition.models import decode, encode
from recognition.paper.q_parameter import fit_polynomial, fit_polynomials

RATIOS = np.arange(11) / 10

def test_lowest_degree_that_reaches_the_limit():
    line, bent = 0.2 + 0.5 * RATIOS, 0.2 + (RATIOS - 0.5) ** 2
    space = Rule(min_r2=0.99).fit(np.column_stack([line, bent]), RATIOS)
    np.testing.assert_allclose(space.parameters, [[0.2, 0.5, 0.0], [0.45, -1.0, 1.0]], atol=1e-9)


def test_moments_below_the_limit_and_flat_ones_have_no_function():
    noise = np.random.default_rng(0).standard_normal(11)
    curves = np.column_stack([RATIOS, noise, np.full(11, 0.3)])
    assert Rule(min_r2=0.99).fit(curves, RATIOS).moments.tolist() == [0]
    with pytest.raises(RecognitionError, match="no moment"):
        Rule(min_r2=0.99).fit(curves[:, 1:], RATIOS)


def test_r2_by_its_definition():
    y = np.array([0.0, 0.3, 0.35, 0.8, 1.0])
    x = np.linspace(0, 1, 5)
    fit = fit_polynomial(x, y, 1)
    rest = sum((a - fit(b)) ** 2 for a, b in zip(y, x, strict=True))
    total = sum((a - y.mean()) ** 2 for a in y)
    assert fit.r2 == pytest.approx(1 - rest / total)
    assert fit.r2_adjusted == pytest.approx(1 - (rest / 3) / (total / 4))
    assert fit_polynomials(1, x, y[:, None])[1] == pytest.approx(1 - rest / total)


def test_a_saved_strategy_is_the_same():
    curves = np.column_stack([0.2 + 0.3 * RATIOS**2, 1 - 0.5 * RATIOS, RATIOS])
    model = Strategy(Rule()).fit(curves, RATIOS)
    again = decode(encode(model), Strategy)
    curve = np.array([0.248, 0.8, 0.4])
    assert again.recognise(curve) == model.recognise(curve) and again.recognise(curve) == pytest.approx(0.4)
    assert again.rule == model.rule
