"""Check of a record's channels before anything is read from them, and the command `check`.

What can be told is taken away (offset, hum) or told (gains); what cannot be explained is refused. Below its first
bending mode a plate hardly accelerates: there the offset and the hum stand alone.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isnan, nan
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import butter, sosfiltfilt

from analysis.signals.records import clipped
from common.result import Result
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import BENDS, read_accelerations
from recognition.sensors.free_ringing import Ringing, ringing_of

ONSET_SHARE = 0.2  # of the largest sample
LATEST_IMPACT = 3  # sample of a record that begins with the impact; at 6667 Hz simulated ones show it in the next
LEAST_HUM = 0.01  # of the peak: less is not told
DEAD_SHARE = 0.02  # of the median of the other channels' rms
AFTER_s, STRETCH_s = (2.5e-3, 5e-3, 8e-3), 10e-3  # beginnings after the onset, and length, of free motion
#: A further blow is so many times as large as what was RISES_s to AHEAD_s before. So many are looked at.
RISE, RISES_s, AHEAD_s, MOST_BLOWS = 3.0, 5e-4, 2e-3, 12
BAND = 0.75  # of the plate's highest frequency: what rings above is filtered off
#: Limit of the misfit: so many times what is expected, but within these bounds. A plate that is known so badly that
#: more is expected cannot be checked against.
MISFIT_FACTOR, LEAST_LIMIT, MOST_LIMIT = 2.5, 0.15, 0.35
SWAP_GAIN = 0.6  # another order of sensors is believed if it leaves less than this of the misfit
GAIN_SDS, GAIN_LIMITS = 4.0, (0.5, 2.0)
MOST_GAIN = 0.1  # a gain farther off is told, if it is sure; nearer is within what the recognition allows for
MAINS_Hz = (50.0, 60.0)
HARMONICS = 5
BELOW_MODE = 0.6  # of the first bending mode: harmonics are sought up to here in a record that is not still
LEAST_PERIODS = 2.0  # of the mains, that a record or its silence must have


@dataclass(frozen=True)
class ChannelReport:
    """signals (s, n): without offset and hum. ringing: after the first blow that a motion of the plate explains, else
    after the first; None where no free motion could be looked at. told: what was taken away or is worth knowing, one
    line each; refused: why the record cannot be used, one line each."""

    signals: Floats
    hum: "Hum"
    ringing: Ringing | None
    told: tuple[str, ...]
    refused: tuple[str, ...]


def check_channels(signals: Floats, rate_Hz: float, plate: PlateModel) -> ChannelReport:
    """Check accelerations (s, n), m/s^2, of a record in which the plate is struck, once or often, and then rings.
    Raises RecognitionError for another number of channels than the plate has, or for values that are not
    finite."""
    if signals.ndim != 2 or len(signals) != len(plate.sensor_names):
        raise RecognitionError(f"signals of shape {signals.shape}; needs {len(plate.sensor_names)} channels")
    if not np.isfinite(signals).all():
        raise RecognitionError("a sample is not finite")
    names = plate.sensor_names
    refused = channel_faults(signals, names)
    onset = _onset(signals)
    clean, hum, told = without_hum(signals, rate_Hz, plate, onset, LEAST_PERIODS)
    if refused:
        return ChannelReport(clean, hum, None, tuple(told), tuple(refused))
    ringings = _ringings(clean, rate_Hz, plate, onset)
    if not ringings:
        return ChannelReport(clean, hum, None, tuple(told), ())
    ringing, more_told, refused = _judged_together(ringings, names)
    return ChannelReport(clean, hum, ringing, (*told, *more_told), tuple(refused))


def without_hum(signals: Floats, rate_Hz: float, plate: PlateModel, onset: int,
                periods: float) -> tuple[Floats, "Hum", list[str]]:
    """Accelerations (s, n) of a record in which the plate is struck from sample `onset` on, less offset and hum if
    these are worth it, both, and what was taken away, one line each. A record that is not still is looked at for hum
    where it has so many `periods` of it."""
    bends = plate.rms_shape > BENDS * plate.rms_shape.max()
    long_enough = signals.shape[1] >= periods / min(MAINS_Hz) * rate_Hz * (1 - 1e-9)
    hum = hum_of(signals, rate_Hz, onset * 4 // 5, float(plate.frequency_Hz[bends][0]) if long_enough else 0.0)
    told = _told_of_hum(hum, abs(signals).max(axis=1), plate.sensor_names)
    return signals - hum.sum if told else signals, hum, told


def samples_before_impact(signals: Floats) -> int:
    """Samples of accelerations (s, n) by which a record begins too early: those before the one in which the impact
    shows first, less one, but none where it is among the first few."""
    onset = _onset(signals)
    return onset - 1 if onset > LATEST_IMPACT else 0


def channel_faults(signals: Floats, names: Sequence[str]) -> list[str]:
    """Which channels of signals (s, n) cannot be used by themselves, and why, one line each."""
    return [f"{name}: {why}" for i, name in enumerate(names) if (why := _dead_or_clipped(signals, i))]


def _dead_or_clipped(signals: Floats, i: int) -> str:
    """Why channel i cannot be used by itself, "" if it can."""
    x = signals[i]
    others = np.delete(signals, i, axis=0)
    rms = x.std()
    if rms == 0 or len(others) and rms < DEAD_SHARE * np.median(others.std(axis=1)):
        return "dead: it hardly moves"
    return clipped(x, x.max(), "m/s^2") or clipped(x, x.min(), "m/s^2")


def _onset(signals: Floats) -> int:
    """First sample at which any channel, less its median, exceeds a share of its largest."""
    size = abs(signals - np.median(signals, axis=1, keepdims=True))
    return int((size > ONSET_SHARE * size.max(axis=1, keepdims=True)).any(axis=0).argmax())


def _told_of_hum(hum: "Hum", peak: Floats, names: tuple[str, ...]) -> list[str]:
    told = []
    for name, offset, amplitude, most in zip(names, hum.offset, hum.amplitude, peak, strict=True):
        if abs(offset) > LEAST_HUM * most:
            told.append(f"{name}: offset {offset:.4g} m/s^2 taken away")
        if amplitude > LEAST_HUM * most:
            told.append(f"{name}: hum at {hum.mains_Hz:g} Hz of {amplitude:.4g} m/s^2 taken away")
    return told


def _blows(signals: Floats, rate_Hz: float, onset: int) -> list[int]:
    """First samples of blows: the onset, and what rises above the ringing later, AHEAD_s or more after the one before;
    MOST_BLOWS at most, evenly chosen."""
    size = (abs(signals) / abs(signals).max(axis=1, keepdims=True)).max(axis=0)
    ahead, rises = max(round(AHEAD_s * rate_Hz), 2), max(round(RISES_s * rate_Hz), 1)
    before = sliding_window_view(np.concatenate([np.zeros(ahead), size]), ahead - rises).max(axis=1)[:size.size]
    found = [onset]
    for k in np.flatnonzero(size > np.maximum(ONSET_SHARE, RISE * before)).tolist():
        if k >= found[-1] + ahead:
            found.append(k)
    return found[::-(-len(found) // MOST_BLOWS)]


def _ringings(signals: Floats, rate_Hz: float, plate: PlateModel, onset: int) -> dict[float, Ringing]:
    """By the time of the blow in s: of the stretch after it that fits best; none where the record is too short. A blow
    after the first that another one follows too soon is passed over."""
    band_Hz = BAND * plate.max_frequency_Hz
    if signals.shape[1] * band_Hz < rate_Hz:
        return {}  # shorter than one period, and no filter of such a band has numbers
    filtered = signals
    if band_Hz < 0.45 * rate_Hz:
        filtered = sosfiltfilt(butter(8, band_Hz, fs=rate_Hz, output="sos"), signals, axis=1)
    silence = filtered[:, : onset * 4 // 5]
    noise = silence.std(axis=1) if silence.shape[1] > 30 else np.zeros(len(signals))
    blows, length, ringings = _blows(signals, rate_Hz, onset), round(STRETCH_s * rate_Hz), {}
    for blow, following in zip(blows, [*blows[1:], signals.shape[1]], strict=True):
        starts = [blow + round(after_s * rate_Hz) for after_s in AFTER_s]
        last = signals.shape[1] if blow == onset else following
        found = [ringing_of(filtered[:, start:start + length], rate_Hz, plate, noise)
                 for start in starts if length > 1 and start + length <= last]
        if found:
            ringings[blow / rate_Hz] = min(found, key=_excess)
    return ringings


def _excess(one: Ringing) -> float:
    """Misfit over what is expected, which is nothing where there is no silence and the plate is known exactly."""
    return min(one.misfit, one.order_misfit) / max(one.expected, np.finfo(float).tiny)


def _limit(ringing: Ringing) -> float:
    return min(max(MISFIT_FACTOR * ringing.expected, LEAST_LIMIT), MOST_LIMIT)


def _judged_together(ringings: dict[float, Ringing], names: tuple[str, ...]) -> tuple[Ringing, list[str], list[str]]:
    """Of blows by their times: the ringing that the check tells of, what is told and what is refused. What no motion of
    the plate explains counts where that is so of all: one blow may come on top of another."""
    explained = {at_s: one for at_s, one in ringings.items() if min(one.misfit, one.order_misfit) <= _limit(one)}
    first_s = next(iter(explained or ringings))
    told, refused = _judged(ringings[first_s], names)
    for at_s, one in explained.items():
        if not refused:
            refused = [f"from {at_s:.4g} s: {why}" for why in _judged(one, names)[1]]
    if len(ringings) > 1:
        told.append(f"{len(explained)} of {len(ringings)} blows are followed by free ringing of this plate")
    return ringings[first_s], told, refused


def _judged(ringing: Ringing, names: tuple[str, ...]) -> tuple[list[str], list[str]]:
    limit, own = _limit(ringing), tuple(range(len(names)))
    if ringing.order != own and ringing.order_misfit < SWAP_GAIN * ringing.misfit:
        mixed = [f"{names[i]} shows what {names[k]} should" for i, k in zip(own, ringing.order, strict=True) if i != k]
        return [], ["sensors swapped: " + ", ".join(mixed)]
    if ringing.misfit > limit:
        return [], [f"{ringing.misfit:.0%} of the ringing is no motion of this plate, limit {limit:.0%}, or there was "
                    f"a second blow within {1e3 * (AFTER_s[-1] + STRETCH_s):g} ms of the first"]
    told, refused = [], []
    for name, gain, sd in zip(names, ringing.gain, ringing.gain_sd, strict=True):
        if not GAIN_LIMITS[0] < gain < GAIN_LIMITS[1]:
            refused.append(f"{name}: gain {gain:.2f}; a sensor has {GAIN_LIMITS[0]:g} to {GAIN_LIMITS[1]:g}")
        elif abs(gain - 1) > MOST_GAIN and abs(gain - 1) > GAIN_SDS * sd:
            told.append(f"{name}: gain {gain:.3f} +- {sd:.3f} against the others")
    return told, refused


@dataclass(frozen=True)
class Hum:
    """offset (s,), m/s^2; mains_Hz: 50 or 60; amplitude (s,), m/s^2: root of the sum of squared harmonics; sum (s, n):
    offset and hum over the record."""

    offset: Floats
    mains_Hz: float
    amplitude: Floats
    sum: Floats


def hum_of(signals: Floats, rate_Hz: float, quiet: int, first_mode_Hz: float) -> Hum:
    """Offset and hum of signals (s, n), by least squares.

    From the first `quiet` samples with all harmonics, where these last two periods of the mains; else from the whole
    record under Hann's window, with the harmonics well below the plate's first bending mode. A record of less than two
    periods has an offset only.
    """
    n = signals.shape[1]
    still = quiet / rate_Hz >= LEAST_PERIODS / min(MAINS_Hz)
    highest_Hz = rate_Hz / 4 if still else BELOW_MODE * first_mode_Hz
    used = quiet if still else n
    weight = np.ones(used) if still else np.hanning(used)
    fits = []
    for mains in MAINS_Hz:
        long_enough = used / rate_Hz >= LEAST_PERIODS / mains * (1 - 1e-9)
        orders = [k for k in range(1, HARMONICS + 1) if k * mains < highest_Hz and long_enough]
        columns = _columns(mains, orders, n, rate_Hz)
        found = np.linalg.lstsq(columns[:used] * weight[:, None], (signals[:, :used] * weight).T, rcond=None)[0]
        left = float(np.sum(((signals[:, :used].T - columns[:used] @ found) * weight[:, None]) ** 2))
        fits.append((left, mains, columns, found))
    _, mains, columns, found = min(fits, key=lambda fit: fit[0])
    amplitude = np.sqrt(np.sum(found[1:] ** 2, axis=0))
    return Hum(found[0], mains, amplitude, (columns @ found).T)


def _columns(mains_Hz: float, orders: list[int], n: int, rate_Hz: float) -> Floats:
    phase = 2 * np.pi * mains_Hz * np.arange(n)[:, None] / rate_Hz * np.array(orders, float)
    return np.hstack([np.ones((n, 1)), np.cos(phase), np.sin(phase)])


@dataclass(frozen=True)
class CheckResult(Result):
    """told: what is worth knowing; refused: why the record cannot be used, one text each. misfit: rms of the ringing
    that no motion of the plate explains, in shares of the record, and what is expected; NaN without ringing."""

    told: tuple[str, ...]
    refused: tuple[str, ...]
    misfit: float = nan
    expected_misfit: float = nan

    def words(self) -> Iterator[str]:
        yield from self.told
        if self.refused:
            yield f"REFUSED: {'; '.join(self.refused)}"
        elif isnan(self.misfit):
            yield "too short for a look at free ringing: gains and order of the sensors are not checked"
        else:
            yield (f"{100 * self.misfit:.1f} % of the ringing is not explained, "
                   f"{100 * self.expected_misfit:.1f} % expected")


def check(record: str, plate: str, scale: float = 1.0, unit: str | None = None) -> CheckResult:
    """Look for faults in the channels of a record (see `record_table`), by a plate of `tap`. Raises InputError."""
    known = PlateModel.load(Path(plate))
    _, signals, rate_Hz = read_accelerations(record, known, scale, unit)
    found = check_channels(signals, rate_Hz, known)
    misfits = () if found.ringing is None else (found.ringing.misfit, found.ringing.expected)
    return CheckResult(found.told, found.refused, *misfits)
