"""The channels of a record that belong to a plate, at the rate at which stones are heard."""

from __future__ import annotations

from collections.abc import Sequence

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

RATE_SHARE = 1e-3  # of rates that are taken for the same


def channels_of(table: pd.DataFrame, plate: PlateModel, source: str) -> tuple[Channels, Floats]:
    """Which sensors a record has, and their signals (c, samples) at RATE_Hz. RecognitionError where it has none of the
    plate's sensors, a value that is not finite, or too low a rate."""
    rate_Hz = sample_rate_Hz(numbers(table, "t_s", source), f"{source}: t_s") if "t_s" in table.columns else np.nan
    channels, columns = sensors_of(list(table.columns), rate_Hz, plate, source)
    rate_Hz = RATE_Hz if abs(rate_Hz / RATE_Hz - 1) < RATE_SHARE else round(rate_Hz)
    records = [Record(numbers(table, name, source), rate_Hz, name=f"{source}: {name}") for name in columns]
    if rate_Hz != RATE_Hz:
        records = [resample(record, RATE_Hz) for record in records]
    return channels, np.array([record.values for record in records])


def sensors_of(columns: Sequence[str], rate_Hz: float, plate: PlateModel, source: str) -> tuple[Channels, list[str]]:
    """Which of the plate's sensors have a column, and its name. RecognitionError for none or a rate that is too low."""
    names = [sensor_column(name) for name in plate.sensor_names]
    here = [k for k, name in enumerate(names) if name in columns]
    rods = [k for k in range(len(plate.rod_force_N_m)) if rod_column(k + 1) in columns]
    if np.isnan(rate_Hz) or not here:
        raise RecognitionError(f"{source}: needs columns 't_s' and at least one of {', '.join(names)}")
    if rate_Hz < RATE_Hz * (1 - RATE_SHARE):
        raise RecognitionError(f"{source}: {rate_Hz:.6g} Hz; needs at least {RATE_Hz:g}")
    return Channels(tuple(here), tuple(rods)), [names[k] for k in here] + [rod_column(k + 1) for k in rods]
