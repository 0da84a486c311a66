"""The impulse against a closed form: a plate on springs that is struck once, and rings in modes without momentum besides."""

import numpy as np
import pandas as pd
import pytest

from lab.recognition.impulse import impulse_N_s
from recognition import RecognitionError

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
    found = impulse_N_s(record(size_N_s, frequency_Hz, damping_ratio, other_N=5e3, start_s=0.01))
    assert found == pytest.approx(size_N_s * half / np.tan(half), rel=2e-3)


def test_neither_damping_nor_frequency_changes_it():
    found = [impulse_N_s(record(6.5, f, zeta)) for f, zeta in ((270.0, 0.005), (270.0, 0.02), (300.0, 0.01))]
    assert np.ptp(found) < 0.003 * 6.5


@pytest.mark.parametrize(("signals", "reason"), [
    (record(6.5, 270.0, 0.01).assign(v_m_s=0.0), "at rest"),
    (record(6.5, 270.0, 0.01).iloc[:4], "shorter than 0.003 s"),
    (record(6.5, 270.0, 0.01).drop(columns=["rod_1_N", "rod_2_N"]), "rod"),
])
def test_what_has_no_impulse_says_so(signals, reason):
    with pytest.raises(RecognitionError, match=reason):
        impulse_N_s(signals)
