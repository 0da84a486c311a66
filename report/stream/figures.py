"""Figures of a stream: what the plate felt, what fell, and its pieces."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from report.drawing.style import ACCENT, PALE, canvas, legend_above, material_colour, styled

Curve = tuple[np.ndarray, np.ndarray]
KINDS = ("coal", "gangue")


@styled
def felt(panels: list[tuple[str, Curve]], touched: pd.DataFrame) -> Figure:
    """Draw signals over time, and a tick for the first touch of each stone. panels: (label, (t_s, values))."""
    figure, axes = canvas(len(panels), height_in=0.6 + 1.6 * len(panels), sharex=True)
    for axis, (label, (t_s, values)) in zip(axes[:, 0], panels, strict=True):
        axis.plot(t_s, values, color=ACCENT, linewidth=0.5, label="_" + label)
        axis.set_title(label)
    top = axes[0, 0]
    for name in KINDS:
        t_s = touched["first_contact_s"][touched["is_gangue"] == (name == "gangue")].to_numpy()
        top.plot(t_s, np.full(t_s.shape, -0.04 * top.get_ylim()[1]), "|", color=material_colour(name), markersize=6,
                 label=f"{name} comes")
    legend_above(top, 0.18, ncols=2)
    axes[-1, 0].set_xlabel("time, s")
    return figure


@styled
def fell(touched: pd.DataFrame, ends_s: np.ndarray, ratios: dict[str, np.ndarray], whole: float) -> Figure:
    """Draw what had come at each time: mass, diameters, and the mixing ratio in a sliding window."""
    figure, axes = canvas(3, height_in=5.4, sharex=True)
    mass, size, ratio = axes[:, 0]
    for name in KINDS:
        own = touched[touched["is_gangue"] == (name == "gangue")]
        colour, t_s = material_colour(name), own["first_contact_s"].to_numpy()
        come_kg = np.r_[0.0, own["mass_kg"].cumsum(), own["mass_kg"].sum()]  # a line also of one stone
        mass.step(np.r_[0.0, t_s, ends_s[-1]], come_kg, where="post", color=colour, label=name)
        size.plot(t_s, 2e3 * own["radius_m"], "o", color=colour, markersize=3, label=name)
    for (name, values), colour in zip(ratios.items(), (ACCENT, PALE), strict=True):
        ratio.plot(ends_s, 100 * values, color=colour, label=f"by {name}")
    ratio.axhline(100 * whole, color=ACCENT, linewidth=0.7, linestyle=":", label="whole stream, by mass")
    mass.set_title("mass that has come, kg")
    size.set_title("diameter of a stone, mm")
    ratio.set_title("gangue in the window before, %")
    mass.legend()
    ratio.set_ylim(0, 130)  # room for the legend
    ratio.set_yticks(range(0, 101, 25))
    ratio.legend(ncols=3, loc="upper left")
    ratio.set_xlabel("time, s")
    return figure


@styled
def hits(touched: pd.DataFrame) -> Figure:
    """Draw the peak force and the broken area of each stone against its mass."""
    figure, axes = canvas(1, 2, height_in=2.6)
    panels = (("peak force, kN", 1e-3 * touched["peak_force_N"]), ("broken area, cm²", 1e4 * touched["broken_area_m2"]))
    for axis, (label, values) in zip(axes[0], panels, strict=True):
        for name in KINDS:
            own = (touched["is_gangue"] == (name == "gangue")) & (values > 0)
            axis.plot(1e3 * touched["mass_kg"][own], values[own], "o", color=material_colour(name), markersize=3,
                      label=name)
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


@styled
def pieces(area: dict[str, Curve], left: dict[str, Curve], masses_kg: dict[str, np.ndarray] | None) -> Figure:
    """Draw broken area and mass that left over time, and the mass that is in pieces smaller than a mass."""
    figure, axes = canvas(3 if masses_kg else 2, height_in=5.2 if masses_kg else 3.6)
    titles = ("broken area, cm²", "mass that has left, kg")
    for axis, title, curves in zip(axes[:2, 0], titles, (area, left), strict=True):
        for (name, (t_s, values)), colour in zip(curves.items(), _colours(curves), strict=True):
            axis.step(t_s, values, where="post", color=colour, label=name)
        axis.set(title=title, xlabel="time, s")
        axis.legend()
    for name, mass in (masses_kg or {}).items():
        order = np.sort(mass)
        if len(order):
            axes[2, 0].step(1e3 * order, 100 * np.cumsum(order) / order.sum(), where="post",
                            color=material_colour(name), label=name)
    if masses_kg:
        axes[2, 0].set(title="mass in pieces that are no larger, %", xlabel="mass of a piece, g", xscale="log")
        axes[2, 0].xaxis.set_major_formatter("{x:g}")
        axes[2, 0].legend()
    return figure


def _colours(curves: dict[str, Curve]) -> list[str]:
    return [material_colour(name) if name in KINDS else colour
            for name, colour in zip(curves, (ACCENT, PALE), strict=False)]
