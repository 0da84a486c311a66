"""Analysis of run directories and of anybody's acceleration record.

    from analysis import as_record, signal_features
    parameters = signal_features(as_record(acceleration, rate_Hz=6667.0, unit="m/s^2"))

Needs neither LIGGGHTS nor a simulation. Plotting lives in `report.drawing.style`.
"""

from typing import TYPE_CHECKING

from common.late import late

if TYPE_CHECKING:
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

__getattr__ = late(__name__, {
    "Feature": "analysis.features", "base_parameters": "analysis.features", "signal_features": "analysis.features",
    "read_record": "analysis.readers",
    "Record": "analysis.records", "RecordError": "analysis.records", "as_record": "analysis.records",
    "Run": "analysis.runs", "Sweep": "analysis.runs", "read_run": "analysis.runs", "read_sweep": "analysis.runs",
})  # fmt: skip
