"""What fell in the run of a stream, what broke of it, what left, and what `listen` heard of it, each computed once when
it is asked for."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import get_args

import numpy as np
import pandas as pd

from analysis import RecordError, Run
from analysis.files.readers import read_table
from analysis.sweep import breakage
from analysis.sweep.runs import fallen, true_ratio
from common.scene.stones import By
from recognition.stream.stones import sliding_ratio
from report.missing import MissingResult
from report.tables import FinishedTable

WINDOWS = 100  # of the sliding mixing ratio that are drawn
HEARD = "heard"  # the directory beside the run, as `make recognise` names it
HEARD_WINDOW_S, HEARD_STEP_S = 0.2, 0.01


@dataclass(frozen=True)
class HeardStream:
    """heard: a table of `sliding_ratio`, with `truth`, the share of gangue by mass in each window. heard_s: when stones
    were heard; alarm_s: when drawing should have stopped; stop: what was foreseen of its thresholds, where it was
    asked for."""

    heard: pd.DataFrame
    heard_s: np.ndarray
    alarm_s: np.ndarray
    stop: pd.DataFrame = field(default_factory=pd.DataFrame)

    @property
    def covered(self) -> float:
        """Share of the times with a ratio and a truth at which the truth is within the interval."""
        known = self.heard.dropna(subset=["truth", "mass_ratio"])
        return float(known["truth"].between(known["mass_low"], known["mass_high"]).mean())


class StreamResults:
    """The run of a stream. A result that it does not give raises RecordError or MissingResult."""

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
        return float(self.run.t_s[-1])

    @property
    def window_s(self) -> float:
        """Of the sliding ratio: a quarter of the run, and at most a second."""
        return float(f"{min(1.0, 0.25 * self.end_s):.1g}")

    def share(self, window_s: float, end_s: float, by: By = "mass") -> float:
        """True mixing ratio of the stones of a window; not a number where none came."""
        try:
            return true_ratio(self.touched, end_s - window_s, end_s, by)
        except RecordError:
            return np.nan

    def sliding_ratio(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Ends of the windows (k,), s, and the true mixing ratio in each, (k,) by mass and by number."""
        ends = np.linspace(self.window_s, self.end_s, WINDOWS)
        return ends, {by: np.array([self.share(self.window_s, end, by) for end in ends]) for by in get_args(By)}

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

    @property
    def was_heard(self) -> bool:
        """Whether `listen` left its stones beside the run."""
        return (self.run.path.parent / HEARD).is_dir()

    @cached_property
    def heard(self) -> HeardStream:
        """What was heard of the run. Raises MissingResult where nothing was, or where `listen` gave no ratio."""
        directory = self.run.path.parent / HEARD
        if not (directory / "ratio.parquet").is_file():
            raise MissingResult(f"no {HEARD}/ratio.parquet; `make recognise` makes one")
        if read_table(directory / "ratio.parquet")["ratio"].isna().all():
            raise MissingResult("`listen` did not trust the record and gave no ratio")
        stones = read_table(directory / "stones.parquet")
        heard = sliding_ratio(stones, HEARD_WINDOW_S, HEARD_STEP_S, self.end_s)
        truth = [self.share(HEARD_WINDOW_S, t_s) for t_s in heard["t_s"]]
        return HeardStream(heard.assign(truth=truth), stones["t_s"].to_numpy(),
                           stones["t_s"][stones.get("alarm", stones["t_s"] < 0)].to_numpy(),
                           read_table(stop) if (stop := directory / "stop.parquet").is_file() else pd.DataFrame())

    def numbers(self) -> list[tuple[str, str]]:
        """Value and words of each number of the first screen."""
        here = self.stones[self.stones["first_contact_s"].notna()]
        found = [(f"{len(here)} stone{'s' * (len(here) != 1)}",
                  f"{here['mass_kg'].sum():.3g} kg, in {self.end_s:.3g} s")]
        try:
            by_mass, by_number = (true_ratio(self.stones, -np.inf, np.inf, by) for by in get_args(By))
            found.append((f"{100 * by_mass:.1f} %", f"gangue by mass; {100 * by_number:.1f} % by number"))
        except RecordError as reason:
            found.append(("-", f"gangue: {reason}"))
        return [*found, (f"{1e-3 * self.run.peak('force_N'):.2f} kN", "largest force on the plate")]

    def table(self) -> FinishedTable:
        """The stones that came, by their material."""
        here = self.stones[self.stones["first_contact_s"].notna()]
        header = ["", "stones", "mass, kg", "mean diameter, mm", "largest force, kN", "broken area, cm²",
                  "left the plate, kg", "still there, kg"]
        rows = []
        for name, own in (("coal", here[~here["is_gangue"]]), ("gangue", here[here["is_gangue"]]), ("all", here)):
            mass, left = own["mass_kg"].sum(), own["left_mass_kg"].sum()
            most, size = (own["peak_force_N"].max(), own["radius_m"].mean()) if len(own) else (0.0, 0.0)
            rows.append([name, str(len(own)), f"{mass:.4g}", f"{2e3 * size:.1f}", f"{1e-3 * most:.2f}",
                         f"{1e4 * own['broken_area_m2'].sum():.3g}", f"{left:.4g}", f"{mass - left:.4g}"])
        chips = self.left["mass_kg"][self.left["is_chip"] & self.left["agglomerate"].isin(here["stone"])]
        rows.append(["of it small fragments", str(len(chips)), "", "", "", "", f"{chips.sum():.4g}", ""])
        return FinishedTable(f"{self.run.path.name}-stones", "Stones", self._closure(), header, rows)

    def _closure(self) -> str:
        energy, wall = self.run.summary.energy or {}, self.run.summary.wall_time_s
        took = f"The run took {sum(wall.values()):.0f} s." if wall else ""
        closes = f"Energy closes to {energy['closure']:.2g} of what came in." if "closure" in energy else ""
        return f"{closes} {took}".strip()
