"""What a record says beyond the ringing that was there before: the innovations of a steady Kalman filter.

The state are amplitude and rate of every mode. Between stones they move freely, but the modes' frequencies are known
only so well: over a time 1/(w sd) the phase of a mode is lost. The filter counts that as noise on its state, of the
mode's mean energy in the record. The filter then forgets ringing no faster than the plate's model loses it, and what it
cannot predict, the innovations, is nearly white between stones. All later steps work on innovations of unit covariance.

Where the sensors' noise is coloured, it is made white first, by z[t] = sum_k W_k y[t - k] (coloured_noise.py). A mode
that moves freely, x[t] = F x[t - 1], is seen in z by C' = sum_k W_k C F^-k: the state needs no more numbers.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_discrete_are, solve_triangular

from recognition.estimation.arrays import Floats
from recognition.innovations.coloured_noise import SensorNoise
from recognition.innovations.signatures import Channels
from recognition.plate.plate_model import PlateModel

#: Of the filter's response; later than this it has forgotten a sample.
MEMORY_S = 0.1
#: A mode loses its phase by at least this share of a radian per radian, however well its frequency is known.
LEAST_PHASE_LOSS = 1e-4


@dataclass(frozen=True)
class Whitening:
    """Linear filter from channels to innovations of unit covariance: response (c, c, taps), in 1/unit of a channel."""

    response: Floats

    @classmethod
    def of(cls, plate: PlateModel, channels: Channels, rate_Hz: float, noise: SensorNoise, rms: Floats,
           phase_loss: float = 1.0) -> Self:
        """The filter for channels whose signal has an rms (c,) where the noise was made white.

        phase_loss: factor on the rate at which the modes lose their phase.
        """
        kept = (plate.frequency_Hz > 0) & (plate.frequency_Hz < 0.55 * rate_Hz)
        w, zeta = 2 * np.pi * plate.frequency_Hz[kept], plate.damping_ratio[kept]
        step = _free_motion(w, zeta, 1 / rate_Hz)
        observed = _seen(_observation(plate, channels, kept, w, zeta), noise.filter, step)
        energy = _rate_variance(observed, w, zeta, rms)
        loss = phase_loss * np.maximum(plate.frequency_sd[kept], LEAST_PHASE_LOSS) * w / rate_Hz
        drive = np.concatenate([loss * energy / w**2, loss * energy])
        taps = round(MEMORY_S * rate_Hz)
        return cls(_in_turn(noise.filter.transpose(1, 2, 0), _innovation_filter(step, observed, drive, taps)))

    def then(self, noise: SensorNoise) -> "Whitening":
        """This filter, and then what makes such noise of its innovations white."""
        return Whitening(_in_turn(self.response, noise.filter.transpose(1, 2, 0)))

    def __call__(self, values: Floats) -> Floats:
        """Innovations (c, samples) of channels (c, samples) from rest on."""
        return self.after(np.zeros((len(values), 0)), values)

    def after(self, before: Floats, values: Floats) -> Floats:
        """Innovations (c, samples) of channels (c, samples) after others (c, any), the last MEMORY_S of which count."""
        taps, n, out = self.response.shape[-1], values.shape[-1], np.empty_like(values)
        rows = np.hstack([np.zeros((len(values), taps)), before, values])[:, -taps - n:]
        for first in range(0, n, taps):
            spectrum = np.fft.rfft(rows[:, first:first + 2 * taps], 2 * taps)
            part = np.fft.irfft(np.einsum("dck,ck->dk", self._spectrum, spectrum), 2 * taps)
            out[:, first:first + taps] = part[:, taps:taps + n - first]
        return out

    @cached_property
    def _spectrum(self) -> NDArray[np.complex128]:
        return np.asarray(np.fft.rfft(self.response, 2 * self.response.shape[-1]))


def _in_turn(first: Floats, then: Floats) -> Floats:
    """(c, c, taps): response of two filters (c, c, any), as long as the longer one."""
    taps = max(first.shape[-1], then.shape[-1])
    spectrum = np.fft.rfft(then, 2 * taps), np.fft.rfft(first, 2 * taps)
    return np.asarray(np.fft.irfft(np.einsum("dek,eck->dck", *spectrum), 2 * taps)[..., :taps])


def _free_motion(w: Floats, zeta: Floats, step_s: float) -> Floats:
    """Transition (2n, 2n) of amplitudes and rates over a step."""
    wd, decay = w * np.sqrt(1 - zeta**2), np.exp(-zeta * w * step_s)
    c, s = np.cos(wd * step_s), np.sin(wd * step_s)
    q_q, q_v = decay * (c + zeta * w / wd * s), decay * s / wd
    v_q, v_v = -decay * w * w / wd * s, decay * (c - zeta * w / wd * s)
    return np.block([[np.diag(q_q), np.diag(q_v)], [np.diag(v_q), np.diag(v_v)]])


def _observation(plate: PlateModel, channels: Channels, kept: np.ndarray, w: Floats, zeta: Floats) -> Floats:
    """Channels (c, 2n) of amplitudes and rates."""
    acceleration, amplitude = (values[:, kept] for values in channels.observed(plate))
    return np.hstack([amplitude - acceleration * w**2, -2 * acceleration * zeta * w])


def _seen(observed: Floats, white: Floats, step: Floats) -> Floats:
    """C' (c, 2n) of C by the filter (p + 1, c, c) that whitens the noise, from the last lag on."""
    back, seen = np.linalg.inv(step), np.zeros_like(observed)
    for one in white[::-1]:
        seen = seen @ back + one @ observed
    return seen


def _rate_variance(observed: Floats, w: Floats, zeta: Floats, rms: Floats) -> Floats:
    """Variance (n,) of each mode's rate, where impacts excite all equally and the channels have an rms (c,)."""
    relative = 1 / (zeta * w) * np.exp(-(w * 40e-6) ** 2)  # a stone's force lasts about 40 us
    n = len(w)
    power = (observed[:, :n] ** 2 / w**2 + observed[:, n:] ** 2) @ relative
    return relative * float(np.exp(np.mean(np.log(rms**2 / power))))


def _innovation_filter(step: Floats, observed: Floats, drive: Floats, taps: int) -> Floats:
    """Response (c, c, taps) from channels of unit noise to innovations of unit covariance."""
    c = len(observed)
    covariance = solve_discrete_are(step.T, observed.T, np.diag(drive), np.eye(c))
    spread = observed @ covariance @ observed.T + np.eye(c)
    gain = step @ np.linalg.solve(spread, observed @ covariance).T
    closed = step - gain @ observed
    response = np.zeros((c, c, taps))
    response[:, :, 0], state = np.eye(c), gain
    for k in range(1, taps):
        response[:, :, k] = -observed @ state
        state = closed @ state
    return np.asarray(solve_triangular(cholesky(spread, lower=True), response.reshape(c, -1), lower=True)
                      ).reshape(c, c, taps)
