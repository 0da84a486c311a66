"""The likelihood of all arrangements as a method of recognition."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from analysis import RecordError
from analysis.signals.records import sample_rate_Hz
from analysis.sweep.runs import Run
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Floats
from recognition.estimation.calibration import reason_out_of_distribution
from recognition.estimation.channels import channel_names, channels_of
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import Groups
from recognition.physics.arrangement_fit import DURATION_S, PlateRecord, distance_reference, fit_model, told, used
from recognition.physics.arrangement_likelihood import (
    DISTANCES,
    LATEST_S,
    ArrangementModel,
    ExpectedMisfit,
)
from recognition.physics.force_records import ForceRecord, fall_of, force_record_of
from recognition.physics.learnt_plate import on_plate
from recognition.plate.plate_model import PlateModel

LATEST_FALL_S = 5.25e-3  # of a record, whose beginning is kept for as long


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


def noise_of(signals: Floats) -> Floats:
    """Standard deviation (m,) of white noise on smooth signals (m, n): of their third differences, over the last
    quarter, where the plate's high modes have died away. At 6667 Hz what is left of them counts as noise of 1 %."""
    late = signals[:, -(signals.shape[1] // 4):]
    return np.asarray(np.sqrt(np.mean(np.diff(late, 3, axis=1) ** 2, axis=1) / 20))


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
