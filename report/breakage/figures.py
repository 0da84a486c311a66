"""Figures of breakage (Figures 13 to 15)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import NullFormatter

from analysis.sweep.breakage import Section
from report.drawing.lines import with_spread
from report.drawing.style import (
    ACCENT,
    COAL,
    DAMAGE_COLOURS,
    GANGUE,
    RATIO_LABEL,
    WIDTH_IN,
    bar_axes,
    canvas,
    hide_scales,
    material_colour,
    styled,
)


@styled
def sections(rows: list[tuple[str, list[Section], list[str]]], columns: int = 5) -> Figure:
    """Draw sections of stones, coloured by damage. rows: (label, sections, materials of the stones), each in as many
    lines of so many columns as it needs, below its label."""
    radius_m = max(float(np.max(np.abs(one.centre_m) + one.radius_m[:, None], initial=1e-6))
                   for _, found, _ in rows for one in found)
    cell_m, placed, top = 2.3 * radius_m, [], 0.0
    figure, axes = canvas(1, height_in=1.0, bar="bottom")
    axis = axes[0, 0]
    for label, found, materials in rows:
        axis.text(-0.5, top - 0.12, label, va="center")
        for k, one in enumerate(zip(found, materials, strict=True)):
            placed.append((*one, cell_m * np.array([k % columns, top - 0.75 - k // columns])))
        top -= -(-len(found) // columns) + 0.3
    for _, material, place in placed:
        left, bottom = place - 1.08 * radius_m
        axis.add_patch(Rectangle((left, bottom), 2.16 * radius_m, 2.16 * radius_m, fill=False, linewidth=1.1,
                                 edgecolor=material_colour(material)))  # fmt: skip
    for text in axis.texts:
        text.set_position((cell_m * text.get_position()[0], cell_m * text.get_position()[1]))
    axis.set(xlim=(-0.52 * cell_m, (columns - 0.48) * cell_m), ylim=(top * cell_m, 0.05 * cell_m))
    hide_scales(axis)
    axis.spines[:].set_visible(False)
    figure.set_size_inches(WIDTH_IN, 0.7 - top * (WIDTH_IN - 0.2) / columns)
    figure.colorbar(_discs(axis, [(section, place) for section, _, place in placed]), cax=bar_axes(figure),
                    orientation="horizontal", label="damage: broken share of a sub-sphere's bonds")
    return figure


def _discs(axis: Axes, placed: list[tuple[Section, np.ndarray]]) -> EllipseCollection:
    """Draw all sections as one image: thousands of discs would make the SVG large."""
    diameters = np.concatenate([2 * section.radius_m for section, _ in placed])
    discs = EllipseCollection(
        diameters, diameters, np.zeros_like(diameters), units="xy",
        offsets=np.concatenate([section.centre_m + place for section, place in placed]), transOffset=axis.transData,
        array=np.concatenate([section.damage for section, _ in placed]), cmap=DAMAGE_COLOURS, norm=Normalize(0, 1),
        edgecolor="none", rasterized=True)
    axis.add_collection(discs)
    return discs


@styled
def area_over_time(t_s: np.ndarray, area_m2: np.ndarray, is_gangue: np.ndarray) -> Figure:
    """Draw the crack area of each stone of one run. area_m2: shape (stones, times). is_gangue: shape (stones,)."""
    figure, axes = canvas(1, height_in=2.6)
    axis = axes[0, 0]
    for number, (row, gangue) in enumerate(zip(area_m2, is_gangue, strict=True), 1):
        axis.plot(1e3 * t_s, 1e4 * row, color=GANGUE if gangue else COAL, linewidth=0.9,
                  label=f"_stone {number}")
    axis.plot([], [], color=COAL, label="coal")
    axis.plot([], [], color=GANGUE, label="gangue")
    axis.set_xlabel("time, ms")
    axis.set_ylabel("crack area, cm²")
    axis.legend()
    return figure


@styled
def fragment_sizes(shares: dict[str, np.ndarray]) -> Figure:
    """Draw the share of the volume in fragments up to a size.

    shares: {material: volume of each fragment as a share of its stone, shape (fragments,)}.
    """
    figure, axes = canvas(1, height_in=2.6)
    axis = axes[0, 0]
    for material, volumes in shares.items():
        if volumes.size:
            volumes = np.sort(volumes)
            passing = np.cumsum(volumes) / volumes.sum()
            axis.step(volumes ** (1 / 3), 100 * passing, where="post", color=material_colour(material),
                      label=f"{material}, {volumes.size} piece{'s' * (volumes.size > 1)}")  # fmt: skip
    axis.set_xscale("log")
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xlabel("size of the fragment over that of the stone")
    axis.set_ylabel("volume in smaller pieces, %")
    axis.legend()
    return figure


@styled
def cracks(ratios: np.ndarray, counts: dict[str, dict[str, np.ndarray]]) -> Figure:
    """Draw bonds broken in tension and in shear against the ratio. counts: {material: {mode: shape (runs,)}}."""
    figure, axes = canvas(1, len(counts), height_in=2.4)
    for axis, (material, modes) in zip(axes[0], counts.items(), strict=True):
        for colour, (mode, values) in zip((ACCENT, GANGUE), modes.items(), strict=True):
            with_spread(axis, ratios, values, colour, mode)
        axis.set_title(f"broken bonds of {material}")
        axis.set_xlabel(RATIO_LABEL)
        axis.legend()
    return figure
