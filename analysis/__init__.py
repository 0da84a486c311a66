"""Analysis of run directories and of anybody's acceleration record.

    from analysis import as_record, signal_features
    parameters = signal_features(as_record(acceleration, rate_Hz=6667.0, unit="m/s^2"))

Needs neither LIGGGHTS nor a simulation. Plotting lives in `report.figures.style`.
"""

import sys

from common.command import listen_for_interrupt

if sys.argv[:1] == ["-m"]:  # `python -m analysis` comes here first, and the imports below take their time
    listen_for_interrupt()


from analysis.features import Feature, base_parameters, signal_features
from analysis.readers import read_record
from analysis.records import Record, RecordError, as_record
from analysis.runs import Run, Sweep, read_run, read_sweep

__all__ = [
    "Feature",
    "Record",
    "RecordError",
    "Run",
    "Sweep",
    "as_record",
    "base_parameters",
    "read_record",
    "read_run",
    "read_sweep",
    "signal_features",
]
