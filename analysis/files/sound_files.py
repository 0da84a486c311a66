"""Sound files: WAV by scipy, FLAC by soundfile (extra `records`)."""

from __future__ import annotations

import struct
import warnings
from functools import partial
from pathlib import Path

import numpy as np

from analysis.signals.records import Channels, Record, RecordError

# What scipy raises for a broken file, found by tests/fuzz.
BROKEN_WAV = (OSError, ValueError, EOFError, TypeError, UnboundLocalError, ZeroDivisionError, struct.error)


def read_wav(path: Path) -> Channels:
    """The channels of a WAV file by their numbers; whole numbers become shares of full scale, -1..1, which `scale` of
    `read_record` calibrates. Raises RecordError."""
    from scipy.io import wavfile

    try:
        with warnings.catch_warnings():
            # Chunks beside the samples (calibration notes of a recorder) are no fault.
            warnings.simplefilter("ignore", wavfile.WavFileWarning)
            rate_Hz, samples = wavfile.read(path)
    except BROKEN_WAV as error:
        raise RecordError(f"{path}: not a readable WAV file ({error})") from None
    if samples.size == 0:
        raise RecordError(f"{path}: holds no samples")
    return _channels(path, _shares_of_full_scale(samples), rate_Hz)


def read_flac(path: Path) -> Channels:
    """The channels of a FLAC file, as `read_wav`. Raises RecordError also where soundfile is missing."""
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
    return _channels(path, samples, rate_Hz)


def _shares_of_full_scale(samples: np.ndarray) -> np.ndarray:
    """Whole numbers as shares of the largest, -1..1."""
    if not np.issubdtype(samples.dtype, np.integer):
        return samples
    centre = 128.0 if samples.dtype == np.uint8 else 0.0
    return (samples - centre) / (centre or -float(np.iinfo(samples.dtype).min))


def _channels(path: Path, samples: np.ndarray, rate_Hz: float) -> Channels:
    """Of samples (n,) or (n, channels)."""
    return {str(k): partial(Record, one, float(rate_Hz), "1", f"{path}: {k}")
            for k, one in enumerate(samples.reshape(len(samples), -1).T)}
