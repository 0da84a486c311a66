"""Exact motion of the modes under forces that are constant or linear in time over each interval.

Each mode obeys q'' + 2 zeta omega q' + omega^2 q = f. Free, (q, y = q' + zeta omega q) turns by omega_d h and
shrinks by exp(-zeta omega h); what a force adds is linear in it. The turn is done as three
shears: whatever their rounded factors, their product has determinant one and stays a rotation of a
slightly different ellipse, so that energy cannot drift however many steps are taken.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg


@dataclass(frozen=True)
class _Turn:
    """Motion of all modes over one length of time; arrays (n,), and (2, n) for what a constant unit force adds to
    amplitude and rate."""

    shear_q: np.ndarray
    shear_y: np.ndarray
    decay: np.ndarray
    decay_rate: np.ndarray
    unit_response: np.ndarray

    def free(self, state):
        """Free motion from `state` (2, n), amplitude and rate."""
        end = state.copy()
        q, y = end
        y += self.decay_rate * q
        q += self.shear_q * y
        y += self.shear_y * q
        q += self.shear_q * y
        end *= self.decay
        y -= self.decay_rate * q
        return end


def _turn(omega, omega_d, decay_rate, duration_s):
    """Shears of the turn by omega_d * duration, taken modulo pi so that their factors stay small."""
    angle = omega_d * duration_s
    half_turns = np.rint(angle / np.pi)
    rest = np.where(half_turns == 0, angle, np.remainder(angle + np.pi / 2, np.pi) - np.pi / 2)
    rigid = omega_d == 0
    safe = np.where(rigid, 1.0, omega_d)
    shear_q = np.where(rigid, duration_s / 2, np.tan(rest / 2) / safe)
    decay = np.exp(-decay_rate * duration_s)
    # Under a unit force: (1 - decay (cos + decay_rate / omega_d sin)) / omega^2, without taking 1 from 1.
    settled = -np.expm1(-decay_rate * duration_s) + 2 * decay * np.sin(angle / 2) ** 2
    settled = (settled - decay * decay_rate / safe * np.sin(angle)) / np.where(rigid, 1.0, omega**2)
    response = np.where(rigid, [duration_s**2 / 2 + 0 * omega, duration_s + 0 * omega],
                        [settled, decay * np.sin(angle) / safe])
    sign = 1 - 2 * np.remainder(half_turns, 2)
    return _Turn(shear_q, -omega_d * np.sin(rest), decay * sign, decay_rate, response)


class ModalMotion:
    """State of the plate's modes, moved on in multiples of `interval_s`.

    modes: PlateModes (frequency_Hz, damping_ratio; largest_shape for `reach_m`).
    amplitude (kg^1/2 m) and rate (kg^1/2 m/s) have shape (n,); a step gives new arrays and leaves the old ones.
    work_J is the exact work of the modal force since the start. Forces have unit N kg^-1/2.
    """

    ROWS = 128  # found at once by `advance_rows`

    def __init__(self, modes, interval_s):
        self._modes, self.interval_s = modes, float(interval_s)
        self._omega = 2 * np.pi * np.asarray(modes.frequency_Hz, float)
        zeta = np.asarray(modes.damping_ratio, float)
        self._decay_rate = zeta * self._omega
        self._omega_d = self._omega * np.sqrt(1 - zeta**2)
        self._rigid = np.flatnonzero(self._omega == 0)
        self._flexibility = 1 / np.where(self._omega == 0, 1.0, self._omega**2)  # of each mode but the rigid ones, s^2
        rigid = self._omega_d == 0
        self._period_s = np.where(rigid, 0.0, 1 / np.where(rigid, 1.0, self._omega_d))  # per radian
        self._turns, self._powers = {}, {}
        self._state = np.zeros((2, len(self._omega)))
        self._free_end = None  # (intervals, state after as long a free motion), found by `predict` for `advance`
        self.work_J, self._start_J = 0.0, 0.0

    @property
    def amplitude(self):
        return self._state[0]

    @property
    def rate(self):
        return self._state[1]

    def advance(self, force, intervals=1):
        """Move over `intervals` * interval_s under a constant modal force (n,)."""
        before = self.amplitude
        self._move_to(self._after(force, intervals))
        self.work_J += float(force @ (self.amplitude - before))

    def predict(self, force, intervals=1):
        """(amplitude, rate) `intervals` later under a constant modal force (n,); the state stays."""
        return self._after(force, intervals)

    def advance_rows(self, force, intervals, count):
        """States (count, 2, n), amplitude and rate, after 1, 2, ... `count` times `intervals` under a constant modal force
        (n,), count at most ROWS; the motion stands at the last.

        About the static deflection each mode moves freely: powers of exp((-zeta omega + i omega_d) h), exact like
        `advance`, many rows for the price of few.
        """
        if intervals not in self._powers:
            h = np.arange(1, self.ROWS + 1)[:, None] * (intervals * self.interval_s)
            self._powers[intervals] = np.exp(h * (-self._decay_rate + 1j * self._omega_d)), h
        power, h = (values[:count] for values in self._powers[intervals])
        rest = np.where(self._omega == 0, 0.0, force * self._flexibility)
        q, r = self.amplitude - rest, self.rate
        # q(t) = Re(c exp(..)); its derivative is y - zeta omega q with y = -Im(omega_d c exp(..))
        turned = power * (q - 1j * (r + self._decay_rate * q) * self._period_s)
        states = np.empty((count, 2, len(q)))
        states[:, 0] = turned.real + rest
        states[:, 1] = -self._omega_d * turned.imag - self._decay_rate * turned.real
        pushed = force[self._rigid]
        states[:, 0, self._rigid] = q[self._rigid] + h * r[self._rigid] + h**2 / 2 * pushed
        states[:, 1, self._rigid] = r[self._rigid] + h * pushed
        self.work_J += float(force @ (states[-1, 0] - self.amplitude))
        self._move_to(states[-1])
        return states

    def advance_linear(self, force_start, force_end):
        """Move over one interval under a modal force going linearly from force_start to force_end (n,)."""
        h, difference = self.interval_s, np.asarray(force_end) - force_start
        start = np.stack([self.amplitude, self.rate * h, force_start * h**2, difference * h**2])
        before = self.amplitude
        amplitude, rate, mean_minus_start = (self._linear_coefficients * start).sum(axis=1)
        self._move_to(np.stack([amplitude, rate / h]))
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

    def acceleration_at(self, amplitude, rate, force):
        """Modal accelerations (..., n) in the state (amplitude, rate) under a modal force, each (..., n)."""
        return force - 2 * self._decay_rate * rate - self._omega**2 * amplitude

    def reach_m(self, amplitude, rate):
        """Upper bound for |w| anywhere on the plate, at any later time of free motion from (amplitude, rate).

        Sum over modes of largest deflection times the envelope of the decaying oscillation; infinite
        if a rigid-body mode moves.
        """
        if len(self._rigid) and rate[self._rigid].any():
            return np.inf
        other = (rate + self._decay_rate * amplitude) * self._period_s
        return float(self._modes.largest_shape @ np.sqrt(amplitude * amplitude + other * other))

    def energies_at(self, amplitude, rate):
        """Kinetic and strain energy (...,) in J of plate and rods in the state (amplitude, rate), each (..., n)."""
        return 0.5 * (rate**2).sum(axis=-1), 0.5 * ((self._omega * amplitude) ** 2).sum(axis=-1)

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
        amplitude, rate = (np.asarray(state[name], float) for name in ("amplitude", "rate"))
        if amplitude.shape != self._omega.shape or rate.shape != self._omega.shape:
            raise ValueError(f"state of {amplitude.shape} modes for a plate of {self._omega.shape}")
        self._move_to(np.stack([amplitude, rate]))
        self.work_J, self._start_J = (float(v) for v in state.get("ledger_J", (0.0, self.total_J)))

    def _turn(self, intervals):
        if intervals not in self._turns:
            if intervals < 1:
                raise ValueError(f"intervals = {intervals}: must be at least 1")
            duration_s = intervals * self.interval_s
            self._turns[intervals] = _turn(self._omega, self._omega_d, self._decay_rate, duration_s)
        return self._turns[intervals]

    def _after(self, force, intervals):
        """State (2, n) after `intervals` under a constant modal force: free motion and what the force adds."""
        turn = self._turn(intervals)
        if self._free_end is None or self._free_end[0] != intervals:
            self._free_end = (intervals, turn.free(self._state))
        return self._free_end[1] + turn.unit_response * force

    def _move_to(self, state):
        self._state, self._free_end = state, None
