"""The command `listen`."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.readers import read_table
from analysis.records import Record, sample_rate_Hz
from analysis.resample import resample
from common.files import written_whole
from common.output_directory import at_work_in
from common.parquet import write_parquet
from recognition.estimation.answer import warning_of
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import numbers
from recognition.stream.law_file import load_forces
from recognition.stream.prior import StonePrior
from recognition.stream.recognise import RATE_Hz, recognise_stream
from recognition.stream.signatures import Channels
from recognition.stream.stones import ratio_of, sliding_ratio

KIND = "stones heard"
MOST_RATIOS = 100_000


def listen(arguments: argparse.Namespace) -> int:
    """0, or 3 without any ratio where the record is not explained by stones on this plate."""
    prior = prior_of(arguments)
    plate = PlateModel.load(Path(arguments.plate))
    path = Path(arguments.record)
    table = read_table(path / "signals.parquet" if path.is_dir() else path)
    channels, values = channels_of(table, plate, str(path))
    for name in ("window", "step"):
        if not 0 < getattr(arguments, name) < 1e6:
            raise RecognitionError(f"--{name} {getattr(arguments, name):g}: must be a time above 0 s")
    if values.shape[1] / RATE_Hz > MOST_RATIOS * arguments.step:
        raise RecognitionError(f"--step {arguments.step:g}: leads to more than {MOST_RATIOS} ratios; must be longer")
    try:
        found = recognise_stream(plate, channels, prior, values)
    except NotRecognised as error:
        print(f"REFUSED: {error}")
        return 3
    stones = found.stones.assign(t_s=found.stones["t_s"] + float(table["t_s"].iloc[0]))
    refused = found.refused
    out = Path(arguments.out)
    with at_work_in(out, KIND):
        _write(stones, out / "stones.parquet")
        ratio = sliding_ratio(found.stones, arguments.window, arguments.step, values.shape[1] / RATE_Hz)
        ratio["t_s"] += float(table["t_s"].iloc[0])
        if refused:
            ratio.iloc[:, 2:] = np.nan
        _write(ratio, out / "ratio.parquet")
    print(f"{len(stones)} stones, written to {out}/stones.parquet and ratio.parquet")
    if refused:
        print(f"NOT EXPLAINED, no ratio can be trusted: {refused}")
        return 3
    if not found.tapped:
        print("WARNING: no mode of the plate was tapped; the ratio may be 10 points off, outside its interval")
    for name, by_mass in (("number", False), ("mass", True)):
        low, middle, high = ratio_of(found.stones, by_mass)
        print(f"mixing ratio by {name} {100 * middle:.1f} %, 90 % interval {100 * low:.1f} to {100 * high:.1f}")
        if warning := warning_of(low, middle, high):
            print(warning)
    return 0


def prior_of(arguments: argparse.Namespace) -> StonePrior:
    """What the command line says of the stones."""
    for name in ("radius", "speed"):
        low, high = getattr(arguments, name)
        if not 0 < low <= high < 100:
            raise RecognitionError(f"--{name} {low:g} {high:g}: must be two positive numbers, the lower first")
    return StonePrior(load_forces(), tuple(arguments.radius), tuple(arguments.speed))


def channels_of(table: pd.DataFrame, plate: PlateModel, source: str) -> tuple[Channels, Floats]:
    """Which sensors a record has, and their signals (c, samples) at RATE_Hz. RecognitionError where it has none of the
    plate's sensors, a value that is not finite, or too low a rate."""
    names = [f"acc_{name}_m_s2" for name in plate.sensor_names]
    here = [k for k, name in enumerate(names) if name in table.columns]
    rods = [k for k in range(len(plate.rod_force_N_m)) if f"rod_{k + 1}_N" in table.columns]
    if "t_s" not in table.columns or not here:
        raise RecognitionError(f"{source}: needs columns 't_s' and at least one of {', '.join(names)}")
    rate_Hz = sample_rate_Hz(numbers(table, "t_s", source), f"{source}: t_s")
    if rate_Hz < RATE_Hz * (1 - 1e-3):
        raise RecognitionError(f"{source}: {rate_Hz:.6g} Hz; needs at least {RATE_Hz:g}")
    columns = [names[k] for k in here] + [f"rod_{k + 1}_N" for k in rods]
    rate_Hz = RATE_Hz if abs(rate_Hz / RATE_Hz - 1) < 1e-3 else round(rate_Hz)
    records = [Record(numbers(table, name, source), rate_Hz, name=f"{source}: {name}") for name in columns]
    if rate_Hz != RATE_Hz:
        records = [resample(record, RATE_Hz) for record in records]
    return Channels(tuple(here), tuple(rods)), np.array([record.values for record in records])


def _write(table: pd.DataFrame, file: Path) -> None:
    with written_whole(file) as beside:
        write_parquet(table, beside)
