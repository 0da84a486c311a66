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
from typing import Annotated, Self

import numpy as np
from pydantic import Field
from scipy.linalg import cho_factor, cho_solve

from common.tables import Table, about
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.tapping.structure import Parameters, Structure
from recognition.tapping.taps import Tap, check_taps
from recognition.tapping.window import LEAST_PERIODS, Spectra, band_power, check_band, noise_power, samples_of, spectra

HAT_S = 5e-5  # distance of the hats
LASTS_S = 1.5e-3  # at most, a tap
EARLY_S = 3e-4  # before the onset as the sensors see it
LARGEST_N = 1e4  # standard deviation of a hat's height: any tap is smaller


@dataclass(frozen=True)
class Force:
    """A measured force has no coefficients. One that is not known is a sum of hats at times_s (b,) from the onset, with
    heights `coefficients` (b,), N."""

    times_s: Floats
    coefficients: Floats

    @property
    def deviation(self) -> Floats:
        return np.full(self.coefficients.size, LARGEST_N)

    def moved(self, step: Floats) -> Self:
        return replace(self, coefficients=self.coefficients + step)

    def basis(self, found: Spectra) -> np.ndarray:
        """(n, b): transforms of the hats."""
        s = found.s[:, None]
        hat = HAT_S * (np.sinh(s * HAT_S / 2) / (s * HAT_S / 2)) ** 2
        return np.asarray(hat * np.exp(-s * self.times_s))

    def at(self, found: Spectra) -> np.ndarray:
        """(n,): transform of the force."""
        if self.coefficients.size:
            return np.asarray(self.basis(found) @ self.coefficients)
        assert found.force is not None
        return found.force


def force_of(tap: Tap, lead_s: float) -> Force:
    """A tap's force before any fit; hats begin no earlier than the window does."""
    if tap.force_N is not None:
        return Force(np.zeros(0), np.zeros(0))
    start = -min(EARLY_S, lead_s, tap.onset / tap.rate_Hz)
    times_s = np.arange(start, LASTS_S, HAT_S)
    return Force(times_s, np.zeros(times_s.size))


LEAST_MODES = 6  # from which a trend is taken


def stretched(plate: PlateModel, thought_Hz: Floats, found_Hz: Floats) -> PlateModel:
    """The plate with its frequencies moved by a trend: the logarithm of a frequency moves by a + b f.

    thought_Hz, found_Hz (k,): frequencies of some of its modes, and what they are found to be. a and b are normally
    distributed about zero; their variance and that of the modes about the trend are those of the greatest evidence
    (MacKay, Bayesian interpolation, Neural Computation 4, 1992). So modes that scatter at random leave the plate nearly
    as it is. With fewer than LEAST_MODES it is left so.
    """
    if thought_Hz.size < LEAST_MODES:
        return plate
    from sklearn.linear_model import BayesianRidge  # late: slow to import

    trend = BayesianRidge(fit_intercept=False).fit(_terms(thought_Hz, plate), np.log(found_Hz / thought_Hz))
    return replace(plate, frequency_Hz=plate.frequency_Hz * np.exp(trend.predict(_terms(plate.frequency_Hz, plate))))


def _terms(frequency_Hz: Floats, plate: PlateModel) -> Floats:
    return np.column_stack([np.ones(frequency_Hz.size), frequency_Hz / plate.max_frequency_Hz])


BEYOND = 1.25  # modes up to so many times the highest frequency of the fit are needed
STAGES_1_s = (2000.0, 800.0, 300.0, 100.0)  # alpha of the windows before the last, which the record's length sets
BANDS = (0.2, 0.3, 0.45, 0.67)  # of the highest frequency, that are fitted before the whole
IDENTIFIED = 0.3  # a mode is, where its frequency is known so many times better than before
LAST_DECAY = 5.0  # alpha times the duration of the record, in the last window
STEPS, LAST_STEPS = 4, 8  # of Gauss-Newton, in each window
ROUGH = 0.3  # error of the model as a share of the record, in all windows but the last
LEAST_ERROR = 1e-3
LEAD_S = 1e-3  # before the onset
MODES_BEYOND = 3.0  # standard deviation of `Place.beyond`
CONVERGED = 1e-3  # largest step, in standard deviations, with which a window ends


Deviation = Annotated[float, Field(ge=1e-9, le=1)]


class Prior(Table):
    """Standard deviations of what is not known beforehand. That of a frequency, divided by the root of 2, is also that
    of the mixing of two modes."""

    frequency: Annotated[Deviation, about("of a frequency, relative")] = 0.03
    damping: Annotated[Deviation, about("of the logarithm of a damping ratio")] = 0.5
    gain: Annotated[Deviation, about("of a sensor's gain, relative")] = 0.03
    place_m: Annotated[Deviation, about("of the place of a sensor or a tap along x and y")] = 1.5e-3

    def of(self, structure: Structure) -> Floats:
        """Standard deviations (size,) of a structure's vector of parameters."""
        first, second = structure.pairs
        start = structure.start
        coupling = np.where(first == second, 1.0, np.sqrt(0.5)) * self.frequency
        return np.concatenate([coupling, np.full(start.log_damping.size, self.damping),
                               np.full(start.log_gain.size, self.gain),
                               np.full(start.sensor_shift_m.size, self.place_m)])


@dataclass(frozen=True)
class Place:
    """What is fitted of one tap: its shift_m (2,), the compliance (s,) that modes beyond the model give at each sensor,
    in units of `Fit.compliance`, and its force."""

    shift_m: Floats
    beyond: Floats
    force: Force

    @property
    def vector(self) -> Floats:
        return np.concatenate([self.shift_m, self.beyond, self.force.coefficients])

    def moved(self, step: Floats) -> "Place":
        start = 2 + self.beyond.size
        return Place(self.shift_m + step[:2], self.beyond + step[2:start], self.force.moved(step[start:]))


@dataclass(frozen=True)
class State:
    parameters: Parameters
    places: tuple[Place, ...]

    def moved(self, step: Floats) -> "State":
        start, places = self.parameters.vector.size, []
        for place in self.places:
            places.append(place.moved(step[start:start + place.vector.size]))
            start += place.vector.size
        return State(self.parameters.moved(step), tuple(places))

    @property
    def vector(self) -> Floats:
        return np.concatenate([self.parameters.vector, *(place.vector for place in self.places)])


@dataclass(frozen=True)
class Fitted:
    """state: the most probable; covariance (size, size): of the shared parameters about it; residual, record, noise:
    for each tap (s, n), transforms of what is left and of the record, and the power (s,) of noise; frequency_Hz (n,)
    of each."""

    structure: Structure
    state: State
    covariance: Floats
    residual: list[np.ndarray]
    record: list[np.ndarray]
    noise: list[Floats]
    frequency_Hz: list[Floats]


class Fit:
    """The cost of a state in one window, and its steps."""

    def __init__(self, structure: Structure, taps: Sequence[Tap], prior: Prior, alpha: float) -> None:
        self.structure, self.taps, self.prior, self.alpha = structure, taps, prior, alpha
        highest_Hz = structure.plate.max_frequency_Hz / BEYOND
        samples = samples_of(taps, LEAD_S)
        self.spectra = [spectra(tap, alpha, highest_Hz, LEAD_S, samples) for tap in taps]
        self.noise = [noise_power(tap, alpha, LEAD_S, samples) for tap in taps]
        self.shapes = [structure.plate.shape(*tap.place_m[:, None]) for tap in taps]
        self.slopes = [structure.slopes(tap.place_m[None])[0] for tap in taps]
        self._last: tuple[State, tuple[np.ndarray, np.ndarray]] | None = None
        end_1_s = 2 * np.pi * structure.plate.max_frequency_Hz
        self.compliance = float(np.mean(structure.plate.rms_shape**2)) / end_1_s**2  # m/N, of a mode there

    def motions(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """`Structure.motions` of the sensors and of every tap's shape and slopes (n, m, 3 taps), kept for the state."""
        if self._last is None or self._last[0] is not state:
            places = [np.concatenate([shape + place.shift_m @ slopes, slopes]) for shape, slopes, place in
                      zip(self.shapes, self.slopes, state.places, strict=True)]
            found = self.structure.motions(state.parameters, self.spectra[0].s, np.concatenate(places))
            self._last = state, found
        return self._last[1]

    def predicted(self, state: State, k: int, slopes: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Transform (s, n) of tap k, and its derivatives (s, n, size + local), empty without `slopes`."""
        found, place, structure = self.spectra[k], state.places[k], self.structure
        sensors, motions = self.motions(state)
        motion = motions[:, :, 3 * k:3 * k + 3]
        through = structure.transfer(state.parameters, found.s, motion[:, :, 0])
        static = -self.compliance * found.s**2
        transfer = through + static * place.beyond[:, None]
        force = place.force.at(found)
        if not slopes:
            return transfer * force, np.empty(0)
        shared = structure.derivatives(state.parameters, found.s, sensors, motion[:, :, 0]) * force[:, None]
        moved = [structure.transfer(state.parameters, found.s, motion[:, :, 1 + axis]) * force for axis in range(2)]
        beyond = np.eye(len(transfer))[:, None] * (static * force)[:, None]
        by_force = transfer[:, :, None] * place.force.basis(found)
        return transfer * force, np.concatenate([shared, np.stack(moved, axis=2), beyond, by_force], axis=2)

    def residuals(self, state: State) -> list[np.ndarray]:
        return [found.acceleration - self.predicted(state, k)[0] for k, found in enumerate(self.spectra)]

    def weights(self, state: State, rough: bool) -> list[Floats]:
        """One over the power of errors (s, n) of each tap, for a complex normal distribution."""
        weights = []
        for found, noise, left in zip(self.spectra, self.noise, self.residuals(state), strict=True):
            power, frequency_Hz = band_power(found.acceleration, _frequency(found)), _frequency(found)
            error = ROUGH**2 * power if rough else np.maximum(band_power(left, frequency_Hz), LEAST_ERROR**2 * power)
            weights.append(found.independent / (error + (noise[:, None] if rough else 0.0)))
        return weights

    def prior_sd(self, state: State) -> Floats:
        local = [np.concatenate([np.full(2, self.prior.place_m), np.full(place.beyond.size, MODES_BEYOND),
                                 place.force.deviation]) for place in state.places]
        return np.concatenate([self.prior.of(self.structure), *local])

    def cost(self, state: State, weights: list[Floats], sd: Floats) -> float:
        """Minus the logarithm of the posterior."""
        left = self.residuals(state)
        misfit = sum(float(np.sum(w * abs(r) ** 2)) for w, r in zip(weights, left, strict=True))
        return misfit + 0.5 * float(np.sum((state.vector / sd) ** 2))

    def normal(self, state: State, weights: list[Floats], sd: Floats) -> tuple[Floats, Floats]:
        """Matrix and right side of the step: half the curvature, and the slope, of twice the cost."""
        shared = state.parameters.vector.size
        matrix, right, start = np.diag(1 / sd**2), -state.vector / sd**2, shared
        for k, found in enumerate(self.spectra):
            value, slope = self.predicted(state, k, slopes=True)
            root = np.sqrt(2 * weights[k])
            own = np.concatenate([np.arange(shared), np.arange(start, start + state.places[k].vector.size)])
            j = (slope * root[:, :, None]).reshape(-1, own.size)
            r = ((found.acceleration - value) * root).ravel()
            j, r = np.concatenate([j.real, j.imag]), np.concatenate([r.real, r.imag])
            matrix[np.ix_(own, own)] += j.T @ j
            right[own] += j.T @ r
            start += state.places[k].vector.size
        return matrix, right

    def improved(self, state: State, rough: bool, steps: int) -> State:
        """By some steps of Gauss-Newton (Levenberg and Marquardt)."""
        damping = 1e-3
        for _ in range(steps):
            sd, weights = self.prior_sd(state), self.weights(state, rough)
            matrix, right = self.normal(state, weights, sd)
            before, step = self.cost(state, weights, sd), right
            while damping < 1e6:
                step = np.asarray(np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), right), float)
                moved = state.moved(step)
                with np.errstate(over="ignore", invalid="ignore"):  # of a step too far, which is not taken
                    cost = self.cost(moved, weights, sd)
                if cost <= before:
                    state, damping = moved, damping / 10
                    break
                damping *= 10
            else:
                return state
            if np.max(abs(step) / sd) < CONVERGED:
                return state
        return state


def fit_plate(plate: PlateModel, taps: Sequence[Tap], prior: Prior | None = None) -> Fitted:
    """The most probable plate about a starting one. Raises RecognitionError for taps that do not fit each other."""
    check_taps(taps, len(plate.sensor_names))
    check_band(taps, plate.max_frequency_Hz / BEYOND, plate.frequency_Hz.size, LEAD_S)
    taps = [replace(tap, rate_Hz=taps[0].rate_Hz) for tap in taps]  # rounding of times would give other frequencies
    prior, start = prior or Prior(), plate
    try:
        for band_Hz in _bands(plate, taps):
            part = replace(start.below(BEYOND * band_Hz), max_frequency_Hz=BEYOND * band_Hz)
            start = _by_trend(plate, _fitted(part, taps, prior), prior)
        return _fitted(start, taps, prior)
    except np.linalg.LinAlgError:
        weakest = min(taps, key=lambda tap: float(abs(tap.acceleration).max()))
        raise RecognitionError(f"{weakest.name}: at most {abs(weakest.acceleration).max():.2g} m/s^2, which rounding "
                               "errors hide in the fit; needs a harder tap, its force, or another unit") from None


def _bands(plate: PlateModel, taps: Sequence[Tap]) -> list[float]:
    """Where the fits before the last end, in Hz: those of which the records have periods enough."""
    after_s = samples_of(taps, LEAD_S) / taps[0].rate_Hz
    every = [share * plate.max_frequency_Hz / BEYOND for share in BANDS]
    return [band_Hz for band_Hz in every if after_s * band_Hz >= LEAST_PERIODS and (plate.frequency_Hz < band_Hz).any()]


def _by_trend(plate: PlateModel, fitted: Fitted, prior: Prior) -> PlateModel:
    """The plate with its frequencies moved by the trend of the modes that a fit of a part of them has identified."""
    part = fitted.structure.plate
    own = np.arange(part.frequency_Hz.size)  # S of each mode with itself comes first
    found_Hz = part.frequency_Hz * np.sqrt(np.maximum(1 + 2 * fitted.state.parameters.coupling[own], 0.0))
    known = (np.sqrt(np.diag(fitted.covariance)[own]) < IDENTIFIED * prior.frequency) & (found_Hz > 0)
    known &= found_Hz < part.max_frequency_Hz / BEYOND
    return stretched(plate, plate.frequency_Hz[own[known]], found_Hz[known])


def _fitted(plate: PlateModel, taps: Sequence[Tap], prior: Prior) -> Fitted:
    """The fit about one starting plate. LinAlgError where rounding errors hide the records."""
    structure, last = Structure(plate), LAST_DECAY / min(tap.duration_s for tap in taps)
    stages = [alpha for alpha in STAGES_1_s if alpha > 1.5 * last] + [last]
    state, fit = _sought(structure, taps, prior, stages)
    return Fitted(structure, state, _covariance(fit, state), fit.residuals(state),
                  [one.acceleration for one in fit.spectra], fit.noise, [_frequency(one) for one in fit.spectra])


def _sought(structure: Structure, taps: Sequence[Tap], prior: Prior, stages: Sequence[float]) -> tuple[State, Fit]:
    """The most probable state, and the fit in the last of the windows."""
    state: State | None = None
    for alpha in stages:
        fit = Fit(structure, taps, prior, alpha)
        state = fit.improved(with_forces(fit, start_of(structure, taps)) if state is None else state, rough=True,
                             steps=STEPS)
    assert state is not None
    return fit.improved(state, rough=False, steps=LAST_STEPS), fit


def _covariance(fit: Fit, state: State) -> Floats:
    """(size, size): of the shared parameters about a state. LinAlgError where rounding errors hide it."""
    matrix, _ = fit.normal(state, fit.weights(state, rough=False), fit.prior_sd(state))
    if not np.isfinite(matrix).all():
        raise np.linalg.LinAlgError("not finite")
    shared = state.parameters.vector.size
    return np.asarray(cho_solve(cho_factor(matrix), np.eye(len(matrix)))[:shared, :shared], float)


def start_of(structure: Structure, taps: Sequence[Tap]) -> State:
    beyond = np.zeros(len(structure.plate.sensor_names))
    return State(structure.start, tuple(Place(np.zeros(2), beyond, force_of(tap, LEAD_S)) for tap in taps))


def with_forces(fit: Fit, state: State) -> State:
    """The state with the forces that suit it best, where they are not known. They enter linearly."""
    places = []
    weights = fit.weights(state, rough=True)
    for k, place in enumerate(state.places):
        if place.force.coefficients.size:
            found = fit.spectra[k]
            columns = fit.predicted(state, k, slopes=True)[1][:, :, -place.force.coefficients.size:]
            root = np.sqrt(weights[k])
            j = (columns * root[:, :, None]).reshape(-1, columns.shape[2])
            r = (found.acceleration * root).ravel()
            j, r = np.concatenate([j.real, j.imag]), np.concatenate([r.real, r.imag])
            matrix = j.T @ j + np.diag(1 / place.force.deviation**2)
            place = replace(place, force=place.force.moved(np.linalg.solve(matrix, j.T @ r)))
        places.append(place)
    return State(state.parameters, tuple(places))


def _frequency(found: Spectra) -> Floats:
    return np.asarray(found.s.imag / (2 * np.pi), float)
