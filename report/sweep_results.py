"""The results of one sweep over the mixing ratio, each computed once and only when it is asked for."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from analysis import RecordError, Run, Sweep
from recognition.estimation.window import Window
from report.breakage.results import BreakageResults
from report.response.results import PlateResults
from report.signals.results import SignalResults
from report.theory.results import TheoryResults

if TYPE_CHECKING:
    from report.recognition.results import RecognitionResults


class SweepResults:
    """The runs of a sweep and what the chapters of the report need of them.

    The regular stream (`signals`) of each run is cut to the 0.04 s that recognition reads; the fast stream and the
    broken bonds are those of the whole run. Arrays over the runs are in order of the mixing ratio. A result that the
    runs do not give raises one of `MISSING_RESULT`, with a message of one line, when it is asked for.
    """

    def __init__(self, sweep: Sweep):
        window = Window.of(sweep.runs)
        self.sweep = replace(sweep, runs=[replace(run, signals=window.cut(run.signals, str(run.path)))
                                          for run in sweep.runs])
        self.ratios = self.sweep.ratios  # (runs,), 0..1
        self.plate = PlateResults(self.sweep)
        self.theory = TheoryResults(self.sweep, self.plate)
        self.breakage = BreakageResults(self.sweep)
        self.signals = SignalResults(self.sweep)

    @cached_property
    def recognition(self) -> RecognitionResults:
        """What every method of recognition says of the runs."""
        from report.recognition.results import RecognitionResults  # late: its libraries take a second to import

        return RecognitionResults(self.sweep, self.signals)

    @cached_property
    def plate_moves(self) -> bool:
        """Have all runs the response of a flexible plate?"""
        return all("a_m_s2" in run.signals for run in self.runs)

    @cached_property
    def rms_m_s2(self) -> np.ndarray:
        """Of the acceleration of the plate's centre of mass, shape (runs,)."""
        return np.array([np.sqrt(np.mean(run.record("a_m_s2").values**2)) for run in self.runs])

    def extremes(self, column: str) -> np.ndarray:
        """Largest and smallest value of a column, from the fast stream where it has it, shape (runs, 2)."""
        return np.array([run.extremes(column) for run in self.runs])

    @property
    def runs(self) -> list[Run]:
        return self.sweep.runs

    @property
    def t_s(self) -> np.ndarray:
        """Times of the regular stream, shape (samples,)."""
        return self.runs[0].t_s

    def index_at(self, ratio: float) -> int:
        """Return the index of the run of a mixing ratio. Raises RecordError if there is no such run."""
        found = np.flatnonzero(np.abs(self.ratios - ratio) < 1e-6)
        if found.size == 0:
            raise RecordError(f"{self.sweep.path}: no run of {ratio:.0%} gangue")
        return int(found[0])

    def index_nearest(self, ratio: float) -> int:
        return int(np.argmin(np.abs(self.ratios - ratio)))

    def indices_coal_gangue_at_3(self) -> tuple[int, int]:
        """Return the last run with coal and the first with gangue at place 3, whose ratios are as near as can be.

        Raises RecordError if no run has coal or none has gangue there.
        """
        third = [run.materials[2] if len(run.materials) > 2 else None for run in self.runs]
        if "coal" not in third or "gangue" not in third:
            raise RecordError(f"{self.sweep.path}: no run has coal at place 3, or none gangue")
        return len(third) - 1 - third[::-1].index("coal"), third.index("gangue")

    @cached_property
    def is_gangue(self) -> np.ndarray:
        """Whether each stone is gangue, shape (runs, stones) of bool."""
        return np.array([[name == "gangue" for name in run.materials] for run in self.runs])

    @property
    def kinds(self) -> list[str]:
        """What fell in any run: coal, gangue or both."""
        return [name for name, one in (("coal", False), ("gangue", True)) if np.any(self.is_gangue == one)]

    def mean_by_material(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Return the mean over the coal and over the gangue stones of each run, shape (runs,) each.

        values: shape (runs, stones). The mean is NaN where a run has no stone of the material.
        """
        means = {}
        for name, chosen in (("coal", ~self.is_gangue), ("gangue", self.is_gangue)):
            count = chosen.sum(axis=1)
            with np.errstate(invalid="ignore"):
                means[name] = np.where(chosen, values, 0.0).sum(axis=1) / count
        return means
