"""Fit of a plate to its taps: the most probable structure, by Gauss-Newton, and how sure each mode then is.

What is known beforehand are standard deviations: of the frequencies and damping of the starting plate, of gains, and of
where sensors and taps are. What the starting modes cannot explain is an error of the model, which is taken as noise of
the power that is left in the band of each frequency. Frequencies of another plate may differ the more the higher they
are, and by more than their standard deviation; so low bands are fitted first, and their trend tells where the higher
modes are sought: another thickness moves all alike, another theory of shear moves them the more the higher they are.
A force is as measured, or hats in time, where it was only a tap.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.linalg import cho_factor, cho_solve

from common.tables import Table, about
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.tapping.structure import Structure
from recognition.tapping.taps import LEAST_PERIODS, Tap, band_power, check_taps, samples_of, spectra

HAT_S = 5e-5  # distance of the hats
LASTS_S = 1.5e-3  # at most, a tap
EARLY_S = 3e-4  # before the onset as the sensors see it
LARGEST_N = 1e4  # standard deviation of a hat's height: any tap is smaller
LEAST_MODES = 6  # from which a trend is taken
SCATTERS = 2.0  # standard deviation of a mode beyond the fit, by that of the others about their trend
BEYOND = 1.25  # modes up to so many times the highest frequency of the fit are needed
STAGES_1_s = (2000.0, 800.0, 300.0, 100.0)  # alpha of the windows before the last, which the record's length sets
BANDS = (0.2, 0.3, 0.45, 0.67)  # of the highest frequency, that are fitted before the whole
IDENTIFIED = 0.3  # a mode is, where its frequency is known so many times better than before
LAST_DECAY = 5.0  # alpha times the duration of the record, in the last window
STEPS, LAST_STEPS = 4, 8  # of Gauss-Newton, in each window
ROUGH = 0.3  # error of the model as a share of the record, in all windows but the last
LEAST_ERROR = 1e-3
LEAD_S = 1e-3  # before the onset
MODES_BEYOND = 3.0  # standard deviation of the compliance of modes beyond the model
CONVERGED = 1e-3  # largest step, in standard deviations, with which a window ends


Deviation = Annotated[float, Field(ge=1e-9, le=1)]


class Prior(Table):
    """Standard deviations of what is not known beforehand. That of a frequency, divided by the root of 2, is also that
    of the mixing of two modes."""

    frequency: Annotated[Deviation, about("of a frequency, relative")] = 0.03
    damping: Annotated[Deviation, about("of the logarithm of a damping ratio")] = 0.5
    gain: Annotated[Deviation, about("of a sensor's gain, relative")] = 0.03
    place_m: Annotated[Deviation, about("of the place of a sensor or a tap along x and y")] = 1.5e-3

    def of(self, structure: Structure, scatter: float) -> Floats:
        """Standard deviations of the numbers of a structure's parameters. scatter: of frequencies about their trend,
        which is all that tells those beyond the fit: their flanks alone would have them explain other errors."""
        first, second = structure.pairs
        beyond = structure.plate.frequency_Hz > structure.plate.max_frequency_Hz / BEYOND
        frequency = np.where(beyond, min(SCATTERS * scatter, self.frequency), self.frequency)
        coupling = np.where(first == second, 1.0, np.sqrt(0.5)) * np.sqrt(frequency[first] * frequency[second])
        return np.concatenate([coupling, np.repeat([self.damping, self.gain, self.place_m], structure.sizes[1:])])


class Fit:
    """The cost of a state in one window, and its steps.

    A state is a vector: the parameters of the structure, and then of each tap the shift (2,) of its place, m; the
    compliance (s,) that modes beyond the model give at each sensor, in units of `compliance`; and, where the force was
    not measured, the heights (b,) in N of the hats whose sum it is. What is known beforehand is zero.
    """

    def __init__(self, structure: Structure, taps: Sequence[Tap], prior: Prior, alpha: float,
                 scatter: float = np.inf) -> None:
        self.structure, self.shared = structure, sum(structure.sizes)
        highest_Hz = structure.plate.max_frequency_Hz / BEYOND
        samples = samples_of(taps, LEAD_S)
        self.spectra = [spectra(tap, alpha, highest_Hz, LEAD_S, samples) for tap in taps]
        self.shapes = [structure.plate.shape(*tap.place_m[:, None]) for tap in taps]
        self.slopes = [structure.slopes(tap.place_m[None])[0] for tap in taps]
        self.hats = [_hats(found.s, _times_s(tap)) for found, tap in zip(self.spectra, taps, strict=True)]
        self._last: tuple[Floats, tuple[np.ndarray, np.ndarray]] | None = None
        end_1_s = 2 * np.pi * structure.plate.max_frequency_Hz
        self.compliance = float(np.mean(structure.plate.rms_shape**2)) / end_1_s**2  # m/N, of a mode there
        of_tap = np.repeat([prior.place_m, MODES_BEYOND], [2, len(structure.plate.sensor_names)])
        own = [np.concatenate([of_tap, np.full(hats.shape[1], LARGEST_N)]) for hats in self.hats]
        self.ends = np.cumsum([self.shared, *(one.size for one in own)])
        self.prior_sd = np.concatenate([prior.of(structure, scatter), *own])

    def of_tap(self, state: Floats, k: int) -> tuple[Floats, Floats, Floats]:
        """Shift, compliance and heights of tap k."""
        own = state[self.ends[k]:self.ends[k + 1]]
        sensors = len(self.structure.plate.sensor_names)
        return own[:2], own[2:2 + sensors], own[2 + sensors:]

    def motions(self, state: Floats) -> tuple[np.ndarray, np.ndarray]:
        """`Structure.motions` of the sensors and of every tap's shape and slopes (n, m, 3 taps), kept for the state."""
        if self._last is None or self._last[0] is not state:
            places = [np.concatenate([shape + self.of_tap(state, k)[0] @ slopes, slopes])
                      for k, (shape, slopes) in enumerate(zip(self.shapes, self.slopes, strict=True))]
            parameters = self.structure.parameters(state[:self.shared])
            found = self.structure.motions(parameters, self.spectra[0].s, np.concatenate(places))
            self._last = state, found
        return self._last[1]

    def predicted(self, state: Floats, k: int, slopes: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Transform (s, n) of tap k, and its derivatives (s, n, size + local), empty without `slopes`."""
        found, structure = self.spectra[k], self.structure
        parameters, (_, beyond, heights_N) = structure.parameters(state[:self.shared]), self.of_tap(state, k)
        sensors, motions = self.motions(state)
        motion = motions[:, :, 3 * k:3 * k + 3]
        static = -self.compliance * found.s**2
        transfer = structure.transfer(parameters, found.s, motion[:, :, 0]) + static * beyond[:, None]
        force = self.hats[k] @ heights_N if found.force is None else found.force
        if not slopes:
            return transfer * force, np.empty(0)
        shared = structure.derivatives(parameters, found.s, sensors, motion[:, :, 0]) * force[:, None]
        moved = [structure.transfer(parameters, found.s, motion[:, :, 1 + axis]) * force for axis in range(2)]
        by_beyond = np.eye(len(transfer))[:, None] * (static * force)[:, None]
        by_force = transfer[:, :, None] * self.hats[k]
        return transfer * force, np.concatenate([shared, np.stack(moved, axis=2), by_beyond, by_force], axis=2)

    def residuals(self, state: Floats) -> list[np.ndarray]:
        return [found.acceleration - self.predicted(state, k)[0] for k, found in enumerate(self.spectra)]

    def weights(self, state: Floats, rough: bool) -> list[Floats]:
        """One over the power of errors (s, n) of each tap, for a complex normal distribution."""
        weights = []
        for found, left in zip(self.spectra, self.residuals(state), strict=True):
            power = band_power(found.acceleration, found.frequency_Hz)
            least = LEAST_ERROR**2 * power
            error = ROUGH**2 * power if rough else np.maximum(band_power(left, found.frequency_Hz), least)
            weights.append(found.independent / (error + (found.noise[:, None] if rough else 0.0)))
        return weights

    def cost(self, state: Floats, weights: list[Floats]) -> float:
        """Minus the logarithm of the posterior."""
        left = self.residuals(state)
        misfit = sum(float(np.sum(w * abs(r) ** 2)) for w, r in zip(weights, left, strict=True))
        return misfit + 0.5 * float(np.sum((state / self.prior_sd) ** 2))

    def normal(self, state: Floats, weights: list[Floats]) -> tuple[Floats, Floats]:
        """Matrix and right side of the step: half the curvature, and the slope, of twice the cost."""
        matrix, right = np.diag(1 / self.prior_sd**2), -state / self.prior_sd**2
        for k, found in enumerate(self.spectra):
            value, slope = self.predicted(state, k, slopes=True)
            own = np.r_[:self.shared, self.ends[k]:self.ends[k + 1]]
            j, r = _real(slope, found.acceleration - value, np.sqrt(2 * weights[k]))
            matrix[np.ix_(own, own)] += j.T @ j
            right[own] += j.T @ r
        return matrix, right

    def improved(self, state: Floats, rough: bool, steps: int) -> Floats:
        """By some steps of Gauss-Newton (Levenberg and Marquardt)."""
        damping = 1e-3
        for _ in range(steps):
            weights = self.weights(state, rough)
            matrix, right = self.normal(state, weights)
            before, step = self.cost(state, weights), right
            while damping < 1e6:
                step = np.asarray(np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), right), float)
                moved = state + step
                with np.errstate(over="ignore", invalid="ignore"):  # of a step too far, which is not taken
                    cost = self.cost(moved, weights)
                if cost <= before:
                    state, damping = moved, damping / 10
                    break
                damping *= 10
            else:
                return state
            if np.max(abs(step) / self.prior_sd) < CONVERGED:
                return state
        return state

    def start(self) -> Floats:
        """What is known beforehand, and the forces that suit it best where they are not known. They enter linearly."""
        state = np.zeros(self.prior_sd.size)
        weights, found = self.weights(state, rough=True), state.copy()
        for k, hats in enumerate(self.hats):
            if count := hats.shape[1]:
                columns = self.predicted(state, k, slopes=True)[1][:, :, -count:]
                j, r = _real(columns, self.spectra[k].acceleration, np.sqrt(weights[k]))
                heights_N = np.linalg.solve(j.T @ j + np.eye(count) / LARGEST_N**2, j.T @ r)
                found[self.ends[k + 1] - count:self.ends[k + 1]] = heights_N
        return found

    def covariance(self, state: Floats) -> Floats:
        """(size, size): of the parameters about a state. LinAlgError where rounding errors hide it."""
        matrix, _ = self.normal(state, self.weights(state, rough=False))
        if not np.isfinite(matrix).all():
            raise np.linalg.LinAlgError("not finite")
        every = cho_solve(cho_factor(matrix), np.eye(len(matrix)))
        return np.asarray(every[:self.shared, :self.shared], float)


@dataclass(frozen=True)
class Fitted:
    """The fit in its last window, the most probable state, and the parameters' covariance (size, size) about it."""

    fit: Fit
    state: Floats
    covariance: Floats


def _times_s(tap: Tap) -> Floats:
    """(b,): of the hats from the onset, no earlier than the window begins; none where the force was measured."""
    if tap.force_N is not None:
        return np.zeros(0)
    return np.arange(-min(EARLY_S, LEAD_S, tap.onset / tap.rate_Hz), LASTS_S, HAT_S)


def _hats(s: np.ndarray, times_s: Floats) -> np.ndarray:
    """(n, b): transforms of hats."""
    s = s[:, None]
    return np.asarray(HAT_S * (np.sinh(s * HAT_S / 2) / (s * HAT_S / 2)) ** 2 * np.exp(-s * times_s))


def _real(columns: np.ndarray, values: np.ndarray, root: Floats) -> tuple[Floats, Floats]:
    """Columns (s, n, k) and values (s, n), weighted by `root` (s, n), as real rows: (2 s n, k), (2 s n,)."""
    j, r = (columns * root[:, :, None]).reshape(-1, columns.shape[2]), (values * root).ravel()
    return np.concatenate([j.real, j.imag]), np.concatenate([r.real, r.imag])


def fit_plate(plate: PlateModel, taps: Sequence[Tap], prior: Prior | None = None) -> Fitted:
    """The most probable plate about a starting one. Raises RecognitionError for taps that do not fit each other."""
    check_taps(taps, len(plate.sensor_names), plate.max_frequency_Hz / BEYOND, plate.frequency_Hz.size, LEAD_S)
    taps = [replace(tap, rate_Hz=taps[0].rate_Hz) for tap in taps]  # rounding of times would give other frequencies
    prior, start, scatter = prior or Prior(), plate, np.inf
    try:
        for band_Hz in _bands(plate, taps):
            part = replace(start.below(BEYOND * band_Hz), max_frequency_Hz=BEYOND * band_Hz)
            start, scatter = _by_trend(plate, _fitted(part, taps, prior, scatter), prior)
        return _fitted(start, taps, prior, scatter)
    except np.linalg.LinAlgError:
        weakest = min(taps, key=lambda tap: float(abs(tap.acceleration).max()))
        raise RecognitionError(f"{weakest.name}: at most {abs(weakest.acceleration).max():.2g} m/s^2, which rounding "
                               "errors hide in the fit; needs a harder tap, its force, or another unit") from None


def _bands(plate: PlateModel, taps: Sequence[Tap]) -> list[float]:
    """Where the fits before the last end, in Hz: those of which the records have periods enough."""
    after_s = samples_of(taps, LEAD_S) / taps[0].rate_Hz
    every = [share * plate.max_frequency_Hz / BEYOND for share in BANDS]
    return [band_Hz for band_Hz in every if after_s * band_Hz >= LEAST_PERIODS and (plate.frequency_Hz < band_Hz).any()]


def _by_trend(plate: PlateModel, fitted: Fitted, prior: Prior) -> tuple[PlateModel, float]:
    """The plate with its frequencies moved by the trend of the modes that a fit of a part of them has identified: the
    logarithm of a frequency moves by a + b f. And the standard deviation of these modes about it.

    a and b are normally distributed about zero; their variance and that of the modes about the trend are those of the
    greatest evidence (MacKay, Bayesian interpolation, Neural Computation 4, 1992). So modes that scatter at random
    leave the plate nearly as it is. With fewer than LEAST_MODES it is left so, and nothing is told of their scatter.
    """
    part = fitted.fit.structure.plate
    own = np.arange(part.frequency_Hz.size)  # S of each mode with itself: the parameters begin with it
    found_Hz = part.frequency_Hz * np.sqrt(np.maximum(1 + 2 * fitted.state[own], 0.0))
    known = (np.sqrt(np.diag(fitted.covariance)[own]) < IDENTIFIED * prior.frequency) & (found_Hz > 0)
    known &= found_Hz < part.max_frequency_Hz / BEYOND
    if known.sum() < LEAST_MODES:
        return plate, np.inf
    from sklearn.linear_model import BayesianRidge  # late: slow to import

    terms = np.column_stack([np.ones(plate.frequency_Hz.size), plate.frequency_Hz / plate.max_frequency_Hz])
    moved = np.log(found_Hz[known] / plate.frequency_Hz[own[known]])
    trend = BayesianRidge(fit_intercept=False).fit(terms[own[known]], moved)
    moved_plate = replace(plate, frequency_Hz=plate.frequency_Hz * np.exp(trend.predict(terms)))
    return moved_plate, float(1 / np.sqrt(trend.alpha_))


def _fitted(plate: PlateModel, taps: Sequence[Tap], prior: Prior, scatter: float) -> Fitted:
    """The fit about one starting plate. LinAlgError where rounding errors hide the records."""
    structure, last = Structure(plate), LAST_DECAY / min(tap.acceleration.shape[1] / tap.rate_Hz for tap in taps)
    stages = [alpha for alpha in STAGES_1_s if alpha > 1.5 * last] + [last]
    state: Floats | None = None
    for alpha in stages:
        fit = Fit(structure, taps, prior, alpha, scatter)
        state = fit.improved(fit.start() if state is None else state, rough=True, steps=STEPS)
    assert state is not None
    state = fit.improved(state, rough=False, steps=LAST_STEPS)
    return Fitted(fit, state, fit.covariance(state))
