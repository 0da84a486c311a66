"""Sound files: WAV by scipy, FLAC by soundfile (extra `records`)."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path

import numpy as np

from analysis.signals.records import Record, RecordError, chosen

# What scipy raises for a broken file, found by tests/fuzz.
BROKEN_WAV = (OSError, ValueError, EOFError, TypeError, UnboundLocalError, ZeroDivisionError, struct.error)


def read_wav(path: str | Path, channel: str | None = None) -> Record:
    """Return one channel of a WAV file; whole numbers become shares of full scale, -1..1.

    The channel is a number from 0, needed where there are several. `scale` of `read_record` calibrates the samples.
    Raises RecordError if the file cannot be read or the channel is left open.
    """
    from scipy.io import wavfile

    path = Path(path)
    try:
        with warnings.catch_warnings():
            # Chunks beside the samples (calibration notes of a recorder) are no fault.
            warnings.simplefilter("ignore", wavfile.WavFileWarning)
            rate_Hz, samples = wavfile.read(path)
    except BROKEN_WAV as error:
        raise RecordError(f"{path}: not a readable WAV file ({error})") from None
    if samples.size == 0:
        raise RecordError(f"{path}: holds no samples")
    return _channel(path, _shares_of_full_scale(samples), rate_Hz, channel)


def read_flac(path: str | Path, channel: str | None = None) -> Record:
    """Return one channel of a FLAC file, as `read_wav`. Raises RecordError also where soundfile is missing."""
    path = Path(path)
    try:
        import soundfile
    except (ImportError, OSError):  # OSError: without the library libsndfile
        raise RecordError(f"{path}: reading FLAC needs the package soundfile (pip install soundfile)") from None

    try:
        samples, rate_Hz = soundfile.read(path)
    except (OSError, RuntimeError, ValueError, TypeError) as error:  # its own error is a RuntimeError
        raise RecordError(f"{path}: not a readable FLAC file ({' '.join(str(error).split())})") from None
    if samples.size == 0:
        raise RecordError(f"{path}: holds no samples")
    return _channel(path, samples, rate_Hz, channel)


def _shares_of_full_scale(samples: np.ndarray) -> np.ndarray:
    """Whole numbers as shares of the largest, -1..1."""
    if not np.issubdtype(samples.dtype, np.integer):
        return samples
    centre = 128.0 if samples.dtype == np.uint8 else 0.0
    return (samples - centre) / (centre or -float(np.iinfo(samples.dtype).min))


def _channel(path: Path, samples: np.ndarray, rate_Hz: float, channel: str | None) -> Record:
    """One of the channels of samples (n,) or (n, channels)."""
    samples = samples.reshape(len(samples), -1)
    number = chosen(path, channel, [str(i) for i in range(samples.shape[1])])
    return Record(samples[:, number], float(rate_Hz), "1", f"{path}: {number}")
