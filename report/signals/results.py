"""Time-frequency analysis of the plate's acceleration (Section IV, Figures 22 and 23)."""

from functools import cached_property

import numpy as np

from analysis import Sweep
from analysis.signals.emd import Decomposition, decompose
from analysis.signals.features import time_features
from analysis.signals.hilbert import marginal_spectrum
from report.missing import MissingResult


class SignalResults:
    """Parameters of each run's acceleration in the paper's window."""

    def __init__(self, sweep: Sweep):
        self._runs = sweep.runs

    @cached_property
    def decompositions(self) -> list[Decomposition]:
        """Intrinsic mode functions (IMFs) of each run. Raises MissingResult where a record is too short to have one."""
        found = [decompose(run.record("a_m_s2")) for run in self._runs]
        if not all(len(d.imfs) for d in found):
            raise MissingResult(f"records of {self._runs[0].t_s.size} samples are too short for an IMF")
        return found

    @cached_property
    def parameters(self) -> dict[str, np.ndarray]:
        """Parameters of Figure 23 but the energies of the IMFs, shape (runs,) each."""
        rows = [{f.name: f.value for f in time_features(run.record("a_m_s2"))} for run in self._runs]
        table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        energy = [marginal_spectrum(d, kind="energy").total for d in self.decompositions]
        return table | {"marginal_spectrum_energy": np.array(energy)}

    @cached_property
    def imf_energies(self) -> np.ndarray:
        """Energies of the IMFs in (m/s^2)^2 s, shape (runs, most IMFs); 0 where a run has fewer IMFs."""
        most = max(len(d.imfs) for d in self.decompositions)
        return np.stack([np.pad(d.energies, (0, most - len(d.imfs))) for d in self.decompositions])
