"""The likelihood of all arrangements as a method, on the plate of the training or one learnt by tapping.

There the law of the stones' forces stays. Of the plate's responses, the part of the modes up to the highest frequency
that was learnt is that of the learnt modes; what modes above it add stays that of the finite elements. Each mode's
frequency, damping and shape at each sensor and place is known from the taps within a standard error only. A response
that is off by one standard error is off at all times and channels together, and enters the covariance as such.
"""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Self

import numpy as np
import pandas as pd

from analysis import RecordError
from analysis.signals.records import sample_rate_Hz
from analysis.sweep.runs import Run
from common.scene.plate import FlexiblePlate
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Floats
from recognition.estimation.calibration import reason_out_of_distribution
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import Groups
from recognition.estimation.noise import noise_of
from recognition.estimation.window import channel_names, channels_of
from recognition.physics.arrangement_fit import DURATION_S, PlateRecord, distance_reference, fit_model, told, used
from recognition.physics.arrangement_likelihood import DISTANCES, LATEST_S, ArrangementModel, ExpectedMisfit
from recognition.physics.falls import FallSearch
from recognition.physics.force_records import Fall, ForceRecord, fall_of, force_record_of
from recognition.physics.seen import Seen, columns_of
from recognition.plate.plate_model import PlateModel

LATEST_FALL_S = 5.25e-3  # of a record, whose beginning is kept for as long
LOST = 1e-6  # of the power of all that scatters, that is left out


@dataclass
class ArrangementLikelihood:
    """Recognition by the likelihood of every arrangement of stones on known places. exact_trigger: records begin as
    those of the simulation, with all stones just above the plate; otherwise the moment of the impact is sought."""

    exact_trigger: bool = False
    model_: ArrangementModel = field(init=False, repr=False)
    expected_: ExpectedMisfit = field(init=False, repr=False)
    limits_: Floats = field(init=False, repr=False)
    error_: float = field(init=False, repr=False)

    def prepare(self, signals: pd.DataFrame, run: Run | None = None) -> PlateRecord:
        """The beginning of one record, and the forces of the stones where the run has them."""
        names, values = channel_names(signals.columns, rods=True), channels_of(signals, rods=True)
        rate_Hz = sample_rate_Hz(signals["t_s"].to_numpy(dtype=float), "record")
        least = 4 * used(0.0, rate_Hz)
        if values.shape[1] < least:
            raise RecognitionError(f"{values.shape[1]} samples; needs {least} to tell the sensors' noise")
        return PlateRecord(values[:, :used(LATEST_FALL_S, rate_Hz)], noise_of(values), tuple(names),
                           _force_record(run, 1 / rate_Hz), None if run is None else fall_of(run))

    def fit(self, X: Sequence[PlateRecord], y: Floats, *, groups: Groups | None = None,
            nuisance: pd.DataFrame | None = None) -> Self:
        """Train on the runs that have force records, stones that fall at once, and the places that most have. The
        conditions are those of the force records. RecognitionError for too few of these or of their stones."""
        keys = np.asarray(y if groups is None else groups)
        self.model_ = fit_model(X, keys)
        self.expected_, self.limits_, self.error_ = distance_reference(X, np.asarray(y), keys)
        return self

    def at_impact(self) -> Self:
        """The same with an exact trigger."""
        known = copy(self)
        known.exact_trigger = True
        return known

    def on_plate(self, plate: PlateModel) -> Self:
        """The same on a plate that was learnt by tapping. RecognitionError where they do not fit each other."""
        other = copy(self)
        other.model_ = on_plate(self.model_, plate)
        return other

    def answer(self, X: Sequence[PlateRecord]) -> list[Answer]:
        search = cache(lambda: FallSearch.of(self.model_, LATEST_FALL_S))
        return [self._answer(x, search) for x in X]

    def _answer(self, x: PlateRecord, search: Callable[[], FallSearch]) -> Answer:
        model, arrival_s = self.model_, 0.0 if self.exact_trigger else None
        if x.signals.shape[1] < model.samples:
            raise RecognitionError(f"{x.signals.shape[1]} samples; the model has {model.samples}")
        known = model.names
        if unknown := set(x.names) - set(known):
            raise RecognitionError(f"no column {min(unknown)!r} in the training; it has {', '.join(known)}")
        signals, channels = x.signals[:, :model.samples], np.array([known.index(name) for name in x.names])
        if model.own_falls:
            fall = x.fall
            if fall is None:
                signals, fall = _from_the_first(signals, search().fall(signals, x.noise, channels),
                                                model.stride * model.step_s)
            model, arrival_s = told(model, fall), 0.0
        found = model.estimate(signals, x.noise, arrival_s=arrival_s, channels=channels)
        far = self.expected_.distances(found)
        return Answer(found.ratio, *found.interval, reason_out_of_distribution(DISTANCES, far, self.limits_))

    def summary(self) -> str:
        m = self.model_
        return (f"{m.stones} stones, {m.low_m_s:.3g} to {m.high_m_s:.3g} m/s,"
                f" {m.samples} samples of {m.scale.size} signals")


def _from_the_first(signals: Floats, fall: Fall, sample_s: float) -> tuple[Floats, Fall]:
    """Signals (m, samples) from before the first stone arrives on, where all is at rest, and the fall by them."""
    early = int(np.ceil(max(0.0, -fall.arrival_s.min()) / sample_s))
    before = np.pad(signals, ((0, 0), (early, 0)))[:, :signals.shape[1]]
    return before, replace(fall, arrival_s=fall.arrival_s + early * sample_s)


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
    plate = plate.without_residual_modes()  # the finite elements have the modes that these stand for
    kept = [k for k, name in enumerate(model.names) if name in columns_of(plate)]
    if not kept:
        raise RecognitionError(f"the plate has none of the channels {', '.join(model.names)}")
    model = replace(model, names=tuple(model.names[k] for k in kept), scale=model.scale[kept],
                    residual=model.residual[kept], hat=model.hat[kept], scatter=[])
    thought = PlateModel.from_scene(FlexiblePlate.model_validate_json(model.plate_json), plate.max_frequency_Hz)
    new, old = Seen(plate, model), Seen(thought, model)
    scale = model.scale[:, None, None]
    return replace(model, hat=model.hat + (new.hat() - old.hat()) / scale,
                   scatter=_compressed([one / scale for one in new.scatter()]))


def _compressed(scatter: list[Floats]) -> list[Floats]:
    """The same covariance from as few responses as hold all but LOST of its power; none where nothing scatters."""
    every = np.concatenate(scatter, axis=2)
    flat = every.reshape(-1, every.shape[2])
    power, directions = np.linalg.eigh(flat.T @ flat)
    if power[-1] <= 0:
        return []
    first = int(np.searchsorted(np.cumsum(np.maximum(power, 0.0)), LOST * power.sum()))
    return [(flat @ directions[:, first:]).reshape(*every.shape[:2], -1)]
