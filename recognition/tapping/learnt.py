"""What a fit to taps has learnt: the plate, how sure each mode is, and the error that is left."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from recognition.estimation.arrays import Booleans, Floats
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.tapping.fit import BEYOND, IDENTIFIED, Fitted, Prior
from recognition.tapping.structure import Parameters
from recognition.tapping.window import BAND

DRAWS, SEED = 64, 1  # of the posterior


@dataclass(frozen=True)
class Learnt:
    """plate: with what the taps say in it. identified (m,): which modes they say something of.

    misfit, noise (s,): rms of what is left at each sensor, and of its noise before the taps, in shares of the records,
    up to highest_Hz. gain (s,): of each sensor, already in `plate.sensor_shape`; gain_sd (s,).
    """

    plate: PlateModel
    identified: Booleans
    misfit: Floats
    noise: Floats
    gain: Floats
    gain_sd: Floats
    highest_Hz: float

    @property
    def unexplained(self) -> Floats:
        """(s,): rms of what neither plate nor noise explains, in shares of the records."""
        return np.asarray(np.sqrt(np.maximum(self.misfit**2 - self.noise**2, 0.0)), float)


def learnt(fitted: Fitted, prior: Prior | None = None) -> Learnt:
    """The plate of a fit. What the fit leaves unexplained about the frequency of a mode counts as error of its shape,
    half the power each for sensor and place. Raises RecognitionError where a mode may have lost its stiffness."""
    structure, parameters = fitted.structure, fitted.state.parameters
    frequency, damping, turn = _modes(fitted, parameters)
    draws = [_matched(fitted, parameters.moved(step), turn) for step in _steps(fitted)]
    _check_stiff(structure.plate, [frequency, *(draw[0] for draw in draws)])
    off = np.stack([draw[2] - turn for draw in draws])
    plate, gram = structure.plate, _gram(structure.plate)
    rms_2 = np.einsum("jk,jl,lk->k", turn, gram, turn)
    shape_2 = np.einsum("djk,jl,dlk->k", off, gram, off) / len(draws) / rms_2
    left_2 = _unexplained(fitted, frequency)
    frequency_sd = np.sqrt(np.mean([(draw[0] / np.maximum(frequency, 1e-9) - 1) ** 2 for draw in draws], axis=0))
    frequency_sd[frequency == 0] = 0.0
    gain = np.exp(parameters.log_gain)
    modes = replace(
        plate, frequency_Hz=frequency, damping_ratio=damping, grid_shape=plate.grid_shape @ turn,
        sensor_shape=gain[:, None] * structure.sensor_shape(parameters) @ turn,
        rod_force_N_m=plate.rod_force_N_m @ turn, frequency_sd=frequency_sd,
        damping_sd=np.std([_log_ratio(draw[1], damping) for draw in draws], axis=0),
        shape_sd=np.sqrt(shape_2 + left_2 / 2))
    highest_Hz = plate.max_frequency_Hz / BEYOND
    identified = (frequency_sd < IDENTIFIED * (prior or Prior()).frequency) & (frequency < highest_Hz)
    at = structure.pairs[0].size + plate.frequency_Hz.size + np.arange(gain.size)
    return Learnt(modes, identified, *_misfit(fitted), gain, np.sqrt(np.diag(fitted.covariance)[at]), highest_Hz)


def _check_stiff(plate: PlateModel, frequencies_Hz: list[Floats]) -> None:
    elastic = np.count_nonzero(plate.frequency_Hz)
    if any(np.count_nonzero(frequency_Hz) < elastic for frequency_Hz in frequencies_Hz):
        raise RecognitionError("with these taps a mode has no stiffness; is the plate, a place or a unit another one?")


def _steps(fitted: Fitted) -> Floats:
    """(DRAWS, size): deviations of the shared parameters by their covariance."""
    values, vectors = np.linalg.eigh(fitted.covariance)
    normal = np.random.default_rng(SEED).standard_normal((DRAWS, values.size))
    return np.asarray(normal * np.sqrt(np.maximum(values, 0.0)) @ vectors.T, float)


def _modes(fitted: Fitted, parameters: Parameters) -> tuple[Floats, Floats, Floats]:
    """Frequencies (m,), damping ratios (m,) and, column by column, the modes (m, m) in terms of the starting ones."""
    structure = fitted.structure
    squares, turn = np.linalg.eigh(structure.stiffness(parameters.coupling))
    omega = np.sqrt(np.where(squares > 1e-12 * squares[-1], squares, 0.0))
    turn = turn * np.where(turn[abs(turn).argmax(axis=0), np.arange(omega.size)] < 0, -1.0, 1.0)
    damping = np.einsum("jk,j,jk->k", turn, structure.damping(parameters.log_damping), turn)
    return omega / (2 * np.pi), damping / np.where(omega > 0, 2 * omega, np.inf), turn


def _matched(fitted: Fitted, parameters: Parameters, turn: Floats) -> tuple[Floats, Floats, Floats]:
    """`_modes`, each in the place and with the sign of the one in `turn` that it is most alike."""
    frequency, damping, other = _modes(fitted, parameters)
    alike = turn.T @ other
    order = linear_sum_assignment(-abs(alike))[1]
    sign = np.sign(alike[np.arange(order.size), order])
    return frequency[order], damping[order], other[:, order] * sign


def _log_ratio(damping: Floats, other: Floats) -> Floats:
    """(m,): zero where both are, as of rigid-body modes."""
    both = (damping > 0) | (other > 0)
    return np.asarray(np.log(np.where(both, damping, 1.0) / np.where(both, other, 1.0)), float)


def _gram(plate: PlateModel) -> Floats:
    """(m, m): means over the grid of products of two shapes."""
    shapes = plate.grid_shape.reshape(-1, plate.frequency_Hz.size)
    return np.asarray(shapes.T @ shapes / len(shapes), float)


def _misfit(fitted: Fitted) -> tuple[Floats, Floats]:
    record = sum(np.sum(abs(one) ** 2, axis=1) for one in fitted.record)
    left = sum(np.sum(abs(one) ** 2, axis=1) for one in fitted.residual)
    noise = sum(power * one.shape[1] for power, one in zip(fitted.noise, fitted.record, strict=True))
    return np.sqrt(left / record), np.sqrt(noise / record)


def _unexplained(fitted: Fitted, frequency_Hz: Floats) -> Floats:
    """(m,): power of what neither fit nor noise explains about each frequency, as a share of the records' there."""
    shares = []
    for f in frequency_Hz:
        left = record = 0.0
        for r, x, noise, bins in zip(fitted.residual, fitted.record, fitted.noise, fitted.frequency_Hz, strict=True):
            near = abs(bins - min(f, bins[-1])) <= max(BAND * f, 2 * (bins[1] - bins[0]))
            left += max(float(np.sum(abs(r[:, near]) ** 2) - np.sum(noise) * near.sum()), 0.0)
            record += float(np.sum(abs(x[:, near]) ** 2))
        shares.append(left / record if record > 0 else 1.0)
    return np.array(shares)
