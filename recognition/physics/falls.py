"""Where and when the stones of a record fell, on a plate that is known.

From its arrival on, a stone pushes with f_0 + sum of a_k f_k on its place: f_0 is the mean force of both materials, the
others are the principal components of how the forces of all stones scatter about it, so that each a_k has a standard
deviation of one. A stone after the other is put where it explains most of what those before it leave, on
a grid of places and times (orthogonal matching pursuit: Pati, Rezaiifar, Krishnaprasad, Asilomar 1993); after each, all
are fitted together.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import fftconvolve

from analysis.signals.resampling import low_pass
from common.scene.plate import FlexiblePlate
from recognition.estimation.arrays import Floats, Integers
from recognition.physics.arrangement_likelihood import LATEST_S, ArrangementModel
from recognition.physics.force_records import Fall
from recognition.physics.seen import Seen
from recognition.plate.plate_model import SLOPES, PlateModel, modal_steps

COMPONENTS, WIDEST = 8, 4.0  # of what scatters; standard deviations that a coefficient has at most
GRID_M, GRID_S = 0.02, 4e-5  # on which a stone is put first
SMALLEST, LARGEST = 0.3, 2.5  # factors on the mean force with which it is put there
TIME_S, PLACE_M = 1e-5, 2e-3  # typical changes of an arrival and a place in a fit
HEARD_S = 5e-4  # of a stone's force, at least
LEAST_LEFT = 0.02  # of the power of a response that must be left when what others can explain is taken out of it
EVALUATIONS = 8  # of a fit
TRIED, NEAR_S, NEAR_M = 3, 1.5e-4, 0.05  # stones that are tried as the next, and how near no two of them are
ENOUGH, BETTER = 1.3, 0.98  # mean square that is left, above which each stone is sought anew; factor on it that counts
FIRST = 3  # numbers of a stone before its coefficients: arrival, x, y


@dataclass(frozen=True)
class FallSearch:
    """seen: the plate and the law of a model; motion (steps, forms, 2, n): acceleration and amplitude of each mode
    under the forms of the force, as records take them, from `begin` on; latest_s: until when stones arrive."""

    seen: Seen
    motion: Floats
    begin: int
    latest_s: float

    @classmethod
    def of(cls, model: ArrangementModel, latest_s: float) -> Self:
        """For records of a model, whose stones arrive from -LATEST_S until latest_s, and HEARD_S before the end."""
        plate = FlexiblePlate.model_validate_json(model.plate_json)
        assert plate.max_frequency_Hz is not None
        seen = Seen(PlateModel.from_scene(plate, plate.max_frequency_Hz), model)
        filtered, begin = low_pass(model.stride) if model.anti_alias else (np.ones(1), 0)
        motion = np.array([_motion(seen.plate, force, model.step_s, filtered) for force in _forms(seen)])
        end_s = (model.samples - 1) * model.stride * model.step_s
        return cls(seen, np.ascontiguousarray(np.moveaxis(motion, -1, 0)), begin, min(latest_s, end_s - HEARD_S))

    @cached_property
    def grid(self) -> Floats:
        """(places x times, 3): arrivals and places at which a stone is put first."""
        along = [np.arange(low + GRID_M / 2, high, GRID_M) for low, high in zip(*self.edges, strict=True)]
        times, y, x = np.meshgrid(np.arange(-LATEST_S, self.latest_s, GRID_S), *along[::-1], indexing="ij")
        return np.column_stack([times.ravel(), x.ravel(), y.ravel()])

    @cached_property
    def response(self) -> NDArray[np.float32]:
        """(places x times, channels, samples): to f_0 there."""
        found = list[NDArray[np.float32]]()
        for at in np.split(self.grid, np.flatnonzero(np.diff(self.grid[:, 0])) + 1):  # of one time
            of_mean = self._at(at[0, 0])[0][:, 0]
            found.append(self._sensed(of_mean, self.seen.down(at[:, 1:])).astype(np.float32))
        return np.concatenate(found)

    def fall(self, signals: Floats, noise: Floats, channels: Integers) -> Fall:
        """Of the stones of a record: signals (m, samples), standard deviation of each sensor's noise (m,), and which
        channels of the model the m are."""
        model = self.seen.model
        sd = np.hypot(model.residual[channels] * model.scale[channels], noise)
        fit = _Fit(self, channels, signals / sd[:, None], 1 / sd)
        stones, left = np.empty((0, FIRST + self.motion.shape[1] - 1)), np.inf
        for _ in range(model.stones):
            stones, left = fit.with_one_more(stones)
        settled = 0  # stones that were sought anew one after the other and are where they were
        while left > ENOUGH and settled < model.stones:
            other, by_other = fit.with_one_more(np.delete(stones, 0, axis=0))
            better = by_other < BETTER * left
            stones, left, settled = (other, by_other, 0) if better else (np.roll(stones, -1, axis=0), left, settled + 1)
        return Fall(stones[:, 1:FIRST], stones[:, 0])

    def _at(self, arrival_s: float) -> tuple[Floats, Floats]:
        """Motion (samples, forms, 2, n) of the modes, and its derivative by the arrival."""
        model = self.seen.model
        at = self.begin + model.stride * np.arange(model.samples) - arrival_s / model.step_s
        low = np.floor(at).astype(int)
        share = (at - low)[:, None, None, None]
        before, after = (self.motion[np.maximum(k, 0)] * (k >= 0)[:, None, None, None] for k in (low, low + 1))
        return (1 - share) * before + share * after, (before - after) / model.step_s

    def _sensed(self, modal: Floats, down: Floats) -> Floats:
        """Signals (..., k, channels, samples) of motion (samples, ..., 2, n) by forces on k places, whose modes have
        `down` (k, n) of them."""
        observed, rod = self.seen.observed, self.seen.is_rod
        out = np.empty((*modal.shape[:-2], len(down), len(rod)))
        for kind, chosen in enumerate((~rod, rod)):
            share = observed[chosen] * down[:, None]  # (k, channels, n)
            out[..., chosen] = np.tensordot(modal[..., kind, :], share, (-1, -1))
        return np.moveaxis(out, 0, -1)

    def stone(self, numbers: Floats) -> tuple[Floats, Floats]:
        """Signals (channels, samples) of one stone, and their derivatives (numbers, channels, samples)."""
        by_form, by_time = self._at(numbers[0])
        weight, place = np.r_[1.0, numbers[FIRST:]], numbers[None, 1:FIRST]
        down = self.seen.down(place)
        slopes = np.concatenate([self.seen.down(place, slope) for slope in SLOPES])
        each = self._sensed(by_form, down)[:, 0]
        later, across = (self._sensed(np.einsum("f,sfkn->skn", weight, one), share)
                         for one, share in ((by_time, down), (by_form, slopes)))
        return np.tensordot(weight, each, 1), np.concatenate([later, across, each[1:]])

    @property
    def edges(self) -> tuple[Floats, Floats]:
        """Lowest and highest x and y of the plate."""
        lines = (self.seen.plate.lines_x_m, self.seen.plate.lines_y_m)
        return np.array([one[0] for one in lines]), np.array([one[-1] for one in lines])


def _forms(seen: Seen) -> Floats:
    """f_0 and the others (forms, steps), N, at the middle speed."""
    law = seen.model.law
    mean, of_weights = law.of_any
    power, components = np.linalg.eigh(law.forms.T @ of_weights @ law.forms + law.rest)
    bins = np.vstack([mean @ law.forms, (components * np.sqrt(np.maximum(power, 0)))[:, :-COMPONENTS - 1:-1].T])
    return np.asarray(bins @ seen.hats.T)


def _motion(plate: PlateModel, force_N: Floats, step_s: float, filtered: Floats) -> Floats:
    amplitude, _, acceleration = modal_steps(plate, np.tile(force_N, (len(plate.frequency_Hz), 1)), 1 / step_s)
    return np.asarray(fftconvolve(np.stack([acceleration, amplitude]), filtered[None, None], axes=2))


@dataclass(frozen=True)
class _Fit:
    """A record in units of its noise, white (m, samples), of some channels; weight (m,): of a signal of these."""

    search: FallSearch
    channels: Integers
    white: Floats
    weight: Floats

    @cached_property
    def _response(self) -> NDArray[np.float32]:
        """(places x times, d): of a stone with the mean force, in units of noise."""
        weighted = self.search.response[:, self.channels] * self.weight[:, None].astype(np.float32)
        return weighted.reshape(len(weighted), -1)

    @cached_property
    def _power(self) -> NDArray[np.float32]:
        return np.asarray(np.einsum("gd,gd->g", self._response, self._response))

    def _of(self, stones: Floats) -> tuple[Floats, Floats]:
        """What stones leave of the record (d,), and the derivatives (d, numbers of all stones) of their signals."""
        found = [self.search.stone(one) for one in stones]
        left, weight = self.white.copy(), self.weight[:, None]
        for signals, _ in found:
            left -= signals[self.channels] * weight
        slopes = [(one[:, self.channels] * weight).reshape(len(one), -1) for _, one in found]
        return left.ravel(), np.concatenate([*slopes, np.empty((0, left.size))]).T

    def with_one_more(self, stones: Floats) -> tuple[Floats, float]:
        """These and another stone, all fitted, and what they leave; the best of TRIED."""
        found = [self.fitted(np.vstack([stones, one])) for one in self.one_more(stones)]
        return min(found, key=lambda one: one[1])

    def one_more(self, stones: Floats) -> Floats:
        """(TRIED, numbers): stones with the mean force, of any size, that explain most of what is left, far apart."""
        left, slopes = self._of(stones)
        known = np.linalg.qr(slopes)[0]
        left = left - known @ (known.T @ left)
        response, power, grid = self._response, self._power, self.search.grid
        product = response @ np.column_stack([left, known]).astype(np.float32)
        own = np.maximum(power - (product[:, 1:] ** 2).sum(axis=1), LEAST_LEFT * power)
        size = np.clip(product[:, 0] / own, SMALLEST, LARGEST)
        explained, found = 2 * size * product[:, 0] - size**2 * own, list[Floats]()
        for _ in range(TRIED):
            found.append(grid[np.argmax(explained)])
            near = (abs(grid - found[-1]) <= [NEAR_S, NEAR_M, NEAR_M]).all(axis=1)
            explained[near] = -np.inf
        return np.pad(found, ((0, 0), (0, self.search.motion.shape[1] - 1)))

    def fitted(self, stones: Floats) -> tuple[Floats, float]:
        """The stones after a fit of all numbers, and the mean square of what they leave, 1 where it is noise."""
        numbers, count = stones.shape[1], len(stones)
        coefficients = np.tile(np.arange(numbers) >= FIRST, count)
        kept: dict[bytes, tuple[Floats, Floats]] = {}

        def both(flat: Floats) -> tuple[Floats, Floats]:
            if flat.tobytes() not in kept:
                kept.clear()
                kept[flat.tobytes()] = self._of(flat.reshape(count, numbers))
            return kept[flat.tobytes()]

        low, high = self.search.edges
        wide = np.full(numbers - FIRST, WIDEST)

        def off(flat: Floats) -> Floats:
            return np.r_[both(flat)[0], flat[coefficients]]

        def slopes(flat: Floats) -> Floats:
            return np.vstack([-both(flat)[1], np.eye(flat.size)[coefficients]])

        least = np.tile(np.r_[-LATEST_S, low, -wide], count)
        most = np.tile(np.r_[self.search.latest_s, high, wide], count)
        scale = np.tile(np.r_[TIME_S, PLACE_M, PLACE_M, np.ones(numbers - FIRST)], count)
        found = least_squares(off, stones.ravel(), slopes, bounds=(least, most), x_scale=scale, ftol=1e-4,
                              max_nfev=EVALUATIONS)
        return found.x.reshape(count, numbers), 2 * float(found.cost) / self.white.size
