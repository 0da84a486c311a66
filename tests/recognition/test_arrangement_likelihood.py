"""The likelihood of arrangements: against the sum of the integrals over all of them, one by one, on a grid, and on pushes
of a known law on a small plate whose motion is found by `ModalMotion` in small steps."""

import json
import pickle
import tempfile
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares
from scipy.signal import firwin
from scipy.special import logsumexp

from common.scene.plate import FlexiblePlate
from plate_fem.modes import plate_modes
from plate_fem.motion import ModalMotion
from recognition import RecognitionError
from recognition.estimation.noise import noise_of
from recognition.models import decode, encode
from recognition.physics.arrangement_fit import PlateRecord, fit_model, told
from recognition.physics.arrangement_likelihood import (
    LATEST_S,
    MISFIT,
    ArrangementEstimate,
    ArrangementModel,
    ExpectedMisfit,
)
from recognition.physics.arrangement_method import ArrangementLikelihood
from recognition.physics.force_law import ForceLaw
from recognition.physics.force_records import Fall, ForceRecord

PLACES_M = 0.06 * np.array([[1, 0], [0.3, 0.95], [-0.8, 0.6], [-0.8, -0.6], [0.3, -0.95]])
STEP_s, SAMPLE_s, SAMPLES = 1e-5, 5e-5, 60
LATE = round(LATEST_S / SAMPLE_s) + 1  # samples by which the forces are known for longer than the record
NAMES = ("acc_s0_m_s2", "acc_s1_m_s2", "acc_s2_m_s2", "rod_1_N", "rod_2_N", "rod_3_N", "rod_4_N")
KEPT = tempfile.TemporaryDirectory()  # of the plates' modes
SENSORS_M = [(0.0, 0.11), (-0.1, 0.03), (0.12, -0.06)]
ROD = {"diameter_m": 0.012, "length_m": 0.06, "youngs_modulus_Pa": 2e11, "density_kg_m3": 7800.0}


@cache
def modes_of(thickness_m):
    return plate_modes(plate(thickness_m), Path(KEPT.name), PLACES_M)


def plate(thickness_m=0.008):
    rods = [ROD | {"place_m": [x, y]} for x, y in product((-0.12, 0.12), repeat=2)]
    sensors = [{"name": f"s{k}", "place_m": [x, y]} for k, (x, y) in enumerate(SENSORS_M)]
    return FlexiblePlate.model_validate({
        "size_m": [0.3, 0.3], "thickness_m": thickness_m, "density_kg_m3": 7800.0,
        "youngs_modulus_Pa": 2e11, "poisson_ratio": 0.3, "max_frequency_Hz": 5000.0, "damping_ratio": 0.01,
        "mesh_size_m": 0.03, "rods": rods, "sensors": sensors})


def forces_N(gangue, size, speed_m_s):
    """Half sines of 0.25 ms, gangue's twice as large, all as the speed: (steps, stones)."""
    t = (np.arange((SAMPLES + 2 * LATE) * round(SAMPLE_s / STEP_s)) + 0.5) * STEP_s
    pulse = np.where(t < 2.5e-4, np.sin(np.pi * t / 2.5e-4), 0.0)
    return pulse[:, None] * np.where(gangue, 2000.0, 1000.0) * size * speed_m_s / 3


def record(modes, force_N, noise, rng, late=0, places_m=PLACES_M):
    """Signals and the deviation of their noise, from the motion of the modes step by step; they begin `late` steps after
    the impact."""
    motion, down = ModalMotion(modes, STEP_s), -modes.shape_at(places_m)
    sensors, signals = modes.shape_at(np.array(SENSORS_M)), []
    push = np.vstack([force_N, force_N[-1:]]) @ down
    before = np.zeros_like(push[0])
    for k in range(len(force_N)):
        a = motion.acceleration_at(motion.amplitude, motion.rate, (before + push[k]) / 2)
        signals.append(np.concatenate([sensors @ a, modes.rod_force @ motion.amplitude]))
        before = push[k]
        motion.advance(push[k])
    silent = np.zeros((max(0, -late), len(NAMES)))
    values = np.vstack([silent, signals])[max(0, late)::round(SAMPLE_s / STEP_s)][:SAMPLES].T
    sd = noise * np.sqrt(np.mean(values**2, axis=1))
    return values + sd[:, None] * rng.standard_normal(values.shape), sd


def draw(count, seed, thickness_m=0.008, speeds=(3.0, 3.0), noise=0.0, scatter=0.1, late=0):
    """Records with the forces of their stones, and ratios: a stone of every run is another one."""
    table, modes, rng = plate(thickness_m), modes_of(thickness_m), np.random.default_rng(seed)
    X, ratios = [], []
    for _ in range(count):
        n = rng.integers(len(PLACES_M) + 1)
        gangue = rng.permutation(len(PLACES_M)) < n
        speed = rng.uniform(*speeds)
        force = forces_N(gangue, 1 + scatter * rng.standard_normal(len(PLACES_M)), speed)
        forces = ForceRecord(table, Fall(PLACES_M, np.zeros(len(PLACES_M))), PLACES_M, speed, SAMPLE_s, STEP_s,
                             force.T, gangue)
        X.append(PlateRecord(*record(modes, force, noise, rng, late), NAMES, forces))
        ratios.append(n / len(PLACES_M))
    return X, np.array(ratios)


@pytest.fixture(scope="module")
def method():
    X, ratios = draw(30, 1)
    return ArrangementLikelihood(exact_trigger=True).fit(X, ratios, groups=np.arange(30))


def small_model(rng, stones=3, bins=3, powers=2, width=2, samples=6, scatter=1, forms=1):
    hat = rng.standard_normal((2, samples + 64, stones))
    root = 0.2 * rng.standard_normal((bins, bins))
    mean = 0.3 * rng.standard_normal((2, powers, forms))
    mean[1, 0, 0] = mean[0, 0, 0] + 0.7
    turned = 0.3 * rng.standard_normal((2, forms, forms))
    law = ForceLaw(0.5 * rng.standard_normal((forms, bins)), mean, turned @ turned.swapaxes(1, 2) + 0.04 * np.eye(forms),
                   root @ root.T + 0.01 * np.eye(bins), 3.0)
    return ArrangementModel(("a", "b"), np.array([1.0, 2.0]), np.array([0.3, 0.2]), 1e-5, 1, samples, hat, width, law,
                            [0.2 * rng.standard_normal((2, samples + 64, 2)) for _ in range(scatter)], "",
                            np.zeros((stones, 2)), 0.0, 0.0, False, 3.0, 3.0)


def well_told(model):
    """The model of records that leave little of the impulses untold, where Laplace's method is exact."""
    law = replace(model.law, rest=1e-3 * model.law.rest)
    return replace(model, law=law, residual=0.1 * model.residual, scatter=[0.03 * one for one in model.scatter])


def naive_law(model, shift):
    """Responses (d, stones, forms) and covariance of what they leave, from the response to a force in each bin on each
    place, sample by sample."""
    d, n, bins = 2 * model.samples, model.stones, model.law.bins

    taps = firwin(20 * model.stride + 1, 1 / model.stride, window=("kaiser", 5.0)) if model.anti_alias else [1.0]

    def at(response, row):
        """Between two steps; of a record behind a low pass, the mean over the steps about it."""
        low, found = int(np.floor(row)), 0
        for j, tap in enumerate(taps, -(len(taps) // 2)):
            here, then = (response[:, k] if k >= 0 else np.zeros_like(response[:, 0]) for k in (low - j, low - j + 1))
            found = found + tap * (here + (row - low) * (then - here))
        return found

    unit = np.zeros((2, model.samples, n, bins))
    other = [np.zeros((2, model.samples, one.shape[2])) for one in model.scatter]
    for k in range(model.samples):
        for b in range(bins):
            unit[:, k, :, b] = at(model.hat, shift + k * model.stride - b * model.width)
        for one, response in zip(other, model.scatter, strict=True):
            one[:, k] = at(response, shift + k * model.stride)
    unit, law = unit.reshape(d, n, bins), model.law
    covariance = sum(unit[:, i] @ law.rest @ unit[:, i].T for i in range(n))
    for one in other:
        covariance = covariance + one.reshape(d, -1) @ one.reshape(d, -1).T
    return np.stack([unit @ form for form in law.forms], axis=2), covariance


@pytest.mark.parametrize("anti_alias", [False, True])
@pytest.mark.parametrize("shift", [0.0, 3.0, -4.5, 0.25])
def test_the_law_of_records_against_a_naive_twin(shift, anti_alias):
    model = replace(small_model(np.random.default_rng(8), forms=2), stride=2, anti_alias=anti_alias)
    response, covariance = naive_law(model, shift)
    law = model.law_at(shift)
    assert law.response == pytest.approx(response, abs=1e-12)
    assert law.rest + law.scatter == pytest.approx(covariance, abs=1e-12)


def test_what_is_not_known_of_the_plate_scatters_as_the_forces_that_are_heard():
    """Stones three times as strong as a mean one, and as strong, that are heard well."""
    model, noise, shift = well_told(small_model(np.random.default_rng(8), samples=20)), np.array([0.01, 0.01]), 1.0
    response, _ = naive_law(model, shift)
    without = naive_law(replace(model, scatter=[]), shift)[1]
    scatter = naive_law(model, shift)[1] - without
    for size in (3.0, 1.0):
        x = size * model.law.of_any[0][0] * response[:, :, 0].sum(axis=1).reshape(2, -1)
        found = model._near(x, noise, np.arange(2), shift)
        whole = without + size**2 * scatter + np.diag(np.repeat(model.residual**2 + noise**2, model.samples))
        assert found.log_determinant == pytest.approx(np.linalg.slogdet(whole)[1], abs=0.5)


def on_a_grid(model, x, noise, shift, speed=3.0, nodes=301):
    """Of each arrangement: logarithm of the likelihood, by the sum over a grid of all u, a ... of the stones, and least
    chi-square of record and numbers together."""
    law, each = model.law, np.array(list(product((0, 1), repeat=model.stones)))
    response, covariance = naive_law(model, shift)
    shape, d = response.shape[1:], response.shape[0]
    covariance = covariance + np.diag(np.repeat(model.residual**2 + (noise / model.scale) ** 2, model.samples))
    mean = np.array([sum((speed - 3.0) ** k * law.mean[m, k] for k in range(2)) for m in (0, 1)])
    mean[:, 0] += np.log(speed / 3.0)
    sd = np.sqrt([np.diag(one) for one in law.covariance])
    axes = [np.linspace(*ends, nodes) for ends in zip((mean - 6 * sd).min(axis=0), (mean + 6 * sd).max(axis=0), strict=True)]
    numbers = np.stack(np.meshgrid(*axes * shape[0], indexing="ij"), axis=-1).reshape(-1, *shape)
    root = np.linalg.cholesky(covariance)
    white, seen = np.linalg.solve(root, x.ravel()), np.linalg.solve(root, response.reshape(d, -1))

    def off_record(one):
        weights = np.exp(one[..., :1]) * np.concatenate([np.ones_like(one[..., :1]), one[..., 1:]], axis=-1)
        return white - weights.reshape(-1, seen.shape[1]) @ seen.T

    def off_both(flat, which):
        off = [solve_triangular(np.linalg.cholesky(law.covariance[m]), one - mean[m], lower=True)
               for m, one in zip(which, flat.reshape(shape), strict=True)]
        return np.concatenate([off_record(flat.reshape(1, *shape)).ravel(), *off])

    of_record, logs, least = (off_record(numbers) ** 2).sum(axis=1), [], []
    cell = np.log([axis[1] - axis[0] for axis in axes]).sum() * shape[0]
    for which in each:
        off, precision = numbers - mean[which], np.linalg.inv(law.covariance)[which]
        total = of_record + np.einsum("nik,ikl,nil->n", off, precision, off)
        prior = np.linalg.slogdet(2 * np.pi * law.covariance[which])[1].sum() / 2
        logs.append(logsumexp(-total / 2) + cell - prior - np.log(np.diag(root)).sum())
        least.append(2 * least_squares(off_both, numbers[np.argmin(total)].ravel(), args=(which,)).cost)
    return np.array(logs), np.array(least)


def shares(logs, temperature=1.0):
    """Probability of each number of gangue by the logarithms of the likelihoods of all arrangements (..., 2^stones)."""
    each = np.array(list(product((0, 1), repeat=round(np.log2(logs.shape[-1])))))
    count, likelihood = each.sum(axis=1), np.exp((logs - logs.max()) / temperature).reshape(-1, len(each)).sum(axis=0)
    chance = np.array([likelihood[count == k].mean() for k in range(each.shape[1] + 1)])
    return chance / chance.sum()


@pytest.mark.parametrize(("off", "tempered"), [(0.02, False), (0.2, True)])
@pytest.mark.parametrize(("speed", "stones", "forms"), [(3.0, 2, 1), (2.2, 2, 1), (2.2, 1, 2)])
def test_against_the_integral_of_every_arrangement(off, tempered, speed, stones, forms):
    """Also a record that no arrangement explains: then all are held to be less certain."""
    rng, shift, noise = np.random.default_rng(4), 2.5, np.array([0.02, 0.02])
    model = well_told(small_model(rng, stones, samples=20, scatter=0, forms=forms))
    x = (naive_law(model, shift)[0].reshape(40, 2) @ ([0.8, 1.7] if forms == 1 else [1.2, 0.3])).reshape(2, -1)
    x = x + off * rng.standard_normal(x.shape)
    logs, least = on_a_grid(model, x, noise, shift, speed)
    temperature = max(1.0, least.min() / x.size)
    assert (temperature > 1.5) == tempered
    found = model.estimate(x * model.scale[:, None], noise, speed, -shift * model.step_s)
    assert found.misfit == pytest.approx(least.min() / x.size, rel=0.02)
    assert found.probability == pytest.approx(shares(logs, temperature), abs=0.02)


@pytest.mark.slow
def test_moments_of_the_impact_count_by_their_whole_likelihood():
    """A record whose beginning is unknown: every arrangement at nine moments about the most probable step, each by its
    integral. The moments' covariances differ, and so do their determinants."""
    rng, noise = np.random.default_rng(12), np.array([0.02, 0.02])
    model = well_told(small_model(rng, stones=2, samples=20))
    x = (naive_law(model, 4.0)[0][:, :, 0] @ [0.8, 1.7]).reshape(2, -1)
    x = x + 0.02 * rng.standard_normal(x.shape)
    logs = {shift: on_a_grid(model, x, noise, shift)[0] for shift in range(-model.latest, model.latest + 1)}
    best = max(logs, key=lambda shift: logs[shift].max())
    table = np.array([on_a_grid(model, x, noise, best + k / 2)[0] for k in range(-4, 5)])
    found = model.estimate(x * model.scale[:, None], noise, 3.0)
    assert found.misfit < 1  # so no arrangement is held to be less certain
    assert found.probability == pytest.approx(shares(table), abs=0.02)


def test_nine_tenths_of_the_probability_lie_in_the_interval():
    for probability, interval in (([0.04, 0.06, 0.8, 0.06, 0.04], (0.25, 0.75)), ([0.0, 0.0, 1.0, 0.0, 0.0], (0.5, 0.5)),
                                  ([0.01, 0.05, 0.31, 0.6, 0.03], (0.5, 0.75)), ([0.7, 0.1, 0.08, 0.07, 0.05], (0.0, 0.75)),
                                  ([0.05, 0.1, 0.1, 0.7, 0.05], (0.25, 0.75)), ([0.2] * 5, (0.0, 1.0))):
        assert ArrangementEstimate(np.array(probability), 0.1, 0.4, 0.0, 0.0).interval == interval


def test_channels_that_a_record_lacks_are_left_out():
    """One channel of two gives what a model of that channel alone gives."""
    rng = np.random.default_rng(5)
    model = small_model(rng)
    lone = replace(model, names=("b",), scale=model.scale[1:], residual=model.residual[1:], hat=model.hat[1:],
                   scatter=[one[1:] for one in model.scatter])
    signals, noise = rng.standard_normal((1, model.samples)), np.array([0.1])
    found = model.estimate(signals, noise, arrival_s=0.0, channels=np.array([1]))
    assert found.probability == pytest.approx(lone.estimate(signals, noise, arrival_s=0.0).probability, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("late", [-25, 1, 20])
def test_the_moment_of_the_impact_is_found(method, late):
    """From 0.25 ms of silence to a record that begins 0.2 ms after the impact; steps are 10 us."""
    X, ratios = draw(6, 7, noise=0.03, late=late)
    answers = [method.model_.estimate(x.signals, x.noise) for x in X]
    arrival_s = np.array([found.arrival_s for found in answers])
    assert np.median(np.abs(arrival_s + late * STEP_s)) < STEP_s
    right = [round(5 * found.ratio) == round(5 * b) for found, b in zip(answers, ratios, strict=True)]
    assert np.mean(right) >= 5 / 6


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "least_right"), [(0.0, 0.95), (0.1, 0.9)])
def test_stones_of_other_draws_are_counted(method, noise, least_right):
    X, ratios = draw(40, 2, noise=noise)
    found = method.answer(X)
    assert np.mean([round(5 * r.ratio) == round(5 * b) for r, b in zip(found, ratios, strict=True)]) >= least_right
    assert np.mean([r.low <= b <= r.high for r, b in zip(found, ratios, strict=True)]) >= least_right
    assert sum(r.out_of_distribution != "" for r in found) <= 2


@pytest.mark.slow
def test_another_plate_and_another_speed_are_out_of_distribution(method):
    found = method.answer(draw(10, 3, 0.007)[0])
    assert all("misfit of the plate's model" in r.out_of_distribution for r in found)
    assert all(r.out_of_distribution for r in method.answer(draw(50, 3, speeds=(4.5, 4.5))[0]))


@pytest.mark.slow
def test_a_speed_that_varied():
    X, ratios = draw(90, 5, speeds=(2.0, 4.0))
    method = ArrangementLikelihood(exact_trigger=True).fit(X[:40], ratios[:40], groups=np.arange(40))
    found = np.array([answer.ratio for answer in method.answer(X[40:])])
    assert np.abs(found - ratios[40:]).mean() < 0.06


def test_where_stones_touch_scatters_records_along_both_axes():
    """What a deviation of 1 mm adds to the covariance, by moving each stone to either side along x and along y."""
    X, _ = draw(8, 9, scatter=0.0)
    model = told(replace(fit_model(X, np.arange(8)), place_deviation_m=1e-3), X[0].force_record.fall)
    added = model.law_at(0.0).scatter
    modes, mean_N = modes_of(0.008), 1.5 * forces_N(np.zeros(5), 1.0, 3.0)[:, :1]
    expected = np.zeros_like(added)
    for place in PLACES_M:
        for axis in np.eye(2):
            ends = [record(modes, mean_N, 0.0, np.random.default_rng(0), places_m=place + side * 5e-4 * axis)[0]
                    for side in (1, -1)]
            row = ((ends[0] - ends[1]) / model.scale[:, None]).ravel()
            expected += np.outer(row, row)
    assert np.linalg.norm(added - expected) < 0.1 * np.linalg.norm(expected)


def test_saved_and_read(method):
    saved = json.loads(json.dumps(encode(method)))
    X, _ = draw(5, 6)
    ratios = [answer.ratio for answer in method.answer(X)]
    assert [answer.ratio for answer in decode(saved, ArrangementLikelihood).answer(X)] == pytest.approx(ratios, abs=1e-4)
    another_process = pickle.loads(pickle.dumps(method))  # of one that has answered
    assert [answer.ratio for answer in another_process.answer(X)] == ratios
    saved["model_"]["law"]["covariance"] = saved["model_"]["law"]["covariance"][:-1]
    with pytest.raises(ValueError, match="do not fit"):
        decode(saved, ArrangementLikelihood)


def test_runs_that_cannot_be_trained_on():
    X, ratios = draw(6, 7)
    with pytest.raises(RecognitionError, match="2 runs whose stones fall at once"):
        ArrangementLikelihood().fit([*X[:2], *(replace(x, force_record=None) for x in X[2:])], ratios)
    with pytest.raises(RecognitionError, match="different stones of"):
        ArrangementLikelihood().fit([replace(x, force_record=X[0].force_record) for x in X], ratios, groups=np.zeros(6))


def test_noise_of_smooth_signals():
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 2000)
    smooth = np.vstack([np.sin(9 * t), 40 * t**2])
    assert noise_of(smooth + [[0.1], [0.5]] * rng.standard_normal((2, 2000))) == pytest.approx([0.1, 0.5], rel=0.1)


def test_distances_by_hand():
    """90 % keep 2 where noise has a fifth of the variance and 1.2 where it has all; it has two fifths here, a quarter of
    the way."""
    expected = ExpectedMisfit(np.array([0.2, 1.0]), np.array([2.0, 1.2]))
    half = ArrangementEstimate(np.array([0.0, 0.0, 1.0, 0.0, 0.0]), 0.1, 0.4, 6.0, 0.0)
    assert expected.distances(half) == pytest.approx([0.1 / 1.8, 2.0])


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.005, 0.02, 0.05, 0.1])
def test_the_limit_of_the_misfit_follows_the_noise(method, noise):
    """Good records pass at any noise, also between those at which the limits were learnt; of a plate that is 2.5 %
    thicker none does."""
    good, other = (draw(20, 11, noise=noise, thickness_m=thickness_m)[0] for thickness_m in (0.008, 0.0082))
    assert sum(answer.out_of_distribution != "" for answer in method.answer(good)) <= 1
    assert all(MISFIT in answer.out_of_distribution for answer in method.answer(other))
