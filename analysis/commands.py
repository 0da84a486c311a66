"""What the commands on records answer: `features`."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from analysis.files.readers import read_record
from analysis.signals.features import Feature, features_of
from analysis.signals.records import Record, RecordError, clipped
from common.result import Result


@dataclass(frozen=True)
class FeaturesResult(Result):
    """Time-frequency parameters of a record by their names. left_out: why those of its IMFs are not among them.
    clipped: why the record is taken to be cut off at its ends, where it is."""

    record: str
    rate_Hz: float
    samples: int
    features: Mapping[str, Feature]
    left_out: str | None = None
    clipped: str | None = None

    def words(self) -> Iterator[str]:
        yield f"# {self.record}, {self.samples} samples at {self.rate_Hz:.6g} Hz"
        yield f"{'name':<28} {'value':>14}  unit"
        for feature in self.features.values():
            yield f"{feature.name:<28} {feature.value:>14.6g}  {feature.unit}"
        if self.left_out:
            yield f"left out: {self.left_out}"
        if self.clipped:
            yield f"warning: {self.clipped}"


def features(file: str, column: str | None = None, rate_Hz: float | None = None, scale: float = 1.0,
             unit: str | None = None, time: str | None = None, resample_Hz: float | None = None,
             anti_alias: bool = True) -> FeaturesResult:
    """Parameters of a record of a file, as `analysis.read_record` reads it, resampled first where a rate is given.
    Raises RecordError."""
    record = read_record(file, column=column, rate_Hz=rate_Hz, scale=scale, unit=unit, time=time)
    cut = _cut_off(record)  # once resampled, what is clipped is no longer level
    if resample_Hz is None and not anti_alias:
        raise RecordError("--no-filter: goes with --resample")
    if resample_Hz is not None:
        from analysis.signals.resampling import resample  # late: it takes longer than all else

        try:
            record = resample(record, resample_Hz, anti_alias=anti_alias)
        except RecordError as error:
            raise RecordError(f"--resample {resample_Hz:g}: {error}") from None
    found, left_out = features_of(record)
    return FeaturesResult(record.name, float(record.rate_Hz), record.values.size, found, left_out or None, cut)


def _cut_off(record: Record) -> str | None:
    """Why a record is taken to be cut off at an end. A force is 0 for long and not cut off there, and a digitised
    sine has at its ends 2.4 times the samples of the next level."""
    levels, counts = np.unique(record.values, return_counts=True)
    if len(levels) == 1:
        return None
    for last, inward in ((-1, -2), (0, 1)):
        stays = levels[last] != 0 and counts[last] > 3 * counts[inward]
        if stays and (why := clipped(record.values, levels[last], record.unit)):
            return why
    return None
