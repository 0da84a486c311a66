from analysis.files.readers import read_record as read_record
from analysis.signals.emd import Decomposition as Decomposition, decompose as decompose
from analysis.signals.features import (
    FEATURES as FEATURES,
    Feature as Feature,
    base_parameters as base_parameters,
    signal_features as signal_features,
)
from analysis.signals.hilbert import (
    HilbertSpectrum as HilbertSpectrum,
    MarginalSpectrum as MarginalSpectrum,
    hilbert_spectrum as hilbert_spectrum,
    instantaneous as instantaneous,
    marginal_spectrum as marginal_spectrum,
)
from analysis.signals.records import Record as Record, RecordError as RecordError, as_record as as_record
from analysis.signals.resampling import resample as resample
from analysis.sweep.runs import Run as Run, Sweep as Sweep, read_run as read_run, read_sweep as read_sweep
