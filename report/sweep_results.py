"""The results of one sweep over the mixing ratio, each computed once and only when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from analysis import RecordError, Sweep
from analysis.theory.contact_states import Setup, setup_of
from common.scene.stones import KINDS
from recognition.estimation.window import Window

Part = TypeVar("Part")


class SweepResults:
    """The runs of a sweep and what all chapters of the report need of them; `of` gives what one finds itself.

    The regular stream (`signals`) of each run is cut to the 0.04 s that recognition reads; the fast stream and the
    broken bonds are those of the whole run. Arrays over the runs are in order of the mixing ratio. A result that the
    runs do not give raises one of `MISSING_RESULT`, with a message of one line, when it is asked for.
    """

    def __init__(self, sweep: Sweep):
        window = Window.of(sweep.runs)
        self.sweep = replace(sweep, runs=[replace(run, signals=window.cut(run.signals, str(run.path)))
                                          for run in sweep.runs])
        self.runs, self.ratios = self.sweep.runs, self.sweep.ratios  # (runs,), 0..1
        self.t_s = self.runs[0].t_s  # of the regular stream, (samples,)
        self._parts: dict[Any, Any] = {}

    def of(self, part: Callable[[SweepResults], Part]) -> Part:
        """What the class of a chapter, such as `Breakage`, finds of the runs."""
        if part not in self._parts:
            self._parts[part] = part(self)
        return self._parts[part]

    @cached_property
    def setup(self) -> Setup:
        """Places, materials and supports of the first run. Raises RecordError if its scene does not hold them."""
        return setup_of(self.runs[0])

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

    def index_at(self, ratio: float) -> int:
        """Return the index of the run of a mixing ratio. Raises RecordError if there is no such run."""
        found = np.flatnonzero(np.abs(self.ratios - ratio) < 1e-6)
        if found.size == 0:
            raise RecordError(f"{self.sweep.path}: no run of {ratio:.0%} gangue")
        return int(found[0])

    def index_nearest(self, ratio: float) -> int:
        return int(np.argmin(np.abs(self.ratios - ratio)))

    def indices_coal_gangue_at_3(self) -> tuple[int, int]:
        """The last run with coal and the first with gangue at place 3, whose ratios are as near as can be. Raises
        RecordError if no run has coal or none has gangue there."""
        third = [run.materials[2] if len(run.materials) > 2 else None for run in self.runs]
        if "coal" not in third or "gangue" not in third:
            raise RecordError(f"{self.sweep.path}: no run has coal at place 3, or none gangue")
        return len(third) - 1 - third[::-1].index("coal"), third.index("gangue")

    @cached_property
    def is_gangue(self) -> np.ndarray:
        """Whether each stone is gangue, shape (runs, stones) of bool."""
        return np.array([[name == "gangue" for name in run.materials] for run in self.runs])

    def is_of(self, kind: str) -> np.ndarray:
        """Whether each stone is of a kind, shape (runs, stones) of bool."""
        return self.is_gangue == (kind == "gangue")

    @property
    def kinds(self) -> list[str]:
        """What fell in any run: coal, gangue or both."""
        return [kind for kind in KINDS if self.is_of(kind).any()]

    def mean_by_material(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Mean of values (runs, stones) over the coal and over the gangue of each run, (runs,) each, NaN where there is
        none."""
        with np.errstate(invalid="ignore"):
            return {kind: np.where(self.is_of(kind), values, 0.0).sum(axis=1) / self.is_of(kind).sum(axis=1)
                    for kind in KINDS}
