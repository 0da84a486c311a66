"""Pictures of a record in time and frequency, by Matplotlib (extra `report`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analysis.signals.hilbert import HilbertSpectrum
from analysis.signals.records import Record, RecordError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FLOOR_DB = -80.0  # below the largest value, all is one colour


def plot_hilbert(spectrum: HilbertSpectrum, axes: Axes | None = None, unit: str = "") -> Axes:
    """Draw a Hilbert spectrum, whose amplitude has the `unit` of the record, into `axes` or a new figure; cells without
    amplitude stay blank. Returns the axes.

    >>> spectrum = hilbert_spectrum(decompose(read_record("runs/paper/ratio_030")), times=50)
    >>> plot_hilbert(spectrum, unit="m/s²").get_ylabel()
    'frequency, kHz'
    """
    field = np.ma.masked_equal(spectrum.amplitude, 0)
    return _mesh(axes, spectrum.edges_s, spectrum.edges_Hz, field, ", ".join(filter(None, ("amplitude", unit))))


def plot_spectrogram(record: Record, axes: Axes | None = None, window_s: float | None = None) -> Axes:
    """Draw the power density of windows of `window_s` (Hann, three quarters of one within the next; default: a 32nd of
    the record) in dB over the unit of the record squared per Hz. Returns the axes. Raises RecordError for a window of
    fewer than 8 samples or longer than the record.

    >>> plot_spectrogram(read_record("runs/paper/ratio_030"), window_s=0.005).get_xlabel()
    'time, ms'
    """
    from scipy.signal import spectrogram

    size = record.values.size
    samples = max(8, size // 32) if window_s is None else round(window_s * record.rate_Hz)
    if not 8 <= samples <= size:
        raise RecordError(f"{record.name}: window_s = {window_s}; needs from 8 samples to {size}, at "
                          f"{record.rate_Hz:g} Hz")
    step = max(1, samples // 4)
    centre_Hz, centre_s, power = spectrogram(record.values, record.rate_Hz, "hann", samples, samples - step)
    largest = power.max() or 1.0
    level_dB = 10 * np.log10(np.maximum(power, largest * 10 ** (FLOOR_DB / 10)))
    edges_s = record.t0_s + np.append(centre_s - step / record.rate_Hz / 2, centre_s[-1] + step / record.rate_Hz / 2)
    half_Hz = record.rate_Hz / samples / 2
    return _mesh(axes, edges_s, np.append(centre_Hz - half_Hz, centre_Hz[-1] + half_Hz).clip(0), level_dB,
                 f"power density, dB of ({record.unit})²/Hz")


def _mesh(axes: Axes | None, edges_s: np.ndarray, edges_Hz: np.ndarray, values: np.ndarray, label: str) -> Axes:
    if axes is None:
        import matplotlib.pyplot as plt

        axes = plt.figure(layout="constrained").add_subplot()
    image = axes.pcolormesh(1e3 * edges_s, 1e-3 * edges_Hz, values, cmap="viridis", rasterized=True)
    axes.figure.colorbar(image, ax=axes, label=label, fraction=0.05)
    axes.set_xlabel("time, ms")
    axes.set_ylabel("frequency, kHz")
    axes.grid(False)
    return axes
