"""Cracks, damage and fragments of the stones (Figures 13 to 15)."""

from functools import cached_property

import numpy as np

from analysis import Sweep
from analysis.sweep import breakage


class BreakageResults:
    """Breakage of every stone of every run. Raises RecordError for runs without bonds."""

    def __init__(self, sweep: Sweep):
        self._runs = sweep.runs

    @cached_property
    def draws_in_words(self) -> str:
        """How many runs of other packings, by seed or number of sub-spheres, each ratio has: without some a figure of
        breakage has no spread."""
        packings: dict[float, set[object]] = {}
        for run in self._runs:
            seeds = tuple(run.summary.seeds or ())
            packings.setdefault(run.gangue_ratio, set()).add((seeds, run.summary.n_particles))
        draws = min(map(len, packings.values()))
        return f"{draws} draws a ratio" if draws > 1 else "one draw: no spread known"

    @cached_property
    def networks(self) -> list[breakage.Network]:
        """Sub-spheres and bonds of each run before the impact."""
        return [breakage.read_network(run) for run in self._runs]

    @cached_property
    def first_collision_end_s(self) -> np.ndarray:
        """Time at which each stone's first collision ends, shape (runs, stones)."""
        return np.stack([breakage.first_collision_end_s(run) for run in self._runs])

    @cached_property
    def area_first_m2(self) -> np.ndarray:
        """Crack area of each stone after its first collision, shape (runs, stones)."""
        ends = self.first_collision_end_s
        return np.stack([breakage.broken_area_m2(run, end) for run, end in zip(self._runs, ends, strict=True)])

    @cached_property
    def area_end_m2(self) -> np.ndarray:
        """Crack area of each stone at the end of the run, shape (runs, stones)."""
        return np.stack([breakage.broken_area_m2(run) for run in self._runs])

    @property
    def damaged_volume_share(self) -> np.ndarray:
        """Damaged share of the volume of each stone at the end of the run, shape (runs, stones), 0..1."""
        pairs = zip(self._runs, self.networks, strict=True)
        return np.stack([breakage.damaged_volume_share(n, breakage.broken_bonds(run, n)) for run, n in pairs])

    def sections(self, index: int, until_s: float | np.ndarray) -> list[breakage.Section]:
        """Return the vertical section of each stone of run `index`, damaged as at a time (one, or one a stone)."""
        network = self.networks[index]
        damaged = breakage.damage(network, breakage.broken_bonds(self._runs[index], network, until_s))
        return [breakage.section(network, damaged, k) for k in range(1, network.agglomerate.max() + 1)]

    def fragment_shares(self, index: int) -> list[np.ndarray]:
        """Return the volumes of the fragments of each stone of run `index` at its end, as shares of the stone.

        There is one array a stone, the largest fragment first.
        """
        network = self.networks[index]
        return breakage.fragment_shares(network, breakage.broken_bonds(self._runs[index], network))
