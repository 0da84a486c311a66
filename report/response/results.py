"""Largest values of the plate's response and of the contact force (Figures 16 to 19)."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from analysis import Sweep
from common.channels import RESPONSES


class ResponseResults:
    """Largest values in each run, from the fast stream where it has the column.

    A contact lasts about 1.5 samples of the regular stream, which misses its peak.
    """

    def __init__(self, sweep: Sweep):
        self._sweep = sweep

    @cached_property
    def peaks(self) -> dict[str, np.ndarray]:
        """Largest absolute value of the six responses and of the total force, shape (runs,) each, in SI units."""
        return {name: self._sweep.peaks(name) for name in (*RESPONSES, "force_N")}

    @cached_property
    def extremes(self) -> dict[str, np.ndarray]:
        """Largest and smallest displacement, velocity and acceleration, shape (runs, 2) each, in SI units."""
        return {name: np.array([run.extremes(name) for run in self._sweep.runs]) for name in ("u_m", "v_m_s", "a_m_s2")}
