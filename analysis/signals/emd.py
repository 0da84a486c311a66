"""Empirical mode decomposition (Huang et al. 1998) by PyEMD, with a named stopping rule.

The sifting of PyEMD compares sums with absolute thresholds, so that the number of intrinsic mode functions (IMFs) would
depend on the unit. Here a signal is scaled to unit standard deviation first and scaled back afterwards, which gives the
same result in any unit.
"""

from dataclasses import dataclass

import numpy as np

from analysis.signals.records import Record, RecordError, Signal, as_record
from common.by_value import ByValue

#: Stopping rules of the sifting, by name, with PyEMD's arguments for each.
#: fixed_10: ten siftings for every IMF (Wu and Huang 2009), the fastest, whose cost is linear in the length.
#: s_number_5: until extrema and zero crossings differ by at most one in five siftings in a row (Huang et al. 2003).
#: energy_change: PyEMD's own default, a Cauchy-like test on the change of one sifting.
STOPPING_RULES: dict[str, dict[str, int]] = {"fixed_10": {"FIXE": 10}, "s_number_5": {"FIXE_H": 5}, "energy_change": {}}

DEFAULT_RULE = "fixed_10"

#: Up to this length extrema are taken at the vertex of a parabola through three samples, which is seven times as exact
#: at seven samples a period. Beyond it they are taken at the samples themselves, because PyEMD's parabolas lose digits
#: with the cube of the length.
PARABOLIC_UP_TO = 10_000

#: Each IMF is about half as fast as the one before. What is slower than about rate / 2^12 (24 Hz at 100 kHz) stays in
#: the residue. Records of up to 4000 samples have no more IMFs than this.
MOST_IMFS = 12

#: Of a record, whose decomposition then takes 4 GB and some minutes.
MOST_SAMPLES = 10_000_000


@dataclass(frozen=True, eq=False)
class Decomposition(ByValue):
    """The m IMFs (m, n) of a record, finest first, and the residue (n,), in the unit of the record.

    Their sum is the record.

    >>> found = decompose(Record(np.sin(np.arange(400.0)) + 0.01 * np.arange(400.0), rate_Hz=1000.0))
    >>> bool(np.allclose(found.imfs.sum(axis=0) + found.residue, found.record.values))
    True
    """

    imfs: np.ndarray
    residue: np.ndarray
    record: Record
    rule: str

    @property
    def energies(self) -> np.ndarray:
        """Integral of each IMF squared over time (m,), unit^2 s."""
        return np.sum(self.imfs**2, axis=1) / self.record.rate_Hz


def decompose(signal: Signal, rule: str = DEFAULT_RULE) -> Decomposition:
    """Decompose a signal, of which `as_record` makes a record, into intrinsic mode functions.

    Raises RecordError for an unknown rule, a constant record, or more than MOST_SAMPLES samples.

    >>> fast, slow = np.sin(2 * np.pi * 90 * np.arange(1000) / 1e3), np.sin(2 * np.pi * 5 * np.arange(1000) / 1e3)
    >>> imf = decompose(Record(fast + slow, rate_Hz=1000.0)).imfs[0]
    >>> bool(abs(imf - fast)[100:-100].max() < 0.05)
    True
    """
    from analysis.signals.sifting import LeanEMD  # late: PyEMD is slow to import

    record = as_record(signal)
    if rule not in STOPPING_RULES:
        raise RecordError(f"{record.name}: stopping rule {rule!r}; choose one of {', '.join(STOPPING_RULES)}")
    if record.values.size > MOST_SAMPLES:
        raise RecordError(f"{record.name}: {record.values.size} samples; EMD takes at most {MOST_SAMPLES:.0e}: take a "
                          "part, or resample to a lower rate")
    offset, scale = record.values.mean(), record.values.std()
    if scale == 0:
        raise RecordError(f"{record.name}: standard deviation {scale:g}; EMD needs a changing signal")
    extrema = "parabol" if record.values.size <= PARABOLIC_UP_TO else "simple"
    emd = LeanEMD(extrema_detection=extrema, **STOPPING_RULES[rule])
    emd.emd((record.values - offset) / scale, max_imf=MOST_IMFS)
    imfs, residue = emd.get_imfs_and_residue()
    imfs = np.asarray(imfs).reshape(-1, record.values.size)
    return Decomposition(imfs * scale, np.asarray(residue) * scale + offset, record, rule)
