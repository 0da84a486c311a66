"""Pictures of breakage and of the plate's stress (Figures 13-15, 20, 21)."""

from __future__ import annotations

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize

from analysis.breakage import Section
from report.figures.style import ACCENT, COAL, GANGUE, WIDTH_IN, canvas, styled

DAMAGE_COLOURS = "inferno_r"


@styled
def sections(rows: list[tuple[str, list[Section], list[str]]], radius_m: float):
    """Sections of every agglomerate, coloured by damage; rows: (label, sections, materials)."""
    columns = len(rows[0][1])
    cell_in = WIDTH_IN / (columns + 1.5)
    figure, axes = canvas(len(rows), columns, height_in=cell_in * len(rows) * 1.12 + 0.5)
    for line, (label, found, materials) in zip(axes, rows, strict=True):
        for axis, piece, material in zip(line, found, materials, strict=True):
            _section(axis, piece, material, radius_m)
        line[0].set_ylabel(label, rotation=0, ha="right", va="center", fontsize=8)
    figure.colorbar(
        ScalarMappable(Normalize(0, 1), DAMAGE_COLOURS), ax=axes, orientation="horizontal", fraction=0.03,
        aspect=40, pad=0.02, label="damage: broken share of a sub-sphere's bonds",
    )  # fmt: skip
    return figure


def _section(axis, piece: Section, material: str, radius_m: float) -> None:
    diameters = 2 * piece.radius_m
    discs = EllipseCollection(
        diameters, diameters, np.zeros_like(diameters), units="xy", offsets=piece.centre_m,
        transOffset=axis.transData, array=piece.damage, cmap=DAMAGE_COLOURS, norm=Normalize(0, 1),
        edgecolor="none",
    )  # fmt: skip
    axis.add_collection(discs)
    axis.set_xlim(-1.1 * radius_m, 1.1 * radius_m)
    axis.set_ylim(-1.1 * radius_m, 1.1 * radius_m)
    axis.set_aspect("equal")
    axis.set_xticks([])
    axis.set_yticks([])
    axis.grid(False)
    for spine in axis.spines.values():
        spine.set_visible(True)
        spine.set_color(GANGUE if material == "gangue" else COAL)
        spine.set_linewidth(1.2)


@styled
def area_over_time(t_s: np.ndarray, area_m2: np.ndarray, gangue: np.ndarray):
    """Crack area of each agglomerate of one run; area_m2: shape (count, times)."""
    figure, axes = canvas(1, height_in=2.6)
    axis = axes[0, 0]
    for row, is_gangue in zip(area_m2, gangue, strict=True):
        axis.plot(1e3 * t_s, 1e4 * row, color=GANGUE if is_gangue else COAL, linewidth=0.9)
    axis.plot([], [], color=COAL, label="coal")
    axis.plot([], [], color=GANGUE, label="gangue")
    axis.set_xlabel("time, ms")
    axis.set_ylabel("crack area, cm²")
    axis.legend()
    return figure


@styled
def fragment_sizes(shares: dict[str, np.ndarray]):
    """Volume in fragments up to a size, over the volume of all; shares: {rock: sizes as shares of a stone}."""
    figure, axes = canvas(1, height_in=2.6)
    axis = axes[0, 0]
    for rock, sizes in shares.items():
        if sizes.size:
            sizes = np.sort(sizes)
            passing = np.cumsum(sizes) / sizes.sum()
            axis.step((sizes) ** (1 / 3), 100 * passing, where="post", color=GANGUE if rock == "gangue" else COAL,
                      label=f"{rock}, {sizes.size} pieces")  # fmt: skip
    axis.set_xscale("log")
    axis.set_xlabel("size of the fragment over that of the stone")
    axis.set_ylabel("volume in smaller pieces, %")
    axis.legend()
    return figure


@styled
def cracks(ratios: np.ndarray, counts: dict[str, dict[str, np.ndarray]]):
    """Tension and shear cracks against the ratio; counts: {rock: {mode: shape (n,)}}."""
    figure, axes = canvas(1, len(counts), height_in=2.4)
    for axis, (rock, modes) in zip(axes[0], counts.items(), strict=True):
        for colour, (mode, values) in zip((ACCENT, GANGUE), modes.items(), strict=True):
            axis.plot(100 * ratios, values, "o-", color=colour, markersize=3, label=mode)
        axis.set_title(f"broken bonds of {rock}")
        axis.set_xlabel("gangue mixing ratio, %")
        axis.legend()
    return figure


@styled
def stress_maps(lines_m, maps_Pa: list[np.ndarray], ratios: np.ndarray, points_m: np.ndarray):
    """Von Mises stress of the plate's surface for each ratio (Figure 21); maps_Pa: shape (nx, ny) each."""
    columns = 3
    rows = -(-len(ratios) // columns)
    figure, axes = canvas(rows, columns, height_in=1.75 * rows + 0.5)
    top = 1e-6 * max(field.max() for field in maps_Pa)
    for axis, field, ratio in zip(axes.ravel(), maps_Pa, ratios, strict=False):
        axis.pcolormesh(
            *lines_m, 1e-6 * field.T, cmap="jet", vmin=0, vmax=top, shading="gouraud", rasterized=True
        )
        axis.plot(*points_m.T, "w+", markersize=3)
        axis.set_title(f"{100 * ratio:.0f} %")
        axis.set_aspect("equal")
        axis.set_xticks([])
        axis.set_yticks([])
        axis.grid(False)
    for axis in axes.ravel()[len(ratios) :]:
        axis.set_visible(False)
    figure.colorbar(ScalarMappable(Normalize(0, top), "jet"), ax=axes, orientation="horizontal", fraction=0.03,
                    aspect=40, pad=0.02, label="von Mises stress, MPa")  # fmt: skip
    return figure
