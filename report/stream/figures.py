"""The figures of a stream: what the plate felt, what fell over time, its pieces, and what was heard of it."""

import numpy as np
import pandas as pd
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from analysis import RecordError
from analysis.sweep.runs import true_ratio
from common.channels import ACCELEROMETERS
from common.scene.stones import KINDS
from report.drawing.figure_spec import Drawn, figure
from report.drawing.style import ACCENT, COAL, GANGUE, PALE, RATIO_LABEL, canvas, legend_above, material_colour
from report.missing import MissingResult
from report.response.figures import felt_by_plate
from report.stream.results import HEARD_WINDOW_S, StreamResults

POINTS = 2400  # of a curve


@figure("stream-heard", "What was heard",
        f"Mixing ratio by mass of the stones of the last {HEARD_WINDOW_S:g} s, from accelerometers with noise. The "
        "interval is that of the stones that were heard; it knows nothing of those that were missed.")
def heard(results: StreamResults) -> Drawn:
    found, fell_s = results.heard, results.touched["first_contact_s"].to_numpy()
    figure, axes = canvas(1, height_in=3.2)
    axis, table = axes[0, 0], found.heard
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
    figure, axes = canvas(1, height_in=2.6)
    axis, chosen = axes[0, 0], found[found["chosen"]]
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
        colour, t_s = material_colour(kind), own["first_contact_s"].to_numpy()
        come_kg = np.r_[0.0, own["mass_kg"].cumsum(), own["mass_kg"].sum()]  # a line also of one stone
        mass.step(np.r_[0.0, t_s, ends_s[-1]], come_kg, where="post", color=colour, label=kind)
        size.plot(t_s, 2e3 * own["radius_m"], "o", color=colour, markersize=3, label=kind)
    for (name, values), colour in zip(ratios.items(), (ACCENT, PALE), strict=True):
        ratio.plot(ends_s, 100 * values, color=colour, label=f"by {name}")
    ratio.axhline(100 * true_ratio(touched, -np.inf, np.inf), color=ACCENT, linewidth=0.7, linestyle=":",
                  label="whole stream, by mass")
    mass.set_title("mass that has come, kg")
    size.set_title("diameter of a stone, mm")
    ratio.set_title("gangue in the window before, %")
    mass.legend()
    ratio.set(ylim=(0, 130), yticks=range(0, 101, 25), xlabel="time, s")  # room for the legend
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
            if found.max() < 5 * found.min():  # no room for two marks of a logarithmic scale
                continue
            scale._set_axes_scale("log")
            scale.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=12))
            scale.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            scale.set_minor_formatter(NullFormatter())
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
