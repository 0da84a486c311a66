"""Speeds of all stones of a record, against laws that are known and sums over all cases."""

from itertools import product

import numpy as np
import pytest

from recognition.stone_forces.law_file import load_forces
from recognition.stream.listen import Heard
from recognition.stream.prior import TRIPLE, StonePrior
from recognition.stream.speed_law import CURVE, ONE_FALL, OTHERWISE, TILT, SpeedLaws, with_speed_laws
from recognition.stream.stones import ratio_of, stone_table

RADII_m = (0.015, 0.035)


def stones_of(prior: StonePrior, gangue, radius_m, speed_m_s, rng) -> list[Heard]:
    """What a fit with errors of 2 % makes of stones that follow the law of forces."""
    law, covariance = prior.forces, np.diag([1e-4, 0.02**2, 1e-4, 1e-4, 0.1, 0.02**2])
    errors = covariance[np.ix_(TRIPLE, TRIPLE)]
    found = []
    for g, radius, speed in zip(gangue, radius_m, speed_m_s, strict=True):
        stone = np.zeros(6)
        broken = rng.random() < law.share_at(int(g), speed)
        mean, scatter = ((law.broken_mean, law.broken_scatter) if broken else (law.mean, law.scatter[int(g)]))
        stone[TRIPLE] = rng.multivariate_normal(mean(int(g), np.array(radius), np.array(speed)), scatter + errors)
        with_wide = np.linalg.inv(np.linalg.inv(errors) + prior.precision)
        linear = np.linalg.solve(errors, stone[TRIPLE]) + prior.precision @ prior.typical
        log_evidence, weights, broken = prior.evidence(with_wide @ linear, with_wide)
        found.append(Heard(stone, covariance, log_evidence, weights, broken, 1.0, 100.0, 100.0))
    return found


def test_speed_law_is_the_sum_over_all_materials():
    """Three stones: naively, over each law, each share and each of the eight cases of materials and speeds."""
    rng = np.random.default_rng(1)
    log_evidence = rng.normal(0, 2, (3, 2, 4))
    speed = np.linspace(2, 4, 4)
    step = 2.0 / 3
    laws, many = [], []
    for mean, spread in product(np.linspace(2, 4, 25), np.geomspace(step / np.sqrt(12), 0.3, 4)):
        density = np.exp(-0.5 * ((speed - mean) / spread) ** 2)
        laws.append((ONE_FALL / 100, (1 - OTHERWISE) * density / density.sum() + OTHERWISE / 4))
    x = np.array([-0.75, -0.25, 0.25, 0.75])
    for t, c in product(np.linspace(-2.5, 2.5, 11), np.linspace(-2.5, 2.5, 5)):
        density = np.exp(TILT * t * x) * np.exp(CURVE * c * (x * x - 1 / 3))
        many.append((np.exp(-t * t / 2) * np.exp(-c * c / 2), density / sum(density)))
    laws += [((1 - ONE_FALL) * likely / sum(m[0] for m in many), law) for likely, law in many]
    total, expected = 0.0, np.zeros(4)
    for likely, law in laws:
        for share in (np.arange(21) + 0.5) / 21:
            weight = likely
            for one in np.exp(log_evidence):
                weight *= (1 - share) * (one[0] @ law) + share * (one[1] @ law)
            total, expected = total + weight, expected + weight * law
    assert SpeedLaws.before(speed).after(log_evidence).mean() == pytest.approx(expected / total, rel=1e-9)


@pytest.fixture(scope="module")
def prior():
    return StonePrior(load_forces(), RADII_m, (2.0, 4.0))


def test_stones_of_one_fall_are_told_apart(prior):
    """Radii of 15 to 35 mm, all at 2.6 m/s, of which the prior knows only that it is 1.5 to 5: of those that are told
    wrongly alone, two thirds or more are told rightly together, and their speed is found."""
    prior = StonePrior(prior.forces, RADII_m, (1.5, 5.0))
    rng = np.random.default_rng(2)
    gangue, radius = np.arange(100) % 3 == 0, rng.uniform(*RADII_m, 100)
    alone = stones_of(prior, gangue, radius, np.full(100, 2.6), rng)
    together, _ = with_speed_laws(alone, prior)
    wrong = [np.sum(np.array([h.log_evidence[1] > h.log_evidence[0] for h in some]) != gangue) for some in (alone, together)]
    assert wrong[0] >= 6 and wrong[1] <= wrong[0] / 3
    speed = [prior.grid[:, 1] @ h.weights[int(g)] for h, g in zip(together, gangue, strict=True)]
    assert np.mean(speed) == pytest.approx(2.6, rel=0.03)


def test_stones_of_any_speed_lose_little(prior):
    """Speeds of 2 to 4 m/s, as the prior of a stone alone has them: the law is near to uniform, and the odds stay."""
    rng = np.random.default_rng(3)
    gangue, radius = rng.random(100) < 0.5, rng.uniform(*RADII_m, 100)
    alone = stones_of(prior, gangue, radius, rng.uniform(2, 4, 100), rng)
    together, _ = with_speed_laws(alone, prior)
    assert np.allclose([h.weights.sum(axis=1) for h in together], 1)
    odds = [np.array([h.log_evidence[1] - h.log_evidence[0] for h in some]) for some in (alone, together)]
    assert np.median(np.abs(odds[1] - odds[0])) < 0.5


def test_ratio_of_stones_whose_speeds_are_mostly_low_or_high(prior):
    """Twenty records of 100 stones whose speeds have the density exp(-x) or exp(x), x from -1 to 1 between the limits.
    Taken for uniform they would be more than ten points off. The record tells the tilt, and its doubt widens the
    interval."""
    rng = np.random.default_rng(5)
    off, naive, inside = [], [], []
    for tilt in (-1.0, 1.0) * 10:
        gangue, radius = rng.random(100) < rng.uniform(0.2, 0.8), rng.uniform(*RADII_m, 100)
        x = np.log(np.exp(-tilt) + rng.random(100) * (np.exp(tilt) - np.exp(-tilt))) / tilt  # by the inverse of its sum
        alone = stones_of(prior, gangue, radius, 3 + x, rng)
        odds = np.array([h.log_evidence[1:] - h.log_evidence[:1] for h in alone])
        tables = [stone_table(*told, prior, 20e3, 0.005).assign(t_s=np.arange(100.0))
                  for told in (with_speed_laws(alone, prior), (alone, odds))]
        low, middle, high = ratio_of(tables[0])
        off.append(abs(middle - gangue.mean()))
        naive.append(abs(ratio_of(tables[1])[1] - gangue.mean()))
        inside.append(low <= gangue.mean() <= high)
    assert np.mean(naive) > 0.1
    assert np.mean(off) < 0.5 * np.mean(naive)
    assert sum(inside) >= 16


def test_one_speed_is_left_as_it_is(prior):
    known = StonePrior(prior.forces, RADII_m, (3.0, 3.0))
    alone = stones_of(known, [True], [0.025], [3.0], np.random.default_rng(4))
    assert with_speed_laws(alone, known)[0] == alone
    assert with_speed_laws([], prior)[0] == []
