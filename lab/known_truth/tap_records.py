"""Records of taps on a plate that is known, to see what can be learnt from them."""

from __future__ import annotations

import numpy as np
from scipy.signal import resample_poly

from recognition.estimation.arrays import Floats
from recognition.plate.plate_model import PlateModel
from recognition.tapping.taps import Tap

FINER = 6  # times finer than the record, the plate is moved
SILENCE_s = 5e-3  # before the tap
PEAK_N, DURATION_s = (300.0, 1500.0), (2e-4, 4e-4)  # of hammer taps: a hard tip


def hammer_taps(plate: PlateModel, places_m: Floats, rng: np.random.Generator, *, rate_Hz: float = 20e3,
                duration_s: float = 0.3, noise_db: float | None = 20.0, force_known: bool = True,
                place_error_m: float = 0.0) -> list[Tap]:
    """A tap at each of places (k, 2): a bell of a force, filtered and sampled as a measurement would be.

    noise_db: how far the noise lies below each sensor's rms over the first 40 ms of the tap; None: no noise.
    place_error_m: standard deviation, along x and y, of the places that the taps are said to be at.
    """
    taps, places = [], np.atleast_2d(places_m)
    t_s = np.arange(round(duration_s * rate_Hz) * FINER) / (FINER * rate_Hz) - SILENCE_s
    for k, place in enumerate(places):
        share = np.clip(t_s / rng.uniform(*DURATION_s), 0, 1)
        force = rng.uniform(*PEAK_N) * np.sin(np.pi * share) ** 1.5 * (share < 1)
        acceleration = resample_poly(plate.response(force[None], place[None], FINER * rate_Hz), 1, FINER, axis=1)
        measured = resample_poly((force + np.roll(force, 1)) / 2, 1, FINER)  # at the instants, not over the steps
        if noise_db is not None:
            first = round(SILENCE_s * rate_Hz)
            rms = np.sqrt(np.mean(acceleration[:, first:first + round(0.04 * rate_Hz)] ** 2, axis=1, keepdims=True))
            acceleration = acceleration + rms * 10 ** (-noise_db / 20) * rng.standard_normal(acceleration.shape)
        said = place + place_error_m * rng.standard_normal(2)
        taps.append(Tap(said, acceleration, rate_Hz, measured if force_known else None, f"tap {k + 1}"))
    return taps
