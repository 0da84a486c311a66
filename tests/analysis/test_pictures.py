"""Pictures in time and frequency show a tone where it is."""

import numpy as np
import pytest

from analysis import Record, RecordError, decompose, hilbert_spectrum, plot_hilbert, plot_spectrogram

pytest.importorskip("matplotlib").use("Agg")

RATE_Hz, TONES_Hz = 4000.0, (300.0, 1100.0)
T_s = np.arange(4000) / RATE_Hz
RECORD = Record(np.where(T_s < 0.5, *(np.sin(2 * np.pi * f * T_s) for f in TONES_Hz)), RATE_Hz, "m/s^2", t0_s=2.0)


@pytest.mark.parametrize("kind", ["spectrogram", "Hilbert"])
def test_the_brightest_frequency_is_that_of_the_tone(kind):
    if kind == "spectrogram":
        axes = plot_spectrogram(RECORD, window_s=0.05)
    else:
        axes = plot_hilbert(hilbert_spectrum(decompose(RECORD)), unit=RECORD.unit)
    (mesh,) = axes.collections
    edges_ms, edges_kHz = mesh.get_coordinates()[0, :, 0], mesh.get_coordinates()[:, 0, 1]
    values = np.ma.filled(mesh.get_array().astype(float), -np.inf).reshape(len(edges_kHz) - 1, -1)
    for t_ms, tone_Hz in zip((2250.0, 2750.0), TONES_Hz, strict=True):
        brightest = values[:, np.searchsorted(edges_ms, t_ms) - 1].argmax()
        assert edges_kHz[brightest] - 0.01 <= tone_Hz / 1e3 <= edges_kHz[brightest + 1] + 0.01
    assert 2000.0 <= edges_ms[0] <= 2025.0 and 2975.0 <= edges_ms[-1] <= 3000.0  # within half a window
    assert edges_kHz[-1] >= RATE_Hz / 2e3 - 1e-9


def test_pictures_go_into_given_axes_and_bad_windows_are_refused():
    import matplotlib.pyplot as plt

    axes = plt.figure().add_subplot()
    assert plot_spectrogram(RECORD, axes) is axes
    for window_s in (1e-3, 1.1):
        with pytest.raises(RecordError, match="window_s"):
            plot_spectrogram(RECORD, window_s=window_s)
