import numpy as np
import pytest

from recognition import JUDGES, NotRecognised, RecognitionError, Rule, Strategy
from recognition.paper.q_parameter import real_roots

RATIOS = np.arange(11) / 10
MOMENTS = np.linspace(0, 1, 60)


def quadratic_curves(ratios):
    """QQ_k(beta) = a_k + b_k beta + c_k beta^2 with known coefficients."""
    r = np.asarray(ratios)[:, None]
    return 0.1 * np.sin(5 * MOMENTS) ** 2 + (0.3 + 0.2 * MOMENTS) * r + 0.25 * MOMENTS * r**2


def test_exact_law_is_recognised_exactly():
    model = Strategy(Rule(degree=2)).fit(quadratic_curves(RATIOS), RATIOS)
    unseen = np.array([0.0, 0.033, 0.25, 0.5123, 0.77, 1.0])
    np.testing.assert_allclose(model.predict(quadratic_curves(unseen)), unseen, atol=1e-9)


def test_the_limit_of_r2_lets_straight_lines_through():
    """R^2 > 0.99 takes a line where the law bends a little, and pays in points; the modified limit does not."""
    unseen = np.array([0.05, 0.5, 0.95])
    curves = quadratic_curves(unseen)
    published = Strategy(Rule(min_r2=0.95)).fit(quadratic_curves(RATIOS), RATIOS).predict(curves)
    modified = Strategy(Rule(min_r2=0.9999)).fit(quadratic_curves(RATIOS), RATIOS).predict(curves)
    assert np.max(np.abs(modified - unseen)) < 1e-3
    assert np.max(np.abs(published - unseen)) > 5 * np.max(np.abs(modified - unseen))


def naive_answer(model, curve):
    """The recipe of Section V-B-3 in plain loops."""
    best = None
    for row, moment in enumerate(model.space_.moments):
        shifted = model.space_.parameters[row].copy()
        shifted[0] -= curve[moment]
        for root in np.polynomial.polynomial.polyroots(np.trim_zeros(shifted, "b")):
            if abs(root.imag) > 1e-9 or not -0.05 <= root.real <= 1.05:
                continue
            differences = []
            for other, k in enumerate(model.space_.moments):
                if other == row:
                    continue
                calculated = sum(c * root.real**p for p, c in enumerate(model.space_.parameters[other]))
                if abs(calculated - curve[k]) <= model.xi:
                    differences.append(abs(calculated - curve[k]))
            if len(differences) < model.least_share * (len(model.space_.moments) - 1) or not differences:
                continue
            if best is None or np.mean(differences) < best[0]:
                best = (np.mean(differences), root.real)
    return best


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_naive_twin_agrees_on_noisy_curves(degree):
    rng = np.random.default_rng(degree)
    noisy = quadratic_curves(RATIOS) + 0.01 * rng.standard_normal((11, MOMENTS.size))
    model = Strategy(Rule(degree=degree)).fit(noisy, RATIOS)
    for ratio in (0.12, 0.5, 0.93):
        curve = quadratic_curves([ratio])[0] + 0.01 * rng.standard_normal(MOMENTS.size)
        found, (difference, root) = model.candidates(curve), naive_answer(model, curve)
        assert found.score[found.best] == pytest.approx(difference, rel=1e-9)
        assert model.recognise(curve) == pytest.approx(root, abs=1e-7)


def test_singular_points_are_left_out():
    model = Strategy(Rule(degree=2)).fit(quadratic_curves(RATIOS), RATIOS)
    curve = quadratic_curves([0.4])[0]
    curve[5:15] += 3.0
    curve[20:23] += 1.5 * model.xi
    found = model.candidates(curve)
    assert model.recognise(curve) == pytest.approx(0.4, abs=1e-9)
    assert found.usable_share[found.best] == pytest.approx(46 / 59)


def test_several_roots_are_all_tried():
    """At half of the moments QQ is symmetric about 0.5: two roots each; only the others tell which."""

    def curves(ratios):
        r = np.asarray(ratios)[:, None]
        return np.where(np.arange(20) % 2 == 0, 4 * r * (1 - r), r) * np.ones(20)

    model = Strategy(Rule(degree=2)).fit(curves(RATIOS), RATIOS)
    index, roots = real_roots(model.space_, curves([0.2])[0])
    np.testing.assert_allclose(roots[index == 0], [0.2, 0.8], atol=1e-9)
    assert model.recognise(curves([0.2])[0]) == pytest.approx(0.2, abs=1e-9)
    assert model.recognise(curves([0.8])[0]) == pytest.approx(0.8, abs=1e-9)


def test_no_root_and_no_available_point_are_said():
    model = Strategy(Rule(degree=2)).fit(quadratic_curves(RATIOS), RATIOS)
    with pytest.raises(NotRecognised, match="-0.05 and 1.05"):
        model.recognise(quadratic_curves([0.5])[0] + 10.0)
    scrambled = quadratic_curves([0.5])[0] + 0.2 * (-1.0) ** np.arange(MOMENTS.size)
    with pytest.raises(NotRecognised, match="explains"):
        model.recognise(scrambled)


def test_an_answer_beyond_the_end_is_not_clipped():
    model = Strategy(Rule(degree=2)).fit(quadratic_curves(RATIOS), RATIOS)
    assert model.recognise(quadratic_curves([1.03])[0]) == pytest.approx(1.03, abs=1e-9)


def test_flat_moments_and_too_few_ratios():
    curves = quadratic_curves(RATIOS)
    curves[:, 0] = 0.0
    assert 0 not in Strategy(Rule(degree=2)).fit(curves, RATIOS).space_.moments
    with pytest.raises(RecognitionError, match="at least 4"):
        Strategy(Rule(degree=2)).fit(curves[:3], RATIOS[:3])
    with pytest.raises(RecognitionError, match="moments"):
        Strategy(Rule(degree=2)).fit(curves, RATIOS).recognise(np.zeros(5))


@pytest.mark.parametrize("judge", JUDGES)
def test_every_judge_finds_an_exact_law_past_singular_points(judge):
    model = Strategy(Rule(degree=2), judge=judge).fit(quadratic_curves(RATIOS), RATIOS)
    curve = quadratic_curves([0.62])[0]
    curve[30:40] -= 2.0
    assert model.recognise(curve) == pytest.approx(0.62, abs=1e-9)


def test_the_difference_is_what_each_judge_takes():
    """A straight law, a curve 0.01 and 0.03 beside it by turns, and one point far off, which is not usable."""
    curves = np.asarray(RATIOS)[:, None] * np.ones(41)
    curve = 0.4 + np.where(np.arange(41) % 2 == 0, 0.01, -0.03)
    curve[7] = 0.4 + 0.5
    for judge in JUDGES:
        found = Strategy(Rule(degree=1), judge=judge).fit(curves, RATIOS).candidates(curve)
        apart = np.delete(np.abs(curve - found.ratio[found.best]), found.moment[found.best])
        usable = apart[apart <= 0.05]
        expected = {"mean": usable.mean(), "truncated": np.minimum(apart, 0.05).mean(), "median": np.median(usable),
                    "rms": np.sqrt(np.mean(usable**2))}[judge]
        assert found.score[found.best] == pytest.approx(expected, rel=1e-6), judge


def test_deleting_singular_points_can_prefer_a_wrong_candidate():
    """50 of 60 moments speak for 0.7 with a little noise, 10 for 0.2 with none: the mean over usable
    points cannot tell ten agreeing points from fifty; the truncated mean can."""
    curves = np.asarray(RATIOS)[:, None] * np.ones(60)
    curve = np.full(60, 0.7) + 0.004 * np.cos(np.arange(60))
    curve[:10] = 0.2
    published = Strategy(Rule(degree=1), xi=0.05, least_share=0.0, judge="mean").fit(curves, RATIOS)
    modified = Strategy(Rule(degree=1), xi=0.05, least_share=0.0, judge="truncated").fit(curves, RATIOS)
    assert published.recognise(curve) == pytest.approx(0.2, abs=0.01)
    assert modified.recognise(curve) == pytest.approx(0.7, abs=0.01)


def test_an_unknown_judge_is_named():
    with pytest.raises(RecognitionError, match="truncated"):
        Strategy(judge="best").fit(quadratic_curves(RATIOS), RATIOS)


def test_what_is_not_finite_or_of_another_length_is_refused():
    ratios = np.linspace(0, 1, 6)
    curves = np.column_stack([ratios, 0.5 + 0.5 * ratios])
    strategy = Strategy(Rule(degree=1)).fit(curves, ratios)
    for use in (lambda: strategy.fit(np.where(curves == 0.2, np.nan, curves), ratios), lambda: strategy.predict([np.nan, 0.65]),
                lambda: strategy.fit(curves, np.where(ratios == 0.2, np.inf, ratios))):
        with pytest.raises(RecognitionError, match="every value must be finite"):
            use()
    for wrong in ((curves, ratios[:4]), (curves[:0], ratios[:0]), (curves[:, 0], ratios)):
        with pytest.raises(RecognitionError, match="shape"):
            Rule(degree=1).fit(*wrong)


@pytest.mark.parametrize("ratios", [100 * RATIOS, RATIOS - 0.5])
def test_ratios_in_per_cent_are_refused(ratios):
    with pytest.raises(RecognitionError, match="mixing ratios are from 0 to 1"):
        Strategy().fit(np.ones((len(ratios), 5)), ratios)
