import numpy as np
import pytest

from analysis import RecordError, as_record
from analysis.signals.resampling import Resampler, resample

RATE_HZ = 100_000.0


def tone(frequency_Hz, n=20_000):
    return as_record(np.cos(2 * np.pi * frequency_Hz * np.arange(n) / RATE_HZ), RATE_HZ)


def amplitude(record, frequency_Hz):
    """Of one frequency, by projection over the middle of the record."""
    middle = slice(record.values.size // 8, -record.values.size // 8)
    t, x = record.t_s[middle], record.values[middle]
    return 2 * abs(np.mean(x * np.exp(-2j * np.pi * frequency_Hz * t)))


def test_without_filter_a_high_tone_folds_back():
    rate_Hz = RATE_HZ / 15
    slow = resample(tone(6000.0), rate_Hz, anti_alias=False)
    assert slow.rate_Hz == pytest.approx(rate_Hz)
    assert amplitude(slow, rate_Hz - 6000.0) == pytest.approx(1.0, abs=0.02)


def test_with_filter_it_is_taken_away_and_a_low_one_stays():
    rate_Hz = RATE_HZ / 15
    assert amplitude(resample(tone(6000.0), rate_Hz), rate_Hz - 6000.0) < 0.01
    low = resample(tone(500.0), rate_Hz)
    inner = slice(20, -20)
    np.testing.assert_allclose(low.values[inner], np.cos(2 * np.pi * 500.0 * low.t_s)[inner], atol=0.01)


@pytest.mark.parametrize("from_Hz, to_Hz", [(10_000.0, 6667.0), (51_202.56, 2e4), (51_237.3, 2e4), (40_002.0, 2e4)])
def test_any_clock_goes_to_a_rate_near_the_one_that_is_asked_for(from_Hz, to_Hz):
    values = np.cos(2 * np.pi * 500.0 * np.arange(4000) / from_Hz)
    found = resample(as_record(values, from_Hz), to_Hz)
    assert found.rate_Hz == pytest.approx(to_Hz, rel=1e-3)
    np.testing.assert_allclose(found.values[50:-50], np.cos(2 * np.pi * 500.0 * found.t_s)[50:-50], atol=0.01)


def test_upwards_and_by_a_fraction():
    record = tone(1000.0)
    up = resample(record, 1.5 * RATE_HZ)
    inner = slice(50, -50)
    np.testing.assert_allclose(up.values[inner], np.cos(2 * np.pi * 1000.0 * up.t_s)[inner], atol=0.01)


def test_constant_stays_constant_to_the_ends():
    np.testing.assert_allclose(resample(as_record(np.full(500, 3.0), 1000.0), 250.0).values, 3.0, rtol=1e-3)


@pytest.mark.parametrize("anti_alias", [True, False])
def test_rates_without_a_ratio_are_refused(anti_alias):
    for rate_Hz in (0.0, -1.0, np.nan, np.inf, 1001 * RATE_HZ, *[RATE_HZ / 3000.7] * anti_alias):
        with pytest.raises(RecordError, match=r"a rate of .* Hz; must be above 0, and at most 1000 times|ratio"):
            resample(tone(100.0, 99), rate_Hz, anti_alias=anti_alias)


@pytest.mark.parametrize("rate_Hz", [np.e * 1e4, RATE_HZ / 1.5, RATE_HZ / 7.3, 1.7 * RATE_HZ])
def test_without_filter_any_rate_takes_the_tone_where_it_is(rate_Hz):
    tone_Hz = 0.3 * RATE_HZ
    found = resample(tone(tone_Hz), rate_Hz, anti_alias=False)
    inner = slice(100, -100)
    np.testing.assert_allclose(found.values[inner], np.cos(2 * np.pi * tone_Hz * found.t_s)[inner], atol=2e-3)


@pytest.mark.parametrize("from_Hz", [20_000.0, 40_000.0, 44_100.0, 51_200.0])
def test_samples_as_they_come_give_what_the_whole_record_gives(from_Hz):
    rng = np.random.default_rng(4)
    values = 3.0 + rng.standard_normal((2, 3001))
    resampler, parts = Resampler(from_Hz, 20_000.0, 2, "x"), []
    ends = np.sort(rng.integers(0, 3001, 20))
    for part in np.split(values, ends, axis=1):
        parts.append(resampler.more(part))
    found = np.hstack([*parts, resampler.end()])
    whole = np.array([resample(as_record(row, from_Hz), 20_000.0).values for row in values])
    assert found.shape == whole.shape and found == pytest.approx(whole, abs=1e-12)
