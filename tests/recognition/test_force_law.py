"""The law of stones' forces against stones that are drawn and by hand, and records near the numbers that explain them."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import multivariate_normal

import recognition.physics.near_record as near_record_of
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


def near_record(rng, law, stones, samples=30):
    """A record of noise alone, responses, and the record near its numbers."""
    record, response = rng.standard_normal(samples), rng.standard_normal((samples, stones, len(law.forms)))
    return record, response, NearRecord.of(record, response, law, 0.0)


def signals(response, numbers):
    weights = np.exp(numbers[:, :1]) * np.column_stack([np.ones(len(numbers)), numbers[:, 1:]])
    return np.tensordot(response, weights, 2)


def test_a_record_about_numbers_of_its_stones_against_differences():
    rng = np.random.default_rng(6)
    record, response, near = near_record(rng, small_model(rng, forms=3).law, 2)
    numbers, steps = rng.standard_normal((2, 3)), 1e-5 * np.eye(6).reshape(6, 2, 3)
    (chi_square, *_), (pull, *_), (curvature, *_) = near._about(np.stack([numbers, 2 * numbers]))
    left = [record - signals(response, numbers + side * step) for step in steps for side in (0, 1, -1)]
    slopes = np.array([(left[k + 2] - left[k + 1]) / 2e-5 for k in range(0, 18, 3)])
    assert chi_square == pytest.approx(left[0] @ left[0], rel=1e-9)
    assert pull == pytest.approx(slopes @ left[0], rel=1e-6)
    assert curvature == pytest.approx(slopes @ slopes.T, rel=1e-6)


def about_any(near, law, means, each):
    """`integrals` before any arrangement is linear about its own numbers."""
    chi_square, after = near._about_any(means, law.covariance)
    volume = after + np.linalg.slogdet(law.covariance)[1][each].sum(axis=1)
    return chi_square, np.tile(volume, (len(means), 1))


def test_integrals_against_the_normal_distribution_of_what_is_linear():
    """Signals that are linear about the numbers found, of stones of both materials at two speeds."""
    rng = np.random.default_rng(7)
    law = small_model(rng, forms=2).law
    record, response, near = near_record(rng, law, 3)
    each, means = np.array(list(product((0, 1), repeat=3))), np.stack([law.mean_at(speed) for speed in (2.5, 3.5)])
    u, a = near.numbers.T
    slopes = np.stack([np.exp(u) * (response[..., 0] + a * response[..., 1]), np.exp(u) * response[..., 1]], axis=2)
    chi_square, volume = about_any(near, law, means, each)
    for v, k in product(range(2), range(len(each))):
        off = (means[v][each[k]] - near.numbers).ravel()
        spread = sum(slopes[:, i] @ law.covariance[m] @ slopes[:, i].T for i, m in enumerate(each[k]))
        mean = slopes[..., 0].sum(axis=1) + slopes.reshape(30, -1) @ off
        log = multivariate_normal(mean, np.eye(30) + spread).logpdf(record)
        assert chi_square[v, k] + volume[v, k] + 30 * np.log(2 * np.pi) == pytest.approx(-2 * log, rel=1e-9)


def test_likely_arrangements_are_linear_about_their_own_numbers(monkeypatch):
    """The two best of eight, against numbers that scipy seeks and the volume there."""
    rng = np.random.default_rng(7)
    law = small_model(rng, forms=2).law
    record, response, near = near_record(rng, law, 3)
    each, means = np.array(list(product((0, 1), repeat=3))), law.mean_at(3.0)[None]
    linear = about_any(near, law, means, each)
    monkeypatch.setattr(near_record_of, "LIKELY", 2)
    monkeypatch.setattr(near_record_of, "SETTLED", 1e-9)
    found = near.integrals(means, law.covariance, each)
    best = np.argsort(sum(linear)[0])
    for one, same in zip(found, linear, strict=True):
        assert np.array_equal(one[0, best[2:]], same[0, best[2:]])
    for k in best[:2]:
        mean, covariance = means[0][each[k]], law.covariance[each[k]]
        root = np.linalg.cholesky(np.linalg.inv(covariance))

        def left(z, mean=mean, root=root):
            off = np.einsum("ikl,ik->il", root, z.reshape(3, 2) - mean)
            return np.concatenate([record - signals(response, z.reshape(3, 2)), off.ravel()])

        sought = least_squares(left, near.numbers.ravel(), xtol=1e-12)
        volume = np.linalg.slogdet(sought.jac.T @ sought.jac)[1] + np.linalg.slogdet(covariance)[1].sum()
        assert found[0][0, k] == pytest.approx(2 * sought.cost, rel=1e-6)
        assert found[1][0, k] == pytest.approx(volume, rel=1e-4)
