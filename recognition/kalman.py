"""Kalman filtering of plate responses and fusion of several into one (Section V-B), by filterpy.

The paper names neither its state model nor its covariances. The model here is the
plainest that does what its figures describe (smaller and slower fluctuation):

    x_k = x_(k-1) + w,  w ~ N(0, q)          the response as a random walk
    y_k = [1 ... 1]^T x_k + v,  v ~ N(0, r I)  m normalised responses, each measuring it

With m = 1 it filters one response, with m > 1 it fuses them. Only q / r matters:
the answer scales with the signal, and the filter needs no unit.
"""

from __future__ import annotations

import numpy as np

#: q / r. The steady gain is then 0.27 for one signal (a time constant of about three
#: samples, 0.5 ms at 6667 Hz) and 0.41 in total for three. An assumption: the paper gives none.
PROCESS_TO_MEASUREMENT = 0.1


def kalman_filter(signal: np.ndarray, process_to_measurement: float = PROCESS_TO_MEASUREMENT) -> np.ndarray:
    """Filter one response, shape (n,); same unit and shape."""
    return fuse(np.asarray(signal, dtype=float)[None, :], process_to_measurement)


def fuse(signals: np.ndarray, process_to_measurement: float = PROCESS_TO_MEASUREMENT) -> np.ndarray:
    """Fuse m normalised responses, shape (m, n), into one estimate, shape (n,).

    Starts at the mean of the first samples with variance r / m, as measured.
    """
    from filterpy.kalman import KalmanFilter  # late: it pulls matplotlib

    signals = np.asarray(signals, dtype=float)
    count, samples = signals.shape
    kalman = KalmanFilter(dim_x=1, dim_z=count)
    kalman.x = np.array([[signals[:, 0].mean()]])
    kalman.P = np.array([[1.0 / count]])
    kalman.F = np.eye(1)
    kalman.H = np.ones((count, 1))
    kalman.Q = np.array([[process_to_measurement]])
    kalman.R = np.eye(count)
    fused = np.empty(samples)
    fused[0] = kalman.x[0, 0]
    for k in range(1, samples):
        kalman.predict()
        kalman.update(signals[:, k, None])
        fused[k] = kalman.x[0, 0]
    return fused
