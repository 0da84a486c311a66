"""How often the check of channels misses a fault or sees one that is not there.

The plate is 1 % off the model and tapped at four places first; its records have 20 dB of noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from common.resources import resource
from lab.known_truth.faulty_records import FAULTS, REFUSED, SAYS, volley, with_fault
from lab.known_truth.other_plates import scattered
from lab.known_truth.tap_records import hammer_taps
from lab.study import Row
from recognition.plate.plate_model import PlateModel
from recognition.sensors.channel_check import check_channels
from recognition.tapping.fit import fit_plate
from recognition.tapping.learnt import learnt

SCENE, RATE_Hz, BAND_Hz = resource("scenes") / "paper.toml", 20e3, 5000.0


@cache
def plates() -> tuple[PlateModel, PlateModel]:
    """The true one, and what taps teach of it."""
    truth = scattered(PlateModel.from_scene(SCENE, 8000.0), 0.01, np.random.default_rng(1))
    rng = np.random.default_rng(2)
    taps = hammer_taps(truth, rng.uniform(-0.22, 0.22, (4, 2)), rng, place_error_m=1.5e-3)
    return truth, learnt(fit_plate(PlateModel.from_scene(SCENE, 1.25 * BAND_Hz), taps)).plate


def checked(fault: str, number: int) -> dict[str, float]:
    """What is said of one record."""
    truth, plate = plates()
    rng = np.random.default_rng(1000 + number)
    report = check_channels(with_fault(volley(truth, RATE_Hz, rng), fault, RATE_Hz, rng), RATE_Hz, plate)
    said = [line for line in (report.refused if fault in REFUSED else report.told) if SAYS.get(fault, "\0") in line]
    ringing = report.ringing
    return {"found": bool(said), "refused": bool(report.refused),
            "wrong": fault not in REFUSED and bool(report.refused or len(report.told) > len(said)),
            "misfit": ringing.misfit if ringing else np.nan, "expected": ringing.expected if ringing else np.nan}


def channel_faults(out: Path, records: int = 60) -> Iterator[Row]:
    """The same records with each fault."""
    for fault in FAULTS:
        for number in range(records):
            yield Row({"fault": fault, "record": number}, partial(checked, fault, number))


def channel_faults_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """All in per cent; of misfits the medians."""
    groups = rows.astype({"found": float, "wrong": float, "refused": float}).groupby("fault", sort=False)
    table = 100 * groups[["found", "wrong", "refused"]].mean().join(groups[["misfit", "expected"]].median())
    return table.add_suffix("_percent").assign(records=groups.size()).reset_index()
