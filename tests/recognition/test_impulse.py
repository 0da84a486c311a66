"""The impulse against a closed form: a plate on springs that is struck once, and rings in modes without momentum besides."""

import numpy as np
import pandas as pd
import pytest

from lab.recognition.impulse import impulse
from recognition import RecognitionError
from recognition.evaluation.cross_validation import with_noise

MASS_KG = 40.0
DT_S = 1.5e-4


def record(impulse_N_s, frequency_Hz, damping_ratio, other_N=0.0, start_s=0.0, samples=267):
    """M u'' + c u' + k u = 0 from u' = -J/M; the rods' forces, pulling down, are c u' + k u.
    `other_N`: forces of a pair of rods that pull against each other."""
    t_s = np.arange(samples) * DT_S
    w0, decay = 2 * np.pi * frequency_Hz, damping_ratio * 2 * np.pi * frequency_Hz
    wd = np.sqrt(w0**2 - decay**2)
    size = -impulse_N_s / MASS_KG
    v = size * np.exp(-decay * t_s) * (np.cos(wd * t_s) - decay / wd * np.sin(wd * t_s))
    u = size / wd * np.exp(-decay * t_s) * np.sin(wd * t_s)
    rods = MASS_KG * (2 * decay * v + w0**2 * u)
    tilt = other_N * np.sin(2 * np.pi * 700 * t_s)
    return pd.DataFrame({"t_s": start_s + t_s, "v_m_s": v, "a_m_s2": np.gradient(v, DT_S), "rod_1_N": rods / 2 + tilt,
                         "rod_2_N": rods / 2 - tilt})


@pytest.mark.parametrize("size_N_s", [3.0, 6.5])
@pytest.mark.parametrize(("frequency_Hz", "damping_ratio"), [(150.0, 0.0), (270.0, 0.01), (400.0, 0.02)])
def test_impulse_of_a_struck_plate(size_N_s, frequency_Hz, damping_ratio):
    """The integral is a sum of trapezoids, which takes (x/2)/tan(x/2) of an oscillation, x = 2 pi f dt."""
    half = np.pi * frequency_Hz * DT_S
    found = impulse(record(size_N_s, frequency_Hz, damping_ratio, other_N=5e3, start_s=0.01))
    assert found.impulse_N_s == pytest.approx(size_N_s * half / np.tan(half), rel=2e-3)
    assert found.standard_error_N_s < 2e-3 * size_N_s


def test_neither_damping_nor_frequency_changes_it():
    found = [impulse(record(6.5, f, zeta)).impulse_N_s for f, zeta in ((270.0, 0.005), (270.0, 0.02), (300.0, 0.01))]
    assert np.ptp(found) < 0.003 * 6.5


@pytest.mark.parametrize("noise_db", [40, 20])
def test_the_standard_error_is_that_of_many_noisy_records(noise_db):
    clean = record(6.5, 270.0, 0.01)
    found = [impulse(with_noise(clean, noise_db, np.random.default_rng(seed))) for seed in range(300)]
    scatter = np.std([f.impulse_N_s for f in found])
    assert np.mean([f.standard_error_N_s for f in found]) == pytest.approx(scatter, rel=0.2)


@pytest.mark.parametrize("noisy", ["v_m_s", "rod_1_N"])
def test_the_standard_error_by_noise_of_the_velocity_or_of_a_rod_alone(noisy):
    """Noise of the velocity is white in the balance, that of a rod a walk. A record of 4.5 s tells one from the other."""
    clean, found = record(6.5, 270.0, 0.0, samples=30_000), []
    size = 0.05 * np.sqrt(np.mean(clean[noisy] ** 2))
    for seed in range(200):
        noise = size * np.random.default_rng(seed).standard_normal(len(clean))
        found.append(impulse(clean.assign(**{noisy: clean[noisy] + noise})))
    scatter = np.std([f.impulse_N_s for f in found])
    assert np.mean([f.standard_error_N_s for f in found]) == pytest.approx(scatter, rel=0.15)


@pytest.mark.parametrize(("signals", "reason"), [
    (record(6.5, 270.0, 0.01).assign(v_m_s=0.0), "at rest"),
    (record(6.5, 270.0, 0.01).iloc[:4], "shorter than 0.003 s"),
    (record(6.5, 270.0, 0.01).drop(columns=["rod_1_N", "rod_2_N"]), "rod"),
])
def test_what_has_no_impulse_says_so(signals, reason):
    with pytest.raises(RecognitionError, match=reason):
        impulse(signals)
