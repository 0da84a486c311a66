"""The law of stones' forces against stones that are drawn and by hand, and records near the numbers that explain them."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from recognition.physics.force_law import law_of
from recognition.physics.near_record import NearRecord
from tests.recognition.test_arrangement_likelihood import small_model


def weights_drawn(law, material, count=400_000):
    """Weights of the forms of stones of a material at the middle speed."""
    rng = np.random.default_rng(1)
    drawn = rng.multivariate_normal(law.mean[material, 0], law.covariance[material], count)
    return np.exp(drawn[:, :1]) * np.column_stack([np.ones(count), drawn[:, 1:]])


def test_moments_of_the_weights_of_the_forms_against_stones_that_are_drawn():
    law = small_model(np.random.default_rng(2), forms=3).law
    drawn = [weights_drawn(law, material) for material in (0, 1)]
    for (mean, covariance), expected in zip(zip(*law.weights, strict=True), drawn, strict=True):
        assert mean == pytest.approx(expected.mean(axis=0), rel=0.02, abs=0.01)
        assert covariance == pytest.approx(np.cov(expected.T), rel=0.05, abs=0.02)
    mean, covariance = law.of_any
    assert mean == pytest.approx(np.vstack(drawn).mean(axis=0), rel=0.02, abs=0.01)
    assert covariance == pytest.approx(np.cov(np.vstack(drawn).T), rel=0.05, abs=0.02)
    assert law.mean_force == pytest.approx(np.array([one.mean(axis=0) for one in drawn]) @ law.forms, rel=0.02, abs=0.02)


def test_a_law_of_few_stones_is_wider_by_the_error_of_their_mean():
    """Stones of one form whose impulses are e^0.1 larger or smaller, coal of a mean impulse of 1 N s, gangue of e N s."""
    signs, form = np.array([1, -1, 1, -1]), np.array([1.0, 2.0, 1.0])
    forces = [np.exp(mean + 0.1 * signs)[:, None] * form / 4e-5 for mean in (0.0, 1.0)]
    for count in (5, 500):
        law = law_of(forces, [np.zeros(4)] * 2, [count] * 2, 1e-5, 3.0)
        assert law.covariance[:, 0, 0] == pytest.approx(0.01 * (1 + 1 / count))
        assert law.mean[:, 0] == pytest.approx(np.array([[0.0, 0.0], [1.0, 0.0]]), abs=1e-9)


def test_the_rest_is_that_of_both_materials():
    """Coal whose forms scatter and gangue whose do not, and the other way round."""
    noisy = 1 + 0.1 * np.random.default_rng(0).standard_normal((40, 6))
    forces, still, counts = noisy * [1, 2, 3, 3, 2, 1], np.tile([1.0, 2, 3, 3, 2, 1], (40, 1)), [40, 40]
    law, turned = (law_of(list(pair), [np.zeros(40)] * 2, counts, 1e-5, 3.0) for pair in ((forces, still), (still, forces)))
    assert np.diag(law.rest).max() > 1e-3 and law.rest == pytest.approx(turned.rest, rel=1e-9)


def test_slopes_of_a_record_near_its_numbers_against_differences():
    rng = np.random.default_rng(6)
    record, response, numbers = rng.standard_normal(30), rng.standard_normal((30, 2, 3)), rng.standard_normal((2, 3))
    near = NearRecord._at(record, response, numbers, 0.0)
    for k, step in enumerate(1e-5 * np.eye(6).reshape(6, 2, 3)):
        ends = [NearRecord._at(record, response, numbers + side * step, 0.0).chi_square for side in (1, -1)]
        assert near.pull[k] == pytest.approx((ends[1] - ends[0]) / 4e-5, rel=1e-6)


def test_integrals_against_the_normal_distribution_of_what_is_linear():
    """Signals that are linear about the numbers found, of stones of both materials at two speeds."""
    rng = np.random.default_rng(7)
    law = small_model(rng, forms=2).law
    record, response = rng.standard_normal(30), rng.standard_normal((30, 3, 2))
    near, each = NearRecord.of(record, response, law, 0.0), np.array(list(product((0, 1), repeat=3)))
    means, (u, a) = np.stack([law.mean_at(speed) for speed in (2.5, 3.5)]), near.numbers.T
    slopes = np.stack([np.exp(u) * (response[..., 0] + a * response[..., 1]), np.exp(u) * response[..., 1]], axis=2)
    chi_square, volume = near.integrals(means, law.covariance, each)
    for v, k in product(range(2), range(len(each))):
        off = (means[v][each[k]] - near.numbers).ravel()
        spread = sum(slopes[:, i] @ law.covariance[m] @ slopes[:, i].T for i, m in enumerate(each[k]))
        mean = slopes[..., 0].sum(axis=1) + slopes.reshape(30, -1) @ off
        log = multivariate_normal(mean, np.eye(30) + spread).logpdf(record)
        assert chi_square[v, k] + volume[k] + 30 * np.log(2 * np.pi) == pytest.approx(-2 * log, rel=1e-9)
