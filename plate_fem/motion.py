"""Exact motion of the modes under forces that are constant or linear in time over each interval.

Each mode obeys q'' + 2 zeta omega q' + omega^2 q = f. About the particular solution of a linear force,
(q, y = q' + zeta omega q) turns by omega_d h and shrinks by exp(-zeta omega h). The turn is done as three
shears: whatever their rounded factors, their product has determinant one and stays a rotation of a
slightly different ellipse, so that energy cannot drift however many steps are taken.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg


@dataclass(frozen=True)
class _Turn:
    """Free motion of all modes over one length of time; arrays (n,), scratch one array for products."""

    duration_s: float
    shear_q: np.ndarray
    shear_y: np.ndarray
    decay: np.ndarray
    scratch: np.ndarray

    def apply(self, q, y):
        """Turn (q, y) in place."""
        p = self.scratch
        q += np.multiply(self.shear_q, y, out=p)
        y += np.multiply(self.shear_y, q, out=p)
        q += np.multiply(self.shear_q, y, out=p)
        q *= self.decay
        y *= self.decay


def _turn(omega_d, decay_rate, duration_s):
    """Shears of the turn by omega_d * duration, taken modulo pi so that their factors stay small."""
    angle = omega_d * duration_s
    half_turns = np.rint(angle / np.pi)
    angle = np.where(half_turns == 0, angle, np.remainder(angle + np.pi / 2, np.pi) - np.pi / 2)
    rigid = omega_d == 0
    safe = np.where(rigid, 1.0, omega_d)
    shear_q = np.where(rigid, duration_s / 2, np.tan(angle / 2) / safe)
    decay = np.exp(-decay_rate * duration_s) * (1 - 2 * np.remainder(half_turns, 2))
    return _Turn(duration_s, shear_q, -omega_d * np.sin(angle), decay, np.empty_like(omega_d))


class ModalMotion:
    """State of the plate's modes, moved on in multiples of `interval_s`.

    modes: PlateModes (frequency_Hz, damping_ratio; largest_shape for `reach_m`).
    amplitude (kg^1/2 m) and rate (kg^1/2 m/s) have shape (n,); they are replaced, not changed, by a step.
    work_J is the exact work of the modal force since the start. Forces have unit N kg^-1/2.
    """

    def __init__(self, modes, interval_s):
        self._modes, self.interval_s = modes, float(interval_s)
        self._omega = 2 * np.pi * np.asarray(modes.frequency_Hz, float)
        zeta = np.asarray(modes.damping_ratio, float)
        self._decay_rate = zeta * self._omega
        self._omega_d = self._omega * np.sqrt(1 - zeta**2)
        self._rigid = np.flatnonzero(self._omega == 0)
        self._compliance = np.where(self._omega == 0, 0.0, 1 / np.where(self._omega == 0, 1.0, self._omega) ** 2)
        self._period_s = np.sqrt(self._compliance / (1 - zeta**2))  # per radian; zero for rigid-body modes
        self._turns = {}
        self.amplitude, self.rate = np.zeros_like(self._omega), np.zeros_like(self._omega)
        self.work_J, self._start_J = 0.0, 0.0

    def advance(self, force, intervals=1):
        """Move over `intervals` * interval_s under a constant modal force (n,)."""
        before = self.amplitude
        self.amplitude, self.rate = self._constant(force, self._turn(intervals))
        self.work_J += float(force @ (self.amplitude - before))

    def predict(self, force):
        """(amplitude, rate) one interval later under a constant modal force (n,); the state stays."""
        return self._constant(force, self._turn(1))

    def advance_linear(self, force_start, force_end):
        """Move over one interval under a modal force going linearly from force_start to force_end (n,)."""
        h, difference = self.interval_s, np.asarray(force_end) - force_start
        start = np.stack([self.amplitude, self.rate * h, force_start * h**2, difference * h**2])
        before = self.amplitude
        self.amplitude, rate, mean_minus_start = (self._linear_coefficients * start).sum(axis=1)
        self.rate = rate / h
        # integral of f q' = [f q] - f' * integral of q
        self.work_J += float(force_end @ (self.amplitude - before) - difference @ mean_minus_start)

    @cached_property
    def _linear_coefficients(self):
        """(3, 4, n): from (q, h q', h^2 f, h^2 (f_end - f)) at the start to q and h q' at the end, and to
        the mean of q over the interval less q at the start.

        Exponential of the equations in the time t / h, for (q, h q', h^2 f, its slope, integral of q).
        """
        h, n = self.interval_s, len(self._omega)
        matrix = np.zeros((n, 5, 5))
        matrix[:, 0, 1] = matrix[:, 1, 2] = matrix[:, 2, 3] = matrix[:, 4, 0] = 1.0
        matrix[:, 1, 0] = -((self._omega * h) ** 2)
        matrix[:, 1, 1] = -2 * self._decay_rate * h
        end = scipy.linalg.expm(matrix)[:, [0, 1, 4], :4]
        end[:, 2, 0] -= 1.0
        return np.moveaxis(end, 0, -1).copy()

    def acceleration(self, force):
        """Modal accelerations (n,) at this instant under a modal force (n,)."""
        return force - 2 * self._decay_rate * self.rate - self._omega**2 * self.amplitude

    def reach_m(self, amplitude, rate):
        """Upper bound for |w| anywhere on the plate, at any later time of free motion from (amplitude, rate).

        Sum over modes of largest deflection times the envelope of the decaying oscillation; infinite
        if a rigid-body mode moves.
        """
        if len(self._rigid) and rate[self._rigid].any():
            return np.inf
        other = (rate + self._decay_rate * amplitude) * self._period_s
        return float(self._modes.largest_shape @ np.hypot(amplitude, other))

    @property
    def kinetic_J(self):
        return 0.5 * float(self.rate @ self.rate)

    @property
    def internal_J(self):
        """Strain energy of plate and rods."""
        w = self._omega * self.amplitude
        return 0.5 * float(w @ w)

    @property
    def total_J(self):
        return self.kinetic_J + self.internal_J

    @property
    def damped_J(self):
        """Energy taken by modal damping: the work done less the energy that is still there (exact)."""
        return self.work_J + self._start_J - self.total_J

    def get_state(self):
        """Copy of the state, a dict of arrays, for `set_state`."""
        ledger = np.array([self.work_J, self._start_J])
        return {"amplitude": self.amplitude.copy(), "rate": self.rate.copy(), "ledger_J": ledger}

    def set_state(self, state):
        """Take a state from `get_state`; without its "ledger_J" the ledger starts anew at this state."""
        amplitude, rate = (np.array(state[name], float) for name in ("amplitude", "rate"))
        if amplitude.shape != self._omega.shape or rate.shape != self._omega.shape:
            raise ValueError(f"state of {amplitude.shape} modes for a plate of {self._omega.shape}")
        self.amplitude, self.rate = amplitude, rate
        self.work_J, self._start_J = (float(v) for v in state.get("ledger_J", (0.0, self.total_J)))

    def _turn(self, intervals):
        if intervals not in self._turns:
            if intervals < 1:
                raise ValueError(f"intervals = {intervals}: must be at least 1")
            self._turns[intervals] = _turn(self._omega_d, self._decay_rate, intervals * self.interval_s)
        return self._turns[intervals]

    def _free(self, q, v, turn):
        """Free motion; q and v are this method's to change."""
        v += np.multiply(self._decay_rate, q, out=turn.scratch)
        turn.apply(q, v)
        v -= np.multiply(self._decay_rate, q, out=turn.scratch)
        return q, v

    def _constant(self, force, turn):
        static = force * self._compliance
        q, v = self._free(self.amplitude - static, self.rate.copy(), turn)
        q += static
        if len(self._rigid):
            r, h = self._rigid, turn.duration_s
            q[r] += force[r] * h**2 / 2
            v[r] += force[r] * h
        return q, v
