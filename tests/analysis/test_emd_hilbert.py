import json

import numpy as np
import pytest
from PyEMD import EMD
from scipy.interpolate import CubicSpline

from analysis import Record, RecordError, as_record
from analysis.signals.emd import STOPPING_RULES, decompose
from analysis.signals.hilbert import hilbert_spectrum, instantaneous, marginal_spectrum
from analysis.signals.sifting import not_a_knot
from gangue.__main__ import main
from lab.accuracy.emd_rules import cost

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


def test_a_record_that_would_fill_the_memory_is_refused():
    long = np.zeros(10_000_001)
    long[0] = 1.0
    with pytest.raises(RecordError, match="10000001 samples; EMD takes at most 1e.07: take a part"):
        decompose(as_record(long, RATE_HZ))


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


def test_am_fm_gives_its_envelope_and_frequency():
    """a(t) = 1 + 0.3 cos, f(t) = 600 + 60 cos: both slow against the carrier, as the analytic signal needs."""
    t = np.arange(6000) / RATE_HZ
    envelope = 1 + 0.3 * np.cos(2 * np.pi * 9 * t)
    frequency = 600 + 60 * np.cos(2 * np.pi * 7 * t)
    signal = envelope * np.cos(2 * np.pi * np.cumsum(frequency) / RATE_HZ)
    amplitude, found = instantaneous(signal, RATE_HZ)
    middle = slice(600, -600)  # the transform knows one period of the record: an end reaches as 1/distance
    np.testing.assert_allclose(amplitude[middle], envelope[middle], atol=2e-3)
    np.testing.assert_allclose(found[middle], frequency[middle], rtol=2e-3)


def test_impulse_response_decays_at_its_rate():
    """A damped oscillator after a blow: ln a(t) falls by zeta omega t; samples before it are kept.

    Of the signal itself: its first IMF decays a fifth more slowly, since the flat record
    before the blow has no extrema for the sifting to hold on to.
    """
    zeta, frequency = 0.02, 400.0
    t = (np.arange(3000) - 300) / RATE_HZ
    decay = 2 * np.pi * frequency * zeta
    signal = np.where(t >= 0, np.exp(-decay * t) * np.sin(2 * np.pi * frequency * t), 0.0)
    amplitude, found = instantaneous(signal, RATE_HZ)
    ringing = slice(350, 650)
    slope = np.polyfit(t[ringing], np.log(amplitude[ringing]), 1)[0]
    assert slope == pytest.approx(-decay, rel=0.05)
    assert np.median(found[ringing]) == pytest.approx(frequency, rel=0.01)


def naive_marginal(decomposition, width_Hz):
    """Sample by sample: numpy's unwrap and gradient of the phase, then one bin each."""
    from scipy.signal import hilbert

    rate_Hz, bins = decomposition.record.rate_Hz, {}
    for imf in decomposition.imfs:
        z = hilbert(imf)
        f = np.gradient(np.unwrap(np.angle(z))) * rate_Hz / (2 * np.pi)
        for k in range(imf.size):
            if 0 <= f[k] < width_Hz * np.ceil(rate_Hz / 2 / width_Hz):
                b = int(f[k] // width_Hz)
                bins[b] = bins.get(b, 0.0) + abs(z[k]) / rate_Hz / width_Hz
    return bins


def test_marginal_spectrum_equals_its_naive_twin():
    found = decompose(as_record(np.random.default_rng(8).standard_normal(500), RATE_HZ))
    twin = naive_marginal(found, 40.0)
    density = marginal_spectrum(found, bin_width_Hz=40.0).density
    np.testing.assert_allclose(
        density, [twin.get(b, 0.0) for b in range(density.size)], rtol=1e-9, atol=1e-15
    )


def test_hilbert_spectrum_integrates_to_the_marginal_one():
    found = decompose(as_record(np.random.default_rng(9).standard_normal(1000), RATE_HZ))
    spectrum = hilbert_spectrum(found, bin_width_Hz=50.0, times=20)
    duration_s = 1000 / RATE_HZ
    marginal = marginal_spectrum(found, bin_width_Hz=50.0).density * 50.0
    np.testing.assert_allclose(spectrum.amplitude.mean(axis=1) * duration_s, marginal, rtol=1e-9, atol=1e-12)


def test_rules_are_compared_on_a_known_signal():
    costs = [cost(rule, 2000, repeats=1) for rule in STOPPING_RULES]
    assert all(c["error_percent"] < 5 and c["time_ms"] > 0 for c in costs)


def test_short_and_monotone_records_have_a_decomposition():
    for values in ([0.0, 1.0], [1.0, 3.0, 2.0], np.linspace(0, 1, 50) ** 2):
        found = decompose(as_record(np.array(values), RATE_HZ))
        np.testing.assert_allclose(found.imfs.sum(axis=0) + found.residue, values, atol=1e-12)
        assert np.isfinite(marginal_spectrum(found).left_out)


@pytest.mark.parametrize("points", [4, 5, 9, 60])
def test_lean_spline_is_scipys(points):
    rng = np.random.default_rng(points)
    x, y = np.cumsum(rng.uniform(0.2, 2, points)), rng.normal(size=points)
    at = np.linspace(x[0], x[-1], 300)
    assert not_a_knot(x, y, at) == pytest.approx(CubicSpline(x, y)(at), abs=1e-12)


def test_lean_decomposition_is_pyemds():
    rng = np.random.default_rng(2)
    x = np.cumsum(rng.normal(size=400)) * 1e-3 + np.sin(np.arange(400) / 3)
    emd = EMD(extrema_detection="parabol", FIXE=10)
    emd.emd((x - x.mean()) / x.std(), max_imf=12)
    imfs, residue = emd.get_imfs_and_residue()
    found = decompose(as_record(x, 6667.0))
    assert found.imfs == pytest.approx(imfs * x.std(), abs=1e-8 * x.std())
    assert found.residue == pytest.approx(residue * x.std() + x.mean(), abs=1e-8 * x.std())


@pytest.mark.parametrize("levels", [16, 128, 2048])
@pytest.mark.parametrize("rule", STOPPING_RULES)
def test_a_digitised_record_has_the_energies_of_the_analogue_one(rule, levels):
    t, noise = np.arange(4096) / 51200, np.random.default_rng(1).standard_normal(4096)
    x = np.exp(-30 * t) * np.sin(2 * np.pi * 800 * t) + 0.01 * noise
    held = [decompose(as_record(one, 51200.0), rule).energies.sum() for one in (x, np.round(levels * x) / levels)]
    assert held[1] == pytest.approx(held[0], rel=0.2)


def test_features_leave_out_imfs_that_hold_much_more_energy_than_the_record(tmp_path, capsys):
    """A spline that comes from dense extrema swings far out over a quiet part."""
    t_s = np.arange(2000) / 1e5
    moved = np.where(t_s < 0.008, 0.0, np.exp(-300 * t_s) * np.sin(2e4 * t_s + 1))
    np.savetxt(tmp_path / "late.csv", np.column_stack([t_s, moved]), delimiter=",", header="t_s,acc", comments="")
    assert main(["features", str(tmp_path / "late.csv"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert "times the record's energy, where at most 2" in found["left_out"]
    assert "rms" in found["features"] and not any("imf" in name or "spectrum" in name for name in found["features"])


@pytest.mark.parametrize(("cut", "told"), [
    (lambda x: x.clip(-0.4), "clipped: 12 samples at -0.4 m/s^2"), (lambda x: x, None), (lambda x: x.clip(0), None),
    (lambda x: np.sin(np.pi / 10 * np.arange(300)).round(9), None),
    (lambda x: (127 * np.sin(0.01 * np.arange(3000))).round(), None)])
def test_features_tell_a_record_that_is_cut_off(tmp_path, capsys, cut, told):
    """A force is never below 0, where it stays for long, and that is no fault; nor is a sine, digitised or not."""
    x = np.exp(-np.arange(300) / 60) * np.sin(0.2 * np.arange(300) + 0.3)
    np.savetxt(tmp_path / "x.csv", cut(x), header="acc_m_s2", comments="")
    assert main(["features", str(tmp_path / "x.csv"), "--rate", "1000", "--resample", "900", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["clipped"] == told


def test_complex_numbers_are_no_signal():
    with pytest.raises(RecordError, match="complex numbers"):
        as_record(np.exp(1j * np.arange(9.0)), 1.0)


def test_what_gives_no_spectrum_is_refused():
    x = np.sin(np.arange(400.0))
    for imf, rate_Hz in ((np.where(x == x.max(), np.nan, x), 1e3), (x, 0.0), (x, np.nan), (x[:0], 1e3),
                         (np.ones((2, 9)), 1e3)):
        with pytest.raises(RecordError):
            instantaneous(imf, rate_Hz)
    found = decompose(as_record(x, 1e3))
    for width_Hz in (0.0, np.nan, np.inf, 1e-300):
        for spectrum in (marginal_spectrum, hilbert_spectrum):
            with pytest.raises(RecordError, match="bin_width_Hz"):
                spectrum(found, bin_width_Hz=width_Hz)
    with pytest.raises(RecordError, match="times = 0"):
        hilbert_spectrum(found, times=0)
    spectrum = hilbert_spectrum(found, times=10**9)
    assert spectrum.amplitude.shape[1] == found.record.values.size and spectrum.amplitude.sum(axis=0).all()
    with pytest.raises(RecordError, match="t0_s = nan"):
        Record(x, 1e3, t0_s=np.nan)
