"""Real records: what the product makes of balls, hammer hits and a ramp that others measured.

They are no part of the project: GANGUE_REAL, or shared/real beside the checkout or above it, is their folder, in which
each set has its own.

- *balls* of 6 and 10 mm fall on a concrete slab, one sensor. The mean form of a stone's force is fitted to the first
  pulse, until it has fallen to STILL of its peak: what follows are echoes. Hertz gives duration s ~ R v^(-1/5) and
  impulse J ~ R^3 v, so R ~ (J s^5)^(1/8) whatever the speed. A ball is told by the means of the others.
- *hits*: two blows of a hammer on one place of a plate. The transfer of force that one shows predicts the other, under
  windows exp(-t/T).
- *ramp*: nuts, screws and spheres run down a ramp with two microphones. Windows of 0.2 s, by `band_levels` and a linear
  discriminant with shrinkage (Ledoit and Wolf), learnt from the other recordings.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.optimize import least_squares
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

from analysis import read_record
from analysis.files.readers import read_signals
from analysis.signals.records import RecordError
from lab.study import Row
from recognition.stone_forces.forces import load_forces
from recognition.tapping.taps import Tap, samples_of, spectra

GIVEN = [Path(os.environ["GANGUE_REAL"])] if "GANGUE_REAL" in os.environ else []
BESIDE = [above / "shared" / "real" for above in Path(__file__).resolve().parents]
QUIET, LEAD, STILL = 300, 40, 0.8  # samples of the balls' records without a ball, and before its peak
STARTS_s = (5e-6, 8e-6, 12e-6)  # of a duration, from which the fit begins
WINDOW_s, OVERLAP = 0.2, 8  # of the ramp; training windows are so many times as dense
WITHIN_s = (0.01, 0.05, 0.2)  # of the hits
HIGHEST_Hz, LEAD_s = 2000.0, 1e-3
FRAME, LEVELS = 512, 32  # of `band_levels`


def real(name: str) -> Path | None:
    """The folder of a set, None where it is not at hand."""
    return next((place / name for place in (*GIVEN, *BESIDE) if (place / name).is_dir()), None)


def contact(file: Path) -> tuple[float, float]:
    """Duration (s) and impulse (in units of the record, times s) of the first pulse of a ball."""
    record, forces = read_record(file), load_forces()
    x, t_s = record.values - record.values[:QUIET].mean(), np.arange(record.values.size) / record.rate_Hz
    peak = int(np.argmax(abs(x)))
    x = x / x[peak]
    part = slice(peak - LEAD, peak + int(np.argmax(x[peak:] <= STILL)))

    def left(p: np.ndarray) -> np.ndarray:
        late_s, log_s, log_impulse = p
        return np.exp(log_impulse) * forces.pulse(0, np.exp(log_s), t_s[part] - t_s[peak] - late_s) - x[part]

    fits = [least_squares(left, [0.0, np.log(s), np.log(2.5 * s)], x_scale=[1e-6, 0.1, 0.1]) for s in STARTS_s]
    _, log_s, log_impulse = min(fits, key=lambda fit: fit.cost).x
    return float(np.exp(log_s)), float(np.exp(log_impulse) * abs(record.values[peak]))


def balls(folder: Path) -> dict[str, float]:
    """How many are told, and the ratios of duration and of size at any speed, by Hertz 10/6 for the second."""
    duration, size = defaultdict(list), defaultdict(list)
    for file in sorted(folder.glob("*mm--*.txt")):
        s, impulse = contact(file)
        kind = file.name.split("--")[0]
        duration[kind].append(np.log(s))
        size[kind].append(np.log(impulse * s**5) / 8)
    told = [abs(one - np.mean(size[kind][:k] + size[kind][k + 1:])) < abs(one - np.mean(size[other]))
            for kind, other in (("6mm", "10mm"), ("10mm", "6mm")) for k, one in enumerate(size[kind])]
    ratio = {name: float(np.exp(np.mean(of["10mm"]) - np.mean(of["6mm"]))) for name, of in
             (("duration_ratio", duration), ("size_ratio", size))}
    return {"records": len(told), "told_percent": 100 * float(np.mean(told))} | ratio


def hits(folder: Path) -> dict[str, float]:
    """What is left of hit B, in per cent, least and most over the accelerometers, by how long it is followed."""
    taps = []
    for name in ("hit_a.mat", "hit_b.mat"):
        data = loadmat(folder / name)["Data"].T
        data = data - data[:, :QUIET].mean(axis=1, keepdims=True)
        taps.append(Tap(np.zeros(2), data[1:], 10e3, data[0], name))
    found: dict[str, float] = {}
    for within_s in WITHIN_s:
        a, b = (spectra(tap, 1 / within_s, HIGHEST_Hz, LEAD_s, samples_of(taps, LEAD_s)) for tap in taps)
        left = b.acceleration - a.acceleration / a.force * b.force
        share = 100 * np.sqrt(np.sum(abs(left) ** 2, axis=1) / np.sum(abs(b.acceleration) ** 2, axis=1))
        found |= {f"least_percent_{1e3 * within_s:g}_ms": share.min(), f"most_percent_{1e3 * within_s:g}_ms": share.max()}
    return {"records": 1.0} | {name: float(value) for name, value in found.items()}


def band_levels(signals: np.ndarray) -> np.ndarray:
    """Of each of the signals (m, n), in frames of FRAME samples that overlap by half, and LEVELS bands of equal width:
    the logarithm of the mean power of a band over the frames, the mean of the logarithm, and its standard deviation.

    Rare blows raise the first, what sounds all the time the second, (m 3 LEVELS,). Raises RecordError for silence and
    for records shorter than two frames."""
    if signals.shape[1] < 2 * FRAME:
        raise RecordError(f"{signals.shape[1]} samples; needs {2 * FRAME}")
    frames = np.lib.stride_tricks.sliding_window_view(signals, FRAME, axis=1)[:, ::FRAME // 2]
    spectrum = np.abs(np.fft.rfft(frames * np.hanning(FRAME), axis=2)[..., 1:]) ** 2
    power = spectrum.reshape(*spectrum.shape[:2], LEVELS, -1).sum(axis=3)
    if power.min() <= 0:
        raise RecordError("the record is silent in a band")
    level = np.log(power)
    return np.stack([np.log(power.mean(axis=1)), level.mean(axis=1), level.std(axis=1)], axis=1).ravel()


def windows(file: Path, step: int) -> np.ndarray:
    """Features (windows, p) of a recording, `step` windows a window's length."""
    table = read_signals(file)
    n = round(WINDOW_s / float(table["t_s"].iloc[1] - table["t_s"].iloc[0]))
    signals = table.drop(columns="t_s").to_numpy(dtype=float).T
    return np.stack([band_levels(signals[:, k:k + n])
                     for k in range(0, signals.shape[1] - n + 1, n // step)])


def ramp(folder: Path) -> dict[str, float]:
    """Windows of whole recordings, learnt from those with another number."""
    files = sorted(folder.glob("*_[0-9]*.wav"))
    of = {file: tuple(file.stem.rsplit("_", 1)) for file in files}
    right = []
    for number in sorted({one for _, one in of.values()}):
        train = {file: windows(file, OVERLAP) for file in files if of[file][1] != number}
        known = np.concatenate([[of[file][0]] * len(rows) for file, rows in train.items()])
        law = LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto").fit(np.concatenate(list(train.values())), known)
        for file in files:
            if of[file][1] == number:
                right += (law.predict(windows(file, 1)) == of[file][0]).tolist()
    return {"records": len(files), "windows": len(right), "told_percent": 100 * float(np.mean(right))}


def real_records(out: Path) -> Iterator[Row]:
    """A set a row; those that are not at hand are left out."""
    for name, judged, folder in (("balls", balls, "balls"), ("hits", hits, "plate_hits"), ("ramp", ramp, "ramp")):
        if (found := real(folder)) is not None:
            yield Row({"set": name}, partial(judged, found))
