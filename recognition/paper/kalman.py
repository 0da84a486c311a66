"""Kalman filtering of plate responses and fusion of several into one (Section V-B), by filterpy.

The paper names neither its state model nor its covariances. The model here is the
plainest that does what its figures describe (smaller and slower fluctuation):

    x_k = x_(k-1) + w,  w ~ N(0, q)          the response as a random walk
    y_k = [1 ... 1]^T x_k + v,  v ~ N(0, r I)  m normalised responses, each measuring it

With m = 1 it filters one response, with m > 1 it fuses them. Only q / r matters: the
answer scales with the signal, and the filter needs no unit. It starts at the mean of the
first samples with variance r / m, as measured.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from recognition.estimation.arrays import Floats

#: q / r. The steady gain is then 0.27 for one signal (a time constant of about three
#: samples, 0.5 ms at 6667 Hz) and 0.42 in total for three. An assumption: the paper gives none.
PROCESS_TO_MEASUREMENT = 0.1


@lru_cache(maxsize=32)
def gains(count: int, samples: int, process_to_measurement: float) -> Floats:
    """Gain of each sample on each of `count` signals, shape (samples, count), by filterpy.

    Gains of a linear filter do not depend on the data: they are found once for all records.
    """
    from filterpy.kalman import KalmanFilter  # late: it pulls matplotlib

    kalman = KalmanFilter(dim_x=1, dim_z=count)
    kalman.P = np.array([[1.0 / count]])
    kalman.F = np.eye(1)
    kalman.H = np.ones((count, 1))
    kalman.Q = np.array([[process_to_measurement]])
    kalman.R = np.eye(count)
    found = np.empty((samples, count))
    found[0] = 1.0 / count
    for k in range(1, samples):
        kalman.predict()
        kalman.update(np.zeros((count, 1)))
        found[k] = kalman.K[0]
    found.flags.writeable = False
    return found


def fuse(signals: Floats, process_to_measurement: float = PROCESS_TO_MEASUREMENT) -> Floats:
    """Fuse m normalised responses into one estimate: shape (..., m, n) to (..., n).

    >>> fuse([[1.0, 1.0, 1.0], [3.0, 3.0, 3.0]]).tolist()
    [2.0, 2.0, 2.0]
    """
    signals = np.asarray(signals, dtype=float)
    count, samples = signals.shape[-2:]
    weights = gains(count, samples, float(process_to_measurement))
    measured, total = np.einsum("...mk,km->...k", signals, weights), weights.sum(axis=1)
    fused = np.empty(measured.shape)
    fused[..., 0] = measured[..., 0]
    for k in range(1, samples):
        fused[..., k] = (1.0 - total[k]) * fused[..., k - 1] + measured[..., k]
    return fused


def kalman_filter(signal: Floats, process_to_measurement: float = PROCESS_TO_MEASUREMENT) -> Floats:
    """Filter one response, shape (..., n); same unit and shape.

    >>> kalman_filter([0.0, 1.0, 1.0]).round(3).tolist()
    [0.0, 0.524, 0.707]
    """
    return fuse(np.asarray(signal, dtype=float)[..., None, :], process_to_measurement)
