"""A plate's modes as the channels of a record see them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from common.channels import rod_column, sensor_column
from recognition.estimation.arrays import Booleans, Floats
from recognition.physics.arrangement_likelihood import ArrangementModel
from recognition.physics.force_law import hats
from recognition.plate.plate_model import SLOPES, PlateModel, modal_steps


def columns_of(plate: PlateModel) -> dict[str, tuple[Floats, bool]]:
    """Of each column of a record, what it sees of each mode, and whether it is the force of a rod."""
    accelerometers = zip(plate.sensor_names, plate.sensor_shape, strict=True)
    columns = {sensor_column(name): (row, False) for name, row in accelerometers}
    return columns | {rod_column(k): (row, True) for k, row in enumerate(plate.rod_force_N_m, 1)}


@dataclass(frozen=True)
class Seen:
    """A plate's modes as the channels of a model see them."""

    plate: PlateModel
    model: ArrangementModel

    @cached_property
    def observed(self) -> Floats:
        """(c, n): what each channel sees of a mode's acceleration, or, of rods, of its amplitude."""
        return np.array([columns_of(self.plate)[name][0] for name in self.model.names])

    @cached_property
    def is_rod(self) -> Booleans:
        return np.array([columns_of(self.plate)[name][1] for name in self.model.names])

    @cached_property
    def hats(self) -> Floats:
        """(steps, bins): a force of 1 N in each bin."""
        return hats(self.model.width, self.model.hat.shape[1], self.model.law.bins)

    @property
    def _middle_N(self) -> Floats:
        """Mean force (steps,) of coal and gangue at the middle speed."""
        return np.asarray(self.hats @ self.model.law.mean_force.mean(axis=0))

    def _motion(self, plate: PlateModel, force_N: Floats) -> Floats:
        """(c, steps, n): acceleration or amplitude of each mode under a force on it, as each channel takes it."""
        force = np.tile(force_N, (len(plate.frequency_Hz), 1))
        amplitude, _, acceleration = modal_steps(plate, force, 1 / self.model.step_s)
        return np.where(self.is_rod[:, None, None], amplitude.T, acceleration.T)

    def down(self, place_m: Floats, slope: tuple[int, int] = (0, 0)) -> Floats:
        """(stones, n): a mode's share of a force downwards at each place, or its derivative of these orders, 1/m."""
        return -self.plate.shape(place_m[:, 0], place_m[:, 1], slope)

    def hat(self) -> Floats:
        """Responses (c, steps, stones) to the hat on each place."""
        by_mode = self._motion(self.plate, self.hats[:, 0]) * self.observed[:, None]
        return np.asarray(by_mode @ self.down(self.model.place_m).T)

    @cached_property
    def _under_middle(self) -> Floats:
        return self._motion(self.plate, self._middle_N)

    def scatter(self) -> Iterator[Floats]:
        """Responses (c, steps, k) to one standard deviation of what is not known, under the mean force on each place:
        of frequencies, damping, shapes at sensors and at places, and of where stones touch."""
        plate, model = self.plate, self.model
        down = self.down(model.place_m).sum(axis=0)
        damping_ratio = np.minimum(plate.damping_ratio * (1 + plate.damping_sd), 0.99)
        for other in (replace(plate, frequency_Hz=plate.frequency_Hz * (1 + plate.frequency_sd)),
                      replace(plate, damping_ratio=damping_ratio)):
            yield (self._motion(other, self._middle_N) - self._under_middle) * self.observed[:, None] * down
        rods = np.sqrt(np.mean(plate.rod_force_N_m**2, axis=0)) if len(plate.rod_force_N_m) else 0.0
        error = plate.shape_sd * np.where(self.is_rod[:, None], rods, plate.rms_shape)
        for k in range(len(self.observed)):
            yield self._under_middle * error[:, None] * down * (np.arange(len(self.observed)) == k)[:, None, None]
        places = np.sqrt(len(model.place_m)) * plate.shape_sd * plate.rms_shape
        yield self._under_middle * self.observed[:, None] * places
        if model.place_deviation_m > 0:
            for slope in SLOPES:
                across = self.down(model.place_m, slope)
                yield model.place_deviation_m * (self._under_middle * self.observed[:, None]) @ across.T
