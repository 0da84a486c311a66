"""What fell in the run of a stream, what broke of it and what left, each computed once when it is asked for."""

from __future__ import annotations

from functools import cached_property
from typing import get_args

import numpy as np
import pandas as pd

from analysis import RecordError, Run
from analysis.files.readers import read_table
from analysis.sweep import breakage
from analysis.sweep.runs import By, fallen, true_ratio

WINDOWS = 100  # of the sliding mixing ratio that are drawn


class StreamResults:
    """The run of a stream. A result that it does not give raises RecordError."""

    def __init__(self, run: Run):
        self.run = run

    @cached_property
    def stones(self) -> pd.DataFrame:
        """All stones, see `analysis.sweep.runs.fallen`."""
        return fallen(self.run)

    @cached_property
    def touched(self) -> pd.DataFrame:
        """Those that touched the plate, in the order in which they did."""
        stones = self.stones.dropna(subset="first_contact_s").sort_values("first_contact_s", ignore_index=True)
        if stones.empty:
            raise RecordError(f"{self.run.path}/stones.parquet: no stone touched the plate")
        return stones

    @cached_property
    def left(self) -> pd.DataFrame:
        """What was taken out, in order of time; `is_chip`: it was above the plate's face, as too small a fragment."""
        left = read_table(self.run.path / "left.parquet")
        return left.assign(is_chip=left["z_m"] > 0)

    @property
    def end_s(self) -> float:
        """End of the run."""
        return float(self.run.t_s[-1])

    @property
    def window_s(self) -> float:
        """Of the sliding ratio: a quarter of the run, and at most a second."""
        return float(f"{min(1.0, 0.25 * self.end_s):.1g}")

    def sliding_ratio(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Ends of the windows (k,), s, and the true mixing ratio in each, (k,) by mass and by number; where no stone
        came it is not a number."""
        ends = np.linspace(self.window_s, self.end_s, WINDOWS)

        def ratio(end: float, by: By) -> float:
            try:
                return true_ratio(self.touched, end - self.window_s, end, by)
            except RecordError:
                return float("nan")
        return ends, {by: np.array([ratio(end, by) for end in ends]) for by in get_args(By)}

    @cached_property
    def piece_masses_kg(self) -> dict[str, np.ndarray]:
        """Masses of the pieces at the end, of coal and of gangue: what had left as it left, and the rest as it is.
        Stones that were still to come are left out."""
        network = breakage.read_network(self.run)
        label = breakage.fragments(network, breakage.broken_bonds(self.run, network))
        first = np.unique(label, return_index=True)[1]
        stone = network.agglomerate[first] - 1
        share = network.volume_m3 / np.bincount(network.agglomerate, network.volume_m3)[network.agglomerate]
        mass = np.bincount(label, share * self.stones["mass_kg"].to_numpy()[network.agglomerate - 1])
        here = self.stones["first_contact_s"].notna().to_numpy()[stone]
        gangue = self.stones["is_gangue"].to_numpy()[stone]
        return {"coal": mass[here & ~gangue], "gangue": mass[here & gangue]}
