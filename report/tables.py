"""Tables of the report."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from report.drawing.pages import to_csv
from report.film.packing import pack_text
from report.missing import MISSING_RESULT
from report.sweep_results import SweepResults

#: The header, and rows of text of which the first column names the row.
Cells = tuple[list[str], list[list[str]]]
#: One of the numbers of the first screen, and what it says in a few words.
Number = tuple[str, str]


@dataclass(frozen=True)
class FinishedTable:
    """A table as the page shows it; without rows where the runs do not give it, and the note then says why."""

    key: str
    title: str
    note: str
    header: list[str]
    rows: list[list[str]]

    @property
    def csv(self) -> str:
        return pack_text(to_csv([self.header, *self.rows]))


@dataclass(frozen=True)
class TableSpec:
    """A table to build. key: its id in the page. build: gives its cells from the results of a sweep."""

    key: str
    title: str
    note: str
    build: Callable[[SweepResults], Cells]

    def finished(self, results: SweepResults) -> FinishedTable:
        """The table for the page; an empty one says why where the runs do not give it."""
        try:
            header, rows = self.build(results)
        except MISSING_RESULT as reason:
            return FinishedTable(self.key, self.title, f"Not given: {reason}", [], [])
        return FinishedTable(self.key, self.title, self.note, header, rows)


def table(key: str, title: str, note: str = "") -> Callable[[Callable[..., Cells]], TableSpec]:
    """Make a table of the function below, which gives its cells."""
    return lambda build: TableSpec(key, title, note, build)


@table("table-1", "Elastic constants")
def materials(results: SweepResults) -> Cells:
    """Of what fell and of the plate, from the scene."""
    setup = results.setup
    shown = {kind: setup.rocks[kind] for kind in results.kinds} | {"plate": setup.plate}
    rows = [[name, f"{m.density_kg_m3:g}", f"{1e-9 * m.youngs_modulus_Pa:g}", f"{m.poisson_ratio:g}"]
            for name, m in shown.items()]
    return ["", "density, kg/m³", "E, GPa", "Poisson's ratio"], rows


@table("table-runs", "Runs")
def runs(results: SweepResults) -> Cells:
    """Sizes, peaks and wall time of each run; of the plate where it moves."""
    of_plate = ["peak kinetic, J", "RMS, m/s²"] if results.plate_moves else []
    rows = []
    for i, run in enumerate(results.runs):
        said = run.summary
        counts = (said.n_particles, said.n_bonds, said.n_bonds_broken)
        rows.append([f"{100 * run.gangue_ratio:.0f} %", *("-" if count is None else str(count) for count in counts),
                     f"{1e-3 * run.peak('force_N'):.2f}",
                     *([f"{run.peak('kinetic_J'):.4g}", f"{results.rms_m_s2[i]:.4g}"] if of_plate else []),
                     f"{(said.energy or {}).get('closure', np.nan):.1e}", f"{sum(said.wall_time_s.values()):.1f}"])
    return ["ratio", "particles", "bonds", "broken", "peak force, kN", *of_plate, "energy closes to",
            "wall time, s"], rows
