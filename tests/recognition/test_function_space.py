import numpy as np
import pytest

from recognition import RecognitionError, Rule, Strategy
from recognition.model_file import decode, encode
from recognition.paper.function_space import FORMS, SHIFT, fit_form, fit_polynomials
from recognition.paper.least_squares import fit_polynomial

RATIOS = np.arange(11) / 10

# Exact laws a + b g(beta; c) with g as documented.
LAWS = {
    "exponential": (0.2, 0.3, 1.7, lambda r: 0.2 + 0.3 * np.exp(1.7 * r)),
    "logarithmic": (0.9, 0.4, 0.35, lambda r: 0.9 + 0.4 * np.log(r + 0.35)),
    "power": (0.1, 0.7, 2.6, lambda r: 0.1 + 0.7 * (r + SHIFT) ** 2.6),
}


@pytest.mark.parametrize("form", LAWS)
def test_exact_laws_are_found(form):
    a, b, c, law = LAWS[form]
    fits = fit_form(form, RATIOS, np.column_stack([law(RATIOS), 3 * law(RATIOS) - 1]))
    np.testing.assert_allclose(fits.parameters, [[a, b, c], [3 * a - 1, 3 * b, c]], rtol=1e-5)
    np.testing.assert_allclose(fits.r2, 1.0, atol=1e-12)


@pytest.mark.parametrize("form", LAWS)
def test_strategy_recognises_with_each_form(form):
    law, moments = LAWS[form][3], np.linspace(0.5, 1.0, 12)
    curves = moments[None, :] * law(RATIOS)[:, None]
    model = Strategy(Rule(forms=(form,))).fit(curves, RATIOS)
    for ratio in (0.0, 0.37, 1.0):
        assert model.recognise(moments * law(ratio)).ratio == pytest.approx(ratio, abs=1e-7)


def test_best_form_is_chosen_moment_by_moment():
    """Columns that follow different laws, told apart by the adjusted R^2; every function comes out right."""
    columns = [LAWS[form][3](RATIOS) for form in LAWS] + [0.1 + 0.5 * RATIOS - 1.1 * RATIOS**2 + RATIOS**3]
    space = Rule(forms=FORMS, max_degree=3).fit(np.column_stack(columns), RATIOS)
    k, beta = np.meshgrid(np.arange(4), RATIOS, indexing="ij")
    np.testing.assert_allclose(space(k, beta), np.array(columns), atol=1e-7)
    assert [FORMS[number] for number in space.form[:3]] == list(LAWS)


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


def test_adjusted_r2_by_its_definition():
    y = np.array([0.0, 0.3, 0.35, 0.8, 1.0])
    x = np.linspace(0, 1, 5)
    fit = fit_polynomial(x, y, 1)
    rest = sum((a - fit(b)) ** 2 for a, b in zip(y, x, strict=True))
    total = sum((a - y.mean()) ** 2 for a in y)
    assert fit.r2 == pytest.approx(1 - rest / total)
    assert fit.r2_adjusted == pytest.approx(1 - (rest / 3) / (total / 4))
    assert fit_polynomials(1, x, y[:, None]).r2_adjusted == pytest.approx(1 - (rest / 3) / (total / 4))


def test_saved_strategy_keeps_every_form():
    curves = np.column_stack([LAWS["exponential"][3](RATIOS), LAWS["power"][3](RATIOS), RATIOS])
    model = Strategy(Rule(forms=FORMS)).fit(curves, RATIOS)
    again = decode(encode(model), Strategy)
    curve = np.array([LAWS["exponential"][3](0.4), LAWS["power"][3](0.4), 0.4])
    assert again.recognise(curve) == model.recognise(curve)
    assert again.rule == model.rule
