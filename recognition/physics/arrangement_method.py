"""The likelihood of all arrangements as a method of recognition, on the plate of the training or on one that was learnt
by tapping.

There the law of the stones' forces stays. Of the plate's responses, the part of the modes up to the highest frequency
that was learnt is that of the learnt modes; what modes above it add stays that of the finite elements. Each mode's
frequency, damping and shape at each sensor and place is known from the taps within a standard error only. A response
that is off by one standard error is off at all times and channels together, and enters the covariance as such.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import pandas as pd

from analysis import RecordError
from analysis.signals.records import sample_rate_Hz
from analysis.sweep.runs import Run
from common.channels import rod_column, sensor_column
from common.scene.plate import FlexiblePlate
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Booleans, Floats
from recognition.estimation.calibration import reason_out_of_distribution
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import Groups
from recognition.estimation.noise import noise_of
from recognition.estimation.window import channel_names, channels_of
from recognition.physics.arrangement_fit import DURATION_S, PlateRecord, distance_reference, fit_model, told, used
from recognition.physics.arrangement_likelihood import (
    DISTANCES,
    LATEST_S,
    SMALL_M,
    ArrangementModel,
    ExpectedMisfit,
    hats,
)
from recognition.physics.force_records import ForceRecord, fall_of, force_record_of
from recognition.plate.plate_model import PlateModel, modal_steps

LATEST_FALL_S = 5.25e-3  # of a record, whose beginning is kept for as long
LOST = 1e-6  # of the power of all that scatters, that is left out


@dataclass
class ArrangementLikelihood:
    """Recognition by the likelihood of every arrangement of stones on known places
    (`recognition.estimation.method`). exact_trigger: records begin as those of the simulation, with all stones just
    above the plate; otherwise the moment of the impact is sought."""

    exact_trigger: bool = False
    model_: ArrangementModel = field(init=False, repr=False)
    expected_: ExpectedMisfit = field(init=False, repr=False)
    limits_: Floats = field(init=False, repr=False)
    error_: float = field(init=False, repr=False)

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> PlateRecord:
        """The beginning of one record, and the forces of the stones where the run has them."""
        names, values = channel_names(signals.columns, "plate"), channels_of(signals, "plate")
        rate_Hz = sample_rate_Hz(signals["t_s"].to_numpy(dtype=float), "record")
        least = 4 * used(0.0, rate_Hz)
        if values.shape[1] < least:
            raise RecognitionError(f"{values.shape[1]} samples; needs {least} to tell the sensors' noise")
        return PlateRecord(values[:, :used(LATEST_FALL_S, rate_Hz)], noise_of(values), tuple(names),
                           _force_record(run, 1 / rate_Hz), None if run is None else fall_of(run))

    def fit(self, X: Sequence[PlateRecord], y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> ArrangementLikelihood:
        """Train on the runs that have force records, stones that fall at once, and the places that most have. The
        conditions are those of the force records. RecognitionError where these runs, or the different stones in them,
        are too few."""
        keys = np.asarray(y if groups is None else groups)
        self.model_ = fit_model(X, keys)
        self.expected_, self.limits_, self.error_ = distance_reference(X, np.asarray(y), keys)
        return self

    def at_impact(self) -> ArrangementLikelihood:
        """The same with an exact trigger."""
        known = copy(self)
        known.exact_trigger = True
        return known

    def on_plate(self, plate: PlateModel) -> ArrangementLikelihood:
        """The same on a plate that was learnt by tapping. RecognitionError where they do not fit each other."""
        other = copy(self)
        other.model_ = on_plate(self.model_, plate)
        return other

    @property
    def _arrival_s(self) -> float | None:
        return 0.0 if self.exact_trigger else None

    def answer(self, X: Sequence[PlateRecord]) -> list[Answer]:
        """Answers to records."""
        return [self._answer(x) for x in X]

    def _answer(self, x: PlateRecord) -> Answer:
        model, arrival_s = self.model_, self._arrival_s
        if x.signals.shape[1] < model.samples:
            raise RecognitionError(f"{x.signals.shape[1]} samples; the model has {model.samples}")
        if model.own_falls:
            if x.fall is None:
                raise RecognitionError("the record does not tell where and when the stones fall, which the model needs")
            model, arrival_s = told(model, x.fall), 0.0
        known = model.names
        if unknown := set(x.names) - set(known):
            raise RecognitionError(f"no column {min(unknown)!r} in the training; it has {', '.join(known)}")
        found = model.estimate(x.signals[:, :model.samples], x.noise, arrival_s=arrival_s,
                               channels=np.array([known.index(name) for name in x.names]))
        far = self.expected_.distances(found)
        return Answer(found.ratio, *found.interval, reason_out_of_distribution(DISTANCES, far, self.limits_))

    def summary(self) -> str:
        m = self.model_
        return (f"{m.stones} stones, {m.low_m_s:.3g} to {m.high_m_s:.3g} m/s,"
                f" {m.samples} samples of {m.scale.size} signals")


def _force_record(run: Run | None, sample_s: float) -> ForceRecord | None:
    """None for a measured record, and for a run without a fast stream, a flexible plate or places of its stones."""
    if run is None:
        return None
    try:
        late_s = 0.0 if fall_of(run).at_once else LATEST_FALL_S
        ahead_s = 10 * sample_s if run.scene.time.anti_alias else 0.0  # of the low pass
        return force_record_of(run, DURATION_S + late_s + 2 * LATEST_S + ahead_s, sample_s)
    except RecordError:
        return None


def on_plate(model: ArrangementModel, plate: PlateModel) -> ArrangementModel:
    """The model with the responses of another plate, in the channels that both have. RecognitionError where they have
    none in common, or where a stone would fall beside the plate."""
    if model.own_falls:
        raise RecognitionError("a model of stones on places of their own knows the plate of its training alone")
    kept = [k for k, name in enumerate(model.names) if name in _columns(plate)]
    if not kept:
        raise RecognitionError(f"the plate has none of the channels {', '.join(model.names)}")
    model = replace(model, names=tuple(model.names[k] for k in kept), scale=model.scale[kept],
                    residual=model.residual[kept], hat=model.hat[kept], scatter=[])
    thought = PlateModel.from_scene(FlexiblePlate.model_validate_json(model.plate_json), plate.max_frequency_Hz)
    new, old = Seen(plate, model), Seen(thought, model)
    scale = model.scale[:, None, None]
    return replace(model, hat=model.hat + (new.hat() - old.hat()) / scale,
                   scatter=_compressed([one / scale for one in new.scatter()]))


def _columns(plate: PlateModel) -> dict[str, tuple[Floats, bool]]:
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
        return np.array([_columns(self.plate)[name][0] for name in self.model.names])

    @cached_property
    def is_rod(self) -> Booleans:
        return np.array([_columns(self.plate)[name][1] for name in self.model.names])

    @cached_property
    def _hats(self) -> Floats:
        """(steps, bins): a force of 1 N in each bin."""
        return hats(self.model.width, self.model.hat.shape[1], self.model.laws.shape[2])

    @property
    def _middle_N(self) -> Floats:
        """Mean force (steps,) of coal and gangue at the middle speed."""
        return np.asarray(self._hats @ self.model.laws[:, 0].mean(axis=0))

    def _motion(self, plate: PlateModel, force_N: Floats) -> Floats:
        """(c, steps, n): acceleration or amplitude of each mode under a force on it, as each channel takes it."""
        force = np.tile(force_N, (len(plate.frequency_Hz), 1))
        amplitude, _, acceleration = modal_steps(plate, force, 1 / self.model.step_s)
        return np.where(self.is_rod[:, None, None], amplitude.T, acceleration.T)

    def _down(self, place_m: Floats) -> Floats:
        """(stones, n): a mode's share of a force downwards at each place."""
        return -self.plate.shape(*place_m.T)

    def hat(self) -> Floats:
        """Responses (c, steps, stones) to the hat on each place."""
        by_mode = self._motion(self.plate, self._hats[:, 0]) * self.observed[:, None]
        return np.asarray(by_mode @ self._down(self.model.place_m).T)

    @cached_property
    def _under_middle(self) -> Floats:
        return self._motion(self.plate, self._middle_N)

    def scatter(self) -> Iterator[Floats]:
        """Responses (c, steps, k) to one standard deviation of what is not known, under the mean force on each place:
        of frequencies, damping, shapes at sensors and at places, and of where stones touch."""
        plate, model = self.plate, self.model
        down = self._down(model.place_m).sum(axis=0)
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
            for moved_m in ((SMALL_M, 0.0), (0.0, SMALL_M)):
                slope = (self._down(model.place_m + moved_m) - self._down(model.place_m)) / SMALL_M
                yield model.place_deviation_m * (self._under_middle * self.observed[:, None]) @ slope.T


def _compressed(scatter: list[Floats]) -> list[Floats]:
    """The same covariance from as few responses as hold all but LOST of its power; none where nothing scatters."""
    every = np.concatenate(scatter, axis=2)
    flat = every.reshape(-1, every.shape[2])
    power, directions = np.linalg.eigh(flat.T @ flat)
    if power[-1] <= 0:
        return []
    first = int(np.searchsorted(np.cumsum(np.maximum(power, 0.0)), LOST * power.sum()))
    return [(flat @ directions[:, first:]).reshape(*every.shape[:2], -1)]
