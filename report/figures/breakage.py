"""Figures of breakage (Figures 13 to 15)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from analysis.breakage import Section
from report.figures.style import (
    ACCENT,
    COAL,
    GANGUE,
    RATIO_LABEL,
    WIDTH_IN,
    canvas,
    hide_scales,
    material_colour,
    styled,
)

DAMAGE_COLOURS = "inferno_r"


@styled
def sections(rows: list[tuple[str, list[Section], list[str]]], radius_m: float) -> Figure:
    """Draw sections of every stone, coloured by damage. rows: (label, sections, materials of the stones)."""
    columns = len(rows[0][1])
    cell_in = WIDTH_IN / (columns + 1.5)
    figure, axes = canvas(len(rows), columns, height_in=cell_in * len(rows) * 1.12 + 0.5)
    for line, (label, found, materials) in zip(axes, rows, strict=True):
        for axis, section, material in zip(line, found, materials, strict=True):
            _draw_section(axis, section, material, radius_m)
        line[0].set_ylabel(label, rotation=0, ha="right", va="center", fontsize=8)
    figure.colorbar(
        ScalarMappable(Normalize(0, 1), DAMAGE_COLOURS), ax=axes, orientation="horizontal", fraction=0.03,
        aspect=40, pad=0.02, label="damage: broken share of a sub-sphere's bonds",
    )  # fmt: skip
    return figure


def _draw_section(axis: Axes, section: Section, material: str, radius_m: float) -> None:
    diameters = 2 * section.radius_m
    discs = EllipseCollection(
        diameters, diameters, np.zeros_like(diameters), units="xy", offsets=section.centre_m,
        transOffset=axis.transData, array=section.damage, cmap=DAMAGE_COLOURS, norm=Normalize(0, 1),
        edgecolor="none",
    )  # fmt: skip
    axis.add_collection(discs)
    axis.set_xlim(-1.1 * radius_m, 1.1 * radius_m)
    axis.set_ylim(-1.1 * radius_m, 1.1 * radius_m)
    hide_scales(axis)
    for spine in axis.spines.values():
        spine.set_visible(True)
        spine.set_color(material_colour(material))
        spine.set_linewidth(1.2)


@styled
def area_over_time(t_s: np.ndarray, area_m2: np.ndarray, is_gangue: np.ndarray) -> Figure:
    """Draw the crack area of each stone of one run. area_m2: shape (stones, times). is_gangue: shape (stones,)."""
    figure, axes = canvas(1, height_in=2.6)
    axis = axes[0, 0]
    for row, gangue in zip(area_m2, is_gangue, strict=True):
        axis.plot(1e3 * t_s, 1e4 * row, color=GANGUE if gangue else COAL, linewidth=0.9)
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
                      label=f"{material}, {volumes.size} pieces")  # fmt: skip
    axis.set_xscale("log")
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
            axis.plot(100 * ratios, values, "o-", color=colour, markersize=3, label=mode)
        axis.set_title(f"broken bonds of {material}")
        axis.set_xlabel(RATIO_LABEL)
        axis.legend()
    return figure
