"""The channels of a record that belong to a plate, at the rate at which stones are heard."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.signals.records import Record, sample_rate_Hz
from analysis.signals.resampling import resample
from common.channels import rod_column, sensor_column
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.innovations.signatures import Channels
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import numbers
from recognition.stream.recognise import RATE_Hz


def channels_of(table: pd.DataFrame, plate: PlateModel, source: str) -> tuple[Channels, Floats]:
    """Which sensors a record has, and their signals (c, samples) at RATE_Hz. RecognitionError where it has none of the
    plate's sensors, a value that is not finite, or too low a rate."""
    names = [sensor_column(name) for name in plate.sensor_names]
    here = [k for k, name in enumerate(names) if name in table.columns]
    rods = [k for k in range(len(plate.rod_force_N_m)) if rod_column(k + 1) in table.columns]
    if "t_s" not in table.columns or not here:
        raise RecognitionError(f"{source}: needs columns 't_s' and at least one of {', '.join(names)}")
    rate_Hz = sample_rate_Hz(numbers(table, "t_s", source), f"{source}: t_s")
    if rate_Hz < RATE_Hz * (1 - 1e-3):
        raise RecognitionError(f"{source}: {rate_Hz:.6g} Hz; needs at least {RATE_Hz:g}")
    columns = [names[k] for k in here] + [rod_column(k + 1) for k in rods]
    rate_Hz = RATE_Hz if abs(rate_Hz / RATE_Hz - 1) < 1e-3 else round(rate_Hz)
    records = [Record(numbers(table, name, source), rate_Hz, name=f"{source}: {name}") for name in columns]
    if rate_Hz != RATE_Hz:
        records = [resample(record, RATE_Hz) for record in records]
    return Channels(tuple(here), tuple(rods)), np.array([record.values for record in records])
