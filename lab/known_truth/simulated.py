"""Streams of stones by superposition: force histories of single stones, put on a plate at random places and times.

A stone of a stream does not feel the others: neither their ringing under it nor a stone that lies there already.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from recognition.estimation.arrays import Floats
from recognition.innovations.signatures import FINE_S, Channels, low_passed, modal_motion
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import PULSE_S, History

SILENCE_S = 0.05  # before the first stone, and after the last


@dataclass(frozen=True)
class Stream:
    """values (c, samples) at rate_Hz, with noise; truth: one row for each stone, in order of arrival."""

    values: Floats
    rate_Hz: float
    truth: pd.DataFrame


def draw_stones(histories: Sequence[History], count: int, rate_1_s: float, reach_m: float, gangue_ratio: float,
                rng: np.random.Generator) -> pd.DataFrame:
    """Arrivals of a Poisson process, places uniform over |x|, |y| < reach_m, and a history for each stone."""
    gangue = rng.random(count) < gangue_ratio
    pools = [[k for k, h in enumerate(histories) if h.gangue == g] for g in (False, True)]
    which = np.array([rng.choice(pools[int(g)]) for g in gangue])
    arrival = SILENCE_S + np.cumsum(rng.exponential(1 / rate_1_s, count))
    return stone_rows(histories, which, arrival, rng.uniform(-reach_m, reach_m, (count, 2)))


def stone_rows(histories: Sequence[History], which: np.ndarray, arrival_s: Floats, place_m: Floats) -> pd.DataFrame:
    """The table of stones with given histories, arrivals and places (n, 2)."""
    chosen = [histories[k] for k in which]
    moments = np.array([h.moments() for h in chosen])
    return pd.DataFrame({
        "t_s": arrival_s, "centre_s": arrival_s + moments[:, 1], "x_m": place_m[:, 0], "y_m": place_m[:, 1],
        "history": which, "gangue": [h.gangue for h in chosen], "radius_m": [h.radius_m for h in chosen],
        "speed_m_s": [h.speed_m_s for h in chosen], "mass_kg": [h.mass_kg for h in chosen],
        "impulse_N_s": moments[:, 0], "duration_s": moments[:, 2]})


def stream_of(plate: PlateModel, channels: Channels, histories: Sequence[History], truth: pd.DataFrame, rate_Hz: float,
              noise_db: float | None, rng: np.random.Generator, after_s: float = SILENCE_S) -> Stream:
    """The record of stones (a table of `draw_stones`) with white noise noise_db below the rms of each channel from
    the first stone to the last plus 0.02 s."""
    steps = int(np.ceil((truth["t_s"].iloc[-1] + after_s) / FINE_S))
    shape = plate.shape(truth["x_m"].to_numpy(), truth["y_m"].to_numpy())
    first_steps = np.rint(truth["t_s"].to_numpy(dtype=float) / FINE_S).astype(int)
    pulses = [histories[which].force_N[: round(4 * PULSE_S / FINE_S)] for which in truth["history"]]
    fine = np.zeros((len(channels.accelerometers) + len(channels.rods), steps))
    acceleration, amplitude = channels.observed(plate)
    for k in range(len(plate.frequency_Hz)):  # one by one: all at once need gigabytes
        force = np.zeros((1, steps))
        for pulse, first, phi in zip(pulses, first_steps, shape[:, k], strict=True):
            part = force[0, first:first + len(pulse)]
            part -= phi * pulse[: len(part)]
        mode = plate.frequency_Hz[k:k + 1], plate.damping_ratio[k:k + 1]
        fine += acceleration[:, k:k + 1] * modal_motion(*mode, force, FINE_S)
        if channels.rods:
            fine += amplitude[:, k:k + 1] * modal_motion(*mode, force, FINE_S, amplitude=True)
    values = low_passed(fine, round(1 / (FINE_S * rate_Hz)))
    if noise_db is not None:
        first, last = (int(t * rate_Hz) for t in (truth["t_s"].iloc[0], truth["t_s"].iloc[-1] + 0.02))
        rms = np.sqrt(np.mean(values[:, first:last] ** 2, axis=1))
        values = values + rng.standard_normal(values.shape) * (rms * 10 ** (-noise_db / 20))[:, None]
    return Stream(values, rate_Hz, truth)


def scattered(plate: PlateModel, frequency_sd: float, rng: np.random.Generator) -> PlateModel:
    """The plate with every frequency off by a normal error of relative size frequency_sd, and known to be so."""
    factor = 1 + frequency_sd * rng.standard_normal(len(plate.frequency_Hz))
    return replace(plate, frequency_Hz=plate.frequency_Hz * factor,
                   frequency_sd=np.full(len(factor), frequency_sd))
