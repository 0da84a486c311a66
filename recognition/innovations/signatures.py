"""Response of the plate's modes to the force of one stone, sampled as the record is.

The plate is a set of oscillators, q'' + 2 zeta w q' + w^2 q = f, with w = 2 pi frequency. They are integrated exactly
under a force that is constant over steps of FINE_S, and then pass the low pass that the record passed when it was
sampled (scipy's polyphase filter, as in analysis.signals.resampling).
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter, resample_poly

from analysis.signals.resampling import low_pass
from recognition.estimation.arrays import Floats
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import StoneForces

Floats32: TypeAlias = NDArray[np.float32]
FINE_S = 5e-6
#: Durations for which the responses are tabulated; between them and between the arrivals they are interpolated.
DURATIONS_S = np.geomspace(14e-6, 90e-6, 18)
LEAD = 12  # samples of a signature before the centre of the force: half its length, and the low pass


@dataclass(frozen=True)
class Channels:
    """Which signals of a plate are recorded: accelerometers and rods by number."""

    accelerometers: tuple[int, ...]
    rods: tuple[int, ...] = ()

    def observed(self, plate: PlateModel) -> tuple[Floats, Floats]:
        """Factors of the modes' accelerations and amplitudes in the channels, (channels, n) each."""
        a, r = list(self.accelerometers), list(self.rods)
        shape, rods = plate.sensor_shape[a], plate.rod_force_N_m[r] if r else np.zeros((0, len(plate.frequency_Hz)))
        return np.vstack([shape, 0 * rods]), np.vstack([0 * shape, rods])


def modal_motion(frequency_Hz: Floats, damping_ratio: Floats, force: Floats, step_s: float,
                 amplitude: bool = False) -> Floats:
    """Acceleration, or amplitude, (n, steps) of modes (n,) under modal forces (n, steps), constant over each step."""
    out, top = np.empty_like(force), np.array([1.0] if amplitude else [1.0, 0.0, 0.0])
    for k, (f, zeta) in enumerate(zip(frequency_Hz, damping_ratio, strict=True)):
        w = 2 * np.pi * f
        b, a = cont2discrete((top, np.array([1.0, 2 * zeta * w, w * w])), step_s, "zoh")[:2]
        out[k] = lfilter(np.ravel(b), a, force[k])
    return out


def low_passed(values: Floats, factor: int) -> Floats:
    """Every factor-th sample of values (..., n) after the anti-alias filter."""
    return np.asarray(resample_poly(values, 1, factor, axis=-1))


def modal_table(plate: PlateModel, forces: StoneForces, rate_Hz: float, lags: int, amplitude: bool = False) -> Floats32:
    """Response of each mode to a unit modal impulse with a stone's form, (form, duration, phase, n, lags).

    The centre of the force is sample LEAD plus (phase - 1)/phases of a sample: phases are FINE_S apart, and the first
    and the last lie outside the sample.
    """
    factor = round(1 / (rate_Hz * FINE_S))
    steps = (lags + LEAD) * factor
    n = len(plate.frequency_Hz)
    table = np.empty((len(forces.form), len(DURATIONS_S), factor + 3, n, lags), dtype=np.float32)
    t_s: Floats = (np.arange(steps, dtype=float) + 0.5) * FINE_S
    push = np.tile(np.eye(1, steps), (n, 1))
    ring = modal_motion(plate.frequency_Hz, plate.damping_ratio, push, FINE_S, amplitude)
    taps, late = low_pass(factor)
    spectrum = np.fft.rfft(ring, 2 * steps) * np.fft.rfft(taps, 2 * steps)
    for m, k in np.ndindex(len(forces.form), len(DURATIONS_S)):
        pulse = forces.pulse(m, float(DURATIONS_S[k]), t_s - LEAD * factor * FINE_S)
        if m == 0:
            pulse /= pulse.sum() * FINE_S
        full = np.fft.irfft(spectrum * np.fft.rfft(pulse, 2 * steps))[:, :steps + late]
        for p in range(factor + 3):  # a later force is the same, some fine steps later
            table[m, k, p] = full[:, late + 1 - p:][:, :lags * factor:factor]
    return table
