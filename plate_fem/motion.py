"""Exact motion of the modes under forces that are constant over each interval.

Each mode obeys q'' + 2 zeta omega q' + omega^2 q = f. In free motion over a time h the pair of q and
y = q' + zeta omega q turns by omega_d h and shrinks by exp(-zeta omega h); what a force adds is linear in the force.
The turn is done as three shears. Whatever their rounded factors, their product has determinant one and stays a rotation
of a slightly different ellipse, so that energy cannot drift however many steps are taken.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile

import numpy as np

from common.files.whole import written_whole
from common.tables import InputError
from plate_fem.modes import AT_ONCE, PlateModes

ANYWHERE_m = 1e9  # reach of a plate that nothing holds


@dataclass(frozen=True)
class _Turn:
    """Motion of all modes over one length of time, as arrays (n,).

    What a constant unit force adds to amplitude and rate is `unit_response` (2, n).
    """

    shear_q: np.ndarray
    shear_y: np.ndarray
    decay: np.ndarray
    decay_rate: np.ndarray
    unit_response: np.ndarray

    def free(self, state: np.ndarray) -> np.ndarray:
        """Return amplitude and rate (2, n) after free motion from `state` (2, n)."""
        end = state.copy()
        q, y = end
        y += self.decay_rate * q
        q += self.shear_q * y
        y += self.shear_y * q
        q += self.shear_q * y
        end *= self.decay
        y -= self.decay_rate * q
        return end


def _turn(omega: np.ndarray, omega_d: np.ndarray, decay_rate: np.ndarray, duration_s: float) -> _Turn:
    """Return the turn by omega_d * duration, an angle taken modulo pi so that the factors of the shears stay small."""
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

    Amplitude (kg^1/2 m) and rate (kg^1/2 m/s) have shape (n,). A step gives new arrays and leaves the old ones as
    they are. Modal forces have unit N kg^-1/2; `work_J` is the exact work of the modal force since the start. Raises
    InputError for an interval that is not above 0, modes that do not oscillate, and for forces and states that are not
    finite.

    >>> modes = plate_modes(read_plate("scenes/small.toml").model_copy(update={"max_frequency_Hz": 500.0}))
    >>> motion = ModalMotion(modes, interval_s=1e-5)
    >>> motion.advance(-100.0 * modes.shape_at([[0.1, 0.0]])[0], intervals=50)  # 100 N downwards for 0.5 ms
    >>> motion.work_J > 0 > float(modes.mean_shape @ motion.rate)
    True
    """

    ROWS = 128  # the most states that `advance_rows` finds at once

    def __init__(self, modes: PlateModes, interval_s: float) -> None:
        if not 0 < interval_s < math.inf:
            raise InputError(f"interval_s = {interval_s:g}: must be above 0 and finite")
        self._modes, self.interval_s = modes, float(interval_s)
        self._omega = 2 * np.pi * np.asarray(modes.frequency_Hz, float)
        zeta = np.asarray(modes.damping_ratio, float)
        if not ((zeta >= 0) & (zeta < 1)).all():
            raise InputError("damping_ratio: must be from 0 to below 1 for every mode")
        self._decay_rate = zeta * self._omega
        self._omega_d = self._omega * np.sqrt(1 - zeta**2)
        self._rigid = np.flatnonzero(self._omega == 0)
        self._flexibility = np.where(self._omega == 0, 0.0, 1 / np.where(self._omega == 0, 1.0, self._omega**2))  # s^2
        rigid = self._omega_d == 0
        self._period_s = np.where(rigid, 0.0, 1 / np.where(rigid, 1.0, self._omega_d))  # per radian
        self._turns: dict[int, _Turn] = {}
        self._powers: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._state = np.zeros((2, len(self._omega)))
        # Number of intervals, and the state after as long a free motion: `predict` finds it, `advance` uses it again.
        self._free_end: tuple[int, np.ndarray] | None = None
        self.work_J, self._start_J = 0.0, 0.0

    @property
    def state(self) -> np.ndarray:
        """Amplitude and rate (2, n)."""
        return self._state

    @property
    def amplitude(self) -> np.ndarray:
        return self._state[0]

    @property
    def rate(self) -> np.ndarray:
        return self._state[1]

    def advance(self, force: np.ndarray, intervals: int = 1) -> None:
        """Move over `intervals` * interval_s under a constant modal force (n,)."""
        self._move_to(self.predict(force, intervals), force)

    def predict(self, force: np.ndarray, intervals: int = 1) -> np.ndarray:
        """Return amplitude and rate (2, n) `intervals` later under a constant modal force (n,); the state stays."""
        turn = self._turn(intervals)
        if self._free_end is None or self._free_end[0] != intervals:
            self._free_end = (intervals, turn.free(self._state))
        return self._free_end[1] + turn.unit_response * force

    def advance_rows(self, force: np.ndarray, intervals: int, count: int) -> np.ndarray:
        """Return amplitude and rate (count, 2, n) after 1, 2, ... `count` times `intervals`, under a constant force.

        The modal force has shape (n,); count is at most ROWS. The motion then stands at the last of these states. About
        the static deflection each mode moves freely, by powers of exp((-zeta omega + i omega_d) h): as exact as
        `advance`, at a fraction of its cost.
        """
        if intervals not in self._powers:
            h = np.arange(1, self.ROWS + 1)[:, None] * (intervals * self.interval_s)
            self._powers[intervals] = np.exp(h * (-self._decay_rate + 1j * self._omega_d)), h
        power, h = (values[:count] for values in self._powers[intervals])
        rest = force * self._flexibility
        q, r = self.amplitude - rest, self.rate
        # q(t) = Re(c exp(..)); its derivative is y - zeta omega q with y = -Im(omega_d c exp(..))
        start = np.empty(len(q), complex)
        start.real, start.imag = q, 0.0 - (r + self._decay_rate * q) * self._period_s
        turned = power * start
        states = np.empty((count, 2, len(q)))
        states[:, 0] = turned.real + rest
        states[:, 1] = -self._omega_d * turned.imag - self._decay_rate * turned.real
        if len(self._rigid):
            pushed = force[self._rigid]
            states[:, 0, self._rigid] = q[self._rigid] + h * r[self._rigid] + h**2 / 2 * pushed
            states[:, 1, self._rigid] = r[self._rigid] + h * pushed
        self._move_to(states[-1], force)
        return states

    def acceleration_at(self, amplitude: np.ndarray, rate: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the modal accelerations (..., n) for amplitude, rate and modal force (..., n)."""
        return force - 2 * self._decay_rate * rate - self._omega**2 * amplitude

    def reach_m(self, amplitude: np.ndarray, rate: np.ndarray) -> float:
        """Return an upper bound for |w| anywhere on the plate, at any later time of free motion from (amplitude, rate).

        It is the sum over the modes of the largest deflection times the envelope of the decaying oscillation, and
        ANYWHERE_m if a rigid-body mode moves.
        """
        if len(self._rigid) and rate[self._rigid].any():
            return ANYWHERE_m
        other = (rate + self._decay_rate * amplitude) * self._period_s
        return float(self._modes.largest_shape @ np.sqrt(amplitude * amplitude + other * other))

    def energies_at(self, amplitude: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return kinetic and strain energy (...,) of plate and rods in J, for amplitude and rate (..., n)."""
        return 0.5 * (rate**2).sum(axis=-1), 0.5 * ((self._omega * amplitude) ** 2).sum(axis=-1)

    @property
    def energies(self) -> tuple[float, float]:
        """Kinetic and strain energy of plate and rods, in J."""
        kinetic, internal = self.energies_at(*self._state)
        return float(kinetic), float(internal)

    @property
    def damped_J(self) -> float:
        """Energy taken by modal damping: the work done less the energy that is still there (exact)."""
        return self.work_J + self._start_J - sum(self.energies)

    def get_state(self) -> dict[str, np.ndarray]:
        """Return a copy of the state, for `set_state`."""
        ledger = np.array([self.work_J, self._start_J])
        return {"amplitude": self.amplitude.copy(), "rate": self.rate.copy(), "ledger_J": ledger}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Take a state from `get_state`; without its "ledger_J" the sums of energy start anew at this state.

        Raises ValueError for a state of another number of modes.
        """
        amplitude, rate = (np.asarray(state[name], float) for name in ("amplitude", "rate"))
        if amplitude.shape != self._omega.shape or rate.shape != self._omega.shape:
            raise ValueError(f"state of {amplitude.shape} modes for a plate of {self._omega.shape}")
        if not (np.isfinite(amplitude).all() and np.isfinite(rate).all()):
            raise InputError("state: amplitude and rate must be finite")
        self._state, self._free_end = np.stack([amplitude, rate]), None
        self.work_J, self._start_J = (float(v) for v in state.get("ledger_J", (0.0, sum(self.energies))))

    def _turn(self, intervals: int) -> _Turn:
        if intervals not in self._turns:
            if intervals < 1:
                raise ValueError(f"intervals = {intervals}: must be at least 1")
            duration_s = intervals * self.interval_s
            self._turns[intervals] = _turn(self._omega, self._omega_d, self._decay_rate, duration_s)
        return self._turns[intervals]

    def _move_to(self, state: np.ndarray, force: np.ndarray) -> None:
        work_J = self.work_J + float(force @ (state[0] - self.amplitude))
        if not math.isfinite(work_J):  # as a force is that is not: to look at all of them would take longer
            raise InputError("force: must be finite, as what it moves must be")
        self._state, self._free_end, self.work_J = state, None, work_J


def pulse_response(modes: PlateModes, step_s: float, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return amplitude, rate and acceleration (count, n) of every mode under a unit modal force from 0 to step_s.

    They are exact. Rows belong to the times 0, step_s, 2 step_s ...; units are those of `ModalMotion` per N kg^-1/2. At
    0 and at step_s, where the force jumps, the acceleration is the mean of both sides. Raises InputError for a step
    that is not above 0, and fewer than 2 rows.

    >>> modes = plate_modes(read_plate("scenes/small.toml").model_copy(update={"max_frequency_Hz": 500.0}))
    >>> amplitude, rate, acceleration = pulse_response(modes, step_s=1e-4, count=200)
    >>> amplitude.shape == (200, modes.frequency_Hz.size)
    True
    """
    if count < 2:
        raise InputError(f"count = {count}: must be at least 2")
    motion = ModalMotion(modes, step_s)
    n = len(modes.frequency_Hz)
    states = np.zeros((count, 2, n))
    motion.advance(np.ones(n))
    states[1] = motion.amplitude, motion.rate
    for start in range(2, count, motion.ROWS):
        rows = min(motion.ROWS, count - start)
        states[start:start + rows] = motion.advance_rows(np.zeros(n), 1, rows)
    force = np.zeros((count, 1))
    force[:2] = 0.5
    amplitude, rate = states[:, 0], states[:, 1]
    return amplitude, rate, motion.acceleration_at(amplitude, rate, force)


FILE = "modes.npz"
LEFT_OUT = ("surface_stress", "lateral")  # large, and no part of the motion upwards
KINDS = {"u_m": "displacement", "v_m_s": "velocity", "a_m_s2": "acceleration"}


@dataclass(frozen=True)
class RecordedMotion:
    """amplitude, rate, force (k, n) of n modes at times t_s (k,): modal amplitude, its rate and the modal force."""

    modes: PlateModes
    t_s: np.ndarray
    amplitude: np.ndarray
    rate: np.ndarray
    force: np.ndarray

    def write(self, file: Path) -> None:
        """Write with single precision, packed a little, as quickly as it can be."""
        of_modes = {f"modes_{one.name}": getattr(self.modes, one.name) for one in fields(PlateModes)
                    if one.name not in LEFT_OUT}
        kept: dict[str, Any] = {"t_s": self.t_s, "amplitude": self.amplitude, "rate": self.rate, "force": self.force}
        with written_whole(file) as beside, ZipFile(beside, "w", ZIP_DEFLATED, compresslevel=1) as packed:
            for name, value in {**kept, **of_modes}.items():
                with packed.open(f"{name}.npy", "w", force_zip64=True) as stream:
                    np.lib.format.write_array(stream, np.asarray(_packed(value)))

    @classmethod
    def read(cls, directory: str | Path) -> Self:
        """Of a run directory. Raises InputError."""
        file = Path(directory) / FILE
        try:
            with np.load(file, allow_pickle=False) as kept:
                values = {name: _unpacked(kept[name]) for name in kept.files}
            of_modes: dict[str, Any] = {name.removeprefix("modes_"): values.pop(name)[()] for name in tuple(values)
                                        if name.startswith("modes_")}
            return cls(PlateModes(surface_stress=np.empty(0), **of_modes), **values)
        except FileNotFoundError:
            raise InputError(f"{file}: no such file; needs the directory of a run with a flexible plate") from None
        except (OSError, ValueError, KeyError, TypeError, BadZipFile) as error:
            raise InputError(f"{file}: not what a run writes ({' '.join(str(error).split())})") from None

    def deflection_m(self, from_mean_plane: bool, least_m: float) -> float:
        """The largest deflection of a node from rest or, of a plate that may move as a whole, from its mean plane; 0
        where none is above least_m."""
        plane = np.column_stack([np.ones(len(self.modes.node_m)), self.modes.node_m]) * from_mean_plane
        to_plane, shape = np.linalg.pinv(plane), self.modes.shape
        some = [slice(k, k + AT_ONCE) for k in range(0, shape.shape[1], AT_ONCE)]  # all at once may fill much memory

        def bent(modes: slice) -> np.ndarray:
            own = np.asarray(shape[:, modes], float)
            return own - plane @ (to_plane @ own)

        most = np.concatenate([abs(bent(modes)).max(axis=0) for modes in some])
        far = np.asarray(self.amplitude[abs(self.amplitude) @ most > least_m], float)
        blocks = (far[k:k + ModalMotion.ROWS] for k in range(0, len(far), ModalMotion.ROWS))
        largest_m = max((float(abs(sum(bent(modes) @ block[:, modes].T for modes in some)).max()) for block in blocks),
                        default=0.0)
        return largest_m if largest_m > least_m else 0.0

    def at(self, points_m: Sequence[Sequence[float]]) -> dict[str, np.ndarray]:
        """Vertical displacement u_m, velocity v_m_s and acceleration a_m_s2 (k, points), upwards, at points (x, y) of
        the plate. Raises InputError for another point."""
        shape = self.modes.shape_at(points_m).T
        amplitude, rate, force = (np.asarray(one, float) for one in (self.amplitude, self.rate, self.force))
        acceleration = ModalMotion(self.modes, 1.0).acceleration_at(amplitude, rate, force)
        return dict(zip(KINDS, (amplitude @ shape, rate @ shape, acceleration @ shape), strict=True))


def _packed(value: Any) -> Any:
    """Modes first, each of which is smooth, and in single precision; lines of the mesh and numbers as they are."""
    if not isinstance(value, np.ndarray) or value.ndim < 2:
        return value
    return np.ascontiguousarray(np.moveaxis(value, -1, 0), np.float32)


def _unpacked(value: np.ndarray) -> np.ndarray:
    return np.moveaxis(value, 0, -1) if value.ndim > 1 else value
