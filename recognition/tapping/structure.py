"""The response of a plate to a tap, and its derivatives by all that taps may teach.

The plate is described in the modes of the plate that it is thought to be. In them its stiffness is
Omega (1 + 2 S) Omega with a small symmetric S, whose diagonal shifts the frequencies and whose other elements mix
neighbouring modes; so a square plate's double modes may turn as they like. With
Z(s) = Omega (1 + 2 S) Omega + s C + s^2 the acceleration of sensor i under the force F at place p is

    a_i(s) = -s^2 g_i phi_i^T Z(s)^-1 phi_p F(s)

S, the damping C = diag(2 zeta omega), the gains g and small shifts of sensors and places are fitted.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recognition.estimation.arrays import Floats, Integers
from recognition.plate.plate_model import SLOPES, PlateModel

COUPLED = 0.15  # modes mix whose frequencies differ by less than this share


@dataclass(frozen=True)
class Parameters:
    """coupling (p,): S of each pair of `Structure.pairs`; log_damping (m,): of the damping over the starting one;
    log_gain (s,); sensor_shift_m (s, 2). All are zero for the plate that it is thought to be."""

    coupling: Floats
    log_damping: Floats
    log_gain: Floats
    sensor_shift_m: Floats


@dataclass(frozen=True)
class Structure:
    """A plate about which parameters are varied."""

    plate: PlateModel

    @cached_property
    def pairs(self) -> tuple[Integers, Integers]:
        """Numbers (p,) of either mode of each pair that may mix; first each mode with itself."""
        f = self.plate.frequency_Hz
        own = np.arange(f.size)
        first, second = np.triu_indices(f.size, 1)
        near = (abs(f[first] - f[second]) < COUPLED * np.minimum(f[first], f[second])) & (f[first] > 0)
        return np.concatenate([own, first[near]]), np.concatenate([own, second[near]])

    @property
    def sizes(self) -> list[int]:
        """Of the fields of `Parameters`."""
        sensors = len(self.plate.sensor_names)
        return [self.pairs[0].size, self.plate.frequency_Hz.size, sensors, 2 * sensors]

    def parameters(self, vector: Floats) -> Parameters:
        """From their numbers (sum of `sizes`,), field by field."""
        coupling, log_damping, log_gain, shift_m = np.split(vector, np.cumsum(self.sizes)[:-1])
        return Parameters(coupling, log_damping, log_gain, shift_m.reshape(-1, 2))

    def slopes(self, points_m: Floats) -> Floats:
        """(k, 2, m): slopes of the shapes along x and y at points (k, 2)."""
        return np.stack([self.plate.shape(points_m[:, 0], points_m[:, 1], slope) for slope in SLOPES], axis=1)

    @cached_property
    def sensor_slopes(self) -> Floats:
        return self.slopes(self.plate.sensor_m)

    def stiffness(self, coupling: Floats) -> Floats:
        """(m, m), 1/s^2."""
        omega = 2 * np.pi * self.plate.frequency_Hz
        s = np.zeros((omega.size, omega.size))
        s[self.pairs] = coupling
        s = s + s.T - np.diag(np.diag(s))
        return np.asarray(omega[:, None] * (np.eye(omega.size) + 2 * s) * omega, float)

    def damping(self, log_damping: Floats) -> Floats:
        """(m,), 1/s: the diagonal of C."""
        plate = self.plate
        return np.asarray(4 * np.pi * plate.frequency_Hz * plate.damping_ratio * np.exp(log_damping), float)

    def sensor_shape(self, parameters: Parameters) -> Floats:
        """(s, m): where the sensors are, without gains."""
        shift = np.einsum("sd,sdm->sm", parameters.sensor_shift_m, self.sensor_slopes)
        return np.asarray(self.plate.sensor_shape + shift, float)

    def motions(self, parameters: Parameters, s: np.ndarray, places: Floats) -> tuple[np.ndarray, np.ndarray]:
        """Z^-1 phi of the sensors (n, m, sensors), and of places whose shapes are (k, m): (n, m, k)."""
        own = np.arange(self.plate.frequency_Hz.size)
        z = np.empty((s.size, own.size, own.size), complex)
        z[:] = self.stiffness(parameters.coupling)
        z[:, own, own] += s[:, None] ** 2 + s[:, None] * self.damping(parameters.log_damping)
        sensors = self.sensor_shape(parameters)
        loads = np.concatenate([sensors, places]).T.astype(complex)
        found = np.linalg.solve(z, np.broadcast_to(loads, (s.size, *loads.shape)))
        return found[:, :, : len(sensors)], found[:, :, len(sensors):]

    def transfer(self, parameters: Parameters, s: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """(sensors, n): acceleration per force at a place whose motion is (n, m)."""
        shape = np.exp(parameters.log_gain)[:, None] * self.sensor_shape(parameters)
        return np.asarray(-s**2 * (shape @ motion.T))

    def derivatives(self, parameters: Parameters, s: np.ndarray, sensors: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """(sensors, n, size): of `transfer` by the numbers of the parameters; sensors, motion: of `motions`."""
        first, second = self.pairs
        omega, number = 2 * np.pi * self.plate.frequency_Hz, len(parameters.log_gain)
        scale = np.exp(parameters.log_gain)[:, None] * s**2
        share = np.where(first == second, 1.0, 2.0) * omega[first] * omega[second]
        transfer = self.transfer(parameters, s, motion)
        out = np.zeros((number, s.size, sum(self.sizes)), complex)
        p, m = first.size, omega.size
        by_damping = self.damping(parameters.log_damping) * s[:, None] * motion
        for i in range(number):
            u = sensors[:, :, i]
            pair = u[:, first] * motion[:, second] + u[:, second] * motion[:, first]
            out[i, :, :p] = scale[i][:, None] * share * pair
            out[i, :, p:p + m] = scale[i][:, None] * u * by_damping
            out[i, :, p + m + i] = transfer[i]
            at = p + m + number + 2 * i
            out[i, :, at:at + 2] = -scale[i][:, None] * (motion @ self.sensor_slopes[i].T)
        return out
