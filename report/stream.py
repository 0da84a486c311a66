"""The page of a stream: numbers, pictures and captions."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import get_args

import numpy as np
import pandas as pd

from analysis import RecordError, Run
from analysis.files.readers import read_table
from analysis.sweep import breakage
from analysis.sweep.runs import fallen, true_ratio
from common.channels import ACCELEROMETERS
from common.scene.stones import KINDS, By
from recognition.stream.stones import sliding_ratio
from report.drawing.figure_spec import Drawn, figure
from report.drawing.lines import make_logarithmic
from report.drawing.style import ACCENT, COAL, GANGUE, PALE, RATIO_LABEL, canvas, legend_above, material_colour, single
from report.missing import MissingResult
from report.response import felt_by_plate
from report.tables import FinishedTable, Number

WINDOWS = 100  # of the sliding mixing ratio that are drawn
HEARD = "heard"  # the directory beside the run, as `make recognise` names it
HEARD_WINDOW_S, HEARD_STEP_S = 0.2, 0.01
POINTS = 2400  # of a curve


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
        foreseen = directory / "stop.parquet"
        return HeardStream(heard.assign(truth=truth), stones["t_s"].to_numpy(),
                           stones["t_s"][stones.get("alarm", stones["t_s"] < 0)].to_numpy(),
                           read_table(foreseen) if foreseen.is_file() else pd.DataFrame())

    def numbers(self) -> list[Number]:
        """Of the first screen."""
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


@figure("stream-heard", "What was heard",
        f"Mixing ratio by mass of the stones of the last {HEARD_WINDOW_S:g} s, from accelerometers with noise. The "
        "interval is that of the stones that were heard; it knows nothing of those that were missed.")
def heard(results: StreamResults) -> Drawn:
    found, fell_s = results.heard, results.touched["first_contact_s"].to_numpy()
    (figure, axis), table = single(3.2), found.heard
    for t_s, height, colour, label in ((found.heard_s, 107, ACCENT, "a stone is heard"),
                                       (fell_s, -7, COAL, "a stone falls")):
        axis.plot(t_s, np.full(len(t_s), height), "|", color=colour, markersize=6, label=label)
    time_s = table["t_s"].to_numpy()
    low, middle, high = (100 * table[f"mass_{name}"].to_numpy() for name in ("low", "ratio", "high"))
    axis.fill_between(time_s, low, high, color=ACCENT, alpha=0.25, linewidth=0, label="90 % interval")
    axis.plot(time_s, middle, color=ACCENT, label="recognised")
    axis.plot(time_s, 100 * table["truth"], "--", color=COAL, label="truth")
    for k, t_s in enumerate(found.alarm_s):
        axis.axvline(t_s, color=GANGUE, linewidth=1, label=None if k else "alarm")
    axis.set(xlabel="time, s", ylabel=RATIO_LABEL, ylim=(-14, 170), yticks=range(0, 101, 25))  # room for the legend
    axis.legend(ncols=2, loc="upper left")
    return figure, (f"{len(found.heard_s)} stones were heard, {len(fell_s)} touched the plate. "
                    f"The truth is within the interval at {found.covered:.0%} of the times.")


@figure("stream-stop", "When to stop", "What is foreseen of an alarm: delay at the limit, false ones at half of it.")
def stop(results: StreamResults) -> Drawn:
    found = results.heard.stop
    if found.empty:
        raise MissingResult("`listen --stop-above` makes it")
    (figure, axis), chosen = single(2.6), found[found["chosen"]]
    axis.plot(found["false_alarms_1_h"], found["delay_s"], ".-", color=ACCENT, label="thresholds")
    axis.plot(chosen["false_alarms_1_h"], chosen["delay_s"], "o", color=GANGUE, label="chosen")
    axis.set(xlabel="false alarms an hour", ylabel="delay, s", xscale="log", yscale="log")
    axis.legend()
    return figure


@figure("stream-felt", "What the plate felt", "Fast stream. Ticks: first touch of each stone.")
def felt(results: StreamResults) -> Drawn:
    touched = results.touched
    sensors = [name for name in results.run.finest.columns if name.startswith(ACCELEROMETERS)][:1]
    figure, axes = felt_by_plate(results.run, {f"acceleration at {name[4:-5]}, m/s²": name for name in sensors},
                                 POINTS, 1.0)
    top = axes[0, 0]
    for kind in KINDS:
        t_s = touched["first_contact_s"][touched["is_gangue"] == (kind == "gangue")].to_numpy()
        top.plot(t_s, np.full(t_s.shape, -0.04 * top.get_ylim()[1]), "|", color=material_colour(kind), markersize=6,
                 label=f"{kind} comes")
    legend_above(top, 0.18, ncols=2)
    return figure


@figure("stream-fell", "What fell", "A stone counts from its first touch.")
def fell(results: StreamResults) -> Drawn:
    (ends_s, ratios), touched = results.sliding_ratio(), results.touched
    figure, axes = canvas(3, height_in=5.4, sharex=True)
    mass, size, ratio = axes[:, 0]
    for kind in KINDS:
        own = touched[touched["is_gangue"] == (kind == "gangue")]
        colour, t_s = material_colour(kind), own["first_contact_s"]
        mass.step(*_grown(t_s, own["mass_kg"], ends_s[-1]), where="post", color=colour, label=kind)
        size.plot(t_s, 2e3 * own["radius_m"], "o", color=colour, markersize=3, label=kind)
    for (name, values), colour in zip(ratios.items(), (ACCENT, PALE), strict=True):
        ratio.plot(ends_s, 100 * values, color=colour, label=f"by {name}")
    ratio.axhline(100 * true_ratio(touched, -np.inf, np.inf), color=ACCENT, linewidth=0.7, linestyle=":",
                  label="whole stream, by mass")
    mass.set_title("mass that has come, kg")
    size.set_title("diameter of a stone, mm")
    mass.legend()
    ratio.set(title="gangue in the window before, %", xlabel="time, s", ylim=(0, 130),  # room for the legend
              yticks=range(0, 101, 25))
    ratio.legend(ncols=3, loc="upper left")
    return figure, f"Window: {results.window_s:g} s."


@figure("stream-hits", "How hard each stone hit", "Largest force of each stone, and what broke of it until the end.")
def hits(results: StreamResults) -> Drawn:
    touched = results.touched
    figure, axes = canvas(1, 2, height_in=2.6)
    panels = (("peak force, kN", 1e-3 * touched["peak_force_N"]), ("broken area, cm²", 1e4 * touched["broken_area_m2"]))
    for axis, (label, values) in zip(axes[0], panels, strict=True):
        for kind in KINDS:
            own = (touched["is_gangue"] == (kind == "gangue")) & (values > 0)
            axis.plot(1e3 * touched["mass_kg"][own], values[own], "o", color=material_colour(kind), markersize=3,
                      label=kind)
        if not (values > 0).any():  # nothing broke: a logarithmic axis has nowhere to begin
            axis.set(title=f"{label}: none", xticks=[], yticks=[])
            continue
        axis.set(title=label, xlabel="mass, g")
        for scale, found in ((axis.xaxis, touched["mass_kg"]), (axis.yaxis, values[values > 0])):
            if found.max() >= 5 * found.min():  # else there is no room for two marks of a logarithmic scale
                make_logarithmic(scale)
    axes[0, 0].legend()
    return figure


@figure("stream-pieces", "The pieces",
        "Bonds that broke, what left the plate, and the pieces at the end of all stones that touched it.")
def pieces(results: StreamResults) -> Drawn:
    events, left, end_s = results.run.breakage, results.left, results.end_s
    gangue = results.stones["is_gangue"].to_numpy()[events["agglomerate"].to_numpy(dtype=int) - 1]
    try:
        masses_kg, note = {kind: mass for kind, mass in results.piece_masses_kg.items() if len(mass)}, ""
    except RecordError as reason:
        masses_kg, note = {}, f"Sizes not drawn: {reason}."
    figure, axes = canvas(3 if masses_kg else 2, height_in=5.2 if masses_kg else 3.6)
    panels = [("broken area, cm²", {kind: (material_colour(kind), own["t_s"], 1e4 * own["area_m2"]) for kind in KINDS
                                    for own in [events[gangue == (kind == "gangue")]]}),
              ("mass that has left, kg", {name: (colour, own["t_s"], own["mass_kg"]) for name, colour, chips in (
                  ("over the edge", ACCENT, False), ("small fragments", PALE, True))
                  for own in [left[left["is_chip"] == chips]]})]
    for axis, (title, curves) in zip(axes[:2, 0], panels, strict=True):
        for name, (colour, t_s, values) in curves.items():
            axis.step(*_grown(t_s, values, end_s), where="post", color=colour, label=name)
        axis.set(title=title, xlabel="time, s")
        axis.legend()
    for kind, mass in masses_kg.items():
        order = np.sort(mass)
        axes[2, 0].step(1e3 * order, 100 * np.cumsum(order) / order.sum(), where="post", color=material_colour(kind),
                        label=kind)
    if masses_kg:
        axes[2, 0].set(title="mass in pieces that are no larger, %", xlabel="mass of a piece, g", xscale="log")
        axes[2, 0].xaxis.set_major_formatter("{x:g}")
        axes[2, 0].legend()
    return figure, note


def _grown(t_s: pd.Series, values: pd.Series, end_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and sum of values that come one by one, from 0 s to the end of the run."""
    total = np.r_[0.0, np.cumsum(values.to_numpy())]
    return np.r_[0.0, t_s.to_numpy(), end_s], np.append(total, total[-1])


STREAM_FIGURES = [felt, fell, hits, pieces]
