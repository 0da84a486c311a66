import numpy as np
import pytest

from analysis import RecordError, as_record
from analysis.emd import STOPPING_RULES, decompose
from analysis.hilbert import instantaneous, marginal_spectrum

RATE_HZ = 6667.0


def tones(n=2000):
    t = np.arange(n) / RATE_HZ
    return np.sin(2 * np.pi * 900 * t), 0.7 * np.sin(2 * np.pi * 110 * t), t


@pytest.mark.parametrize("rule", STOPPING_RULES)
def test_parts_add_up_to_the_record(rule):
    fast, slow, _ = tones()
    record = as_record(fast + slow + 0.3, RATE_HZ)
    found = decompose(record, rule)
    assert found.rule == rule
    np.testing.assert_allclose(found.imfs.sum(axis=0) + found.residue, record.values, atol=1e-12)


@pytest.mark.parametrize("rule", STOPPING_RULES)
def test_two_tones_come_apart(rule):
    fast, slow, _ = tones()
    found = decompose(as_record(fast + slow, RATE_HZ), rule)
    middle = slice(200, -200)
    assert np.std(found.imfs[0][middle] - fast[middle]) < 0.02
    assert np.std(found.imfs[1][middle] - slow[middle]) < 0.02


@pytest.mark.parametrize("rule", STOPPING_RULES)
@pytest.mark.parametrize("scale", [1e-9, 1e6])
def test_same_decomposition_in_any_unit(rule, scale):
    signal = np.random.default_rng(5).standard_normal(400)
    one = decompose(as_record(signal, RATE_HZ), rule)
    other = decompose(as_record(scale * signal, RATE_HZ), rule)
    assert one.imfs.shape == other.imfs.shape
    np.testing.assert_allclose(other.imfs / scale, one.imfs, atol=1e-6)


def test_unknown_rule_is_refused():
    with pytest.raises(RecordError, match="fixed_10"):
        decompose(as_record(np.arange(9.0), 1.0), "guess")


def test_tone_has_its_frequency_amplitude_and_bin():
    t = np.arange(4000) / RATE_HZ
    found = decompose(as_record(2.0 * np.sin(2 * np.pi * 512.0 * t), RATE_HZ))
    amplitude, frequency_Hz = instantaneous(found.imfs[0], RATE_HZ)
    middle = slice(300, -300)
    np.testing.assert_allclose(frequency_Hz[middle], 512.0, rtol=0.01)
    np.testing.assert_allclose(amplitude[middle], 2.0, rtol=0.02)
    spectrum = marginal_spectrum(found)
    peak = int(np.argmax(spectrum.density))
    assert spectrum.edges_Hz[peak] <= 512.0 < spectrum.edges_Hz[peak + 1]
    duration_s = 4000 / RATE_HZ
    assert spectrum.total == pytest.approx(2.0 * duration_s, rel=0.01)
    assert marginal_spectrum(found, kind="energy").total == pytest.approx(4.0 * duration_s, rel=0.02)


def test_total_does_not_depend_on_the_bins():
    found = decompose(as_record(np.random.default_rng(2).standard_normal(1000), RATE_HZ))
    totals = [marginal_spectrum(found, kind="energy", bin_width_Hz=w).total for w in (5.0, 25.0, 200.0)]
    np.testing.assert_allclose(totals, totals[0], rtol=1e-12)


def test_chirp_is_followed():
    t = np.arange(8000) / RATE_HZ
    frequency = 200 + 500 * t
    found = decompose(as_record(np.cos(2 * np.pi * (200 * t + 250 * t**2)), RATE_HZ))
    middle = slice(500, -500)
    np.testing.assert_allclose(instantaneous(found.imfs[0], RATE_HZ)[1][middle], frequency[middle], rtol=0.02)
