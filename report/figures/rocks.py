"""Figures of the shipped rocks in one impact."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from report.figures.style import ACCENT, COAL, GANGUE, GREEN, PALE, ROSE, VIOLET, YELLOW, canvas, hide_scales, styled
from report.results.rocks import StruckRock

COLOURS = {"soft coal": COAL, "hard coal": ACCENT, "gangue": GANGUE}
PIECES = ListedColormap([PALE, ACCENT, YELLOW, GREEN, ROSE, VIOLET, GANGUE, COAL])


@styled
def against_speed(rocks: list[StruckRock]) -> Figure:
    """Draw broken area and largest fragment of each rock against the speed of the impact."""
    figure, axes = canvas(1, 2, height_in=2.5)
    for axis, column, title in ((axes[0, 0], "broken_area_cm2", "broken area, cm²"),
                                (axes[0, 1], "largest_fragment", "largest fragment over the stone")):
        for rock in rocks:
            axis.plot(rock.impacts["speed_m_s"], rock.impacts[column], "o-", color=COLOURS[rock.name], markersize=3,
                      label=rock.name)  # fmt: skip
        axis.set_title(title)
        axis.set_xlabel("speed, m/s")
    axes[0, 0].legend()
    return figure


@styled
def slices(rocks: list[StruckRock], speed_m_s: float) -> Figure:
    """Draw the slice across the impact of each rock before the impact, a colour a fragment; the largest is grey."""
    figure, axes = canvas(1, len(rocks), height_in=2.6)
    for axis, rock in zip(axes[0], rocks, strict=True):
        cut, diameter = rock.slice, 2 * rock.slice["radius_mm"]
        rank = cut["fragment"]
        colour = np.where(rank == 0, 0, 1 + (rank - 1) % (PIECES.N - 1))
        axis.add_collection(EllipseCollection(
            diameter, diameter, np.zeros_like(diameter), units="xy", transOffset=axis.transData,
            offsets=np.column_stack([cut["x_mm"], cut["y_mm"]]), array=colour, cmap=PIECES,
            clim=(-0.5, PIECES.N - 0.5), edgecolor="white", linewidth=0.3))  # fmt: skip
        axis.autoscale_view()
        hide_scales(axis)
        axis.spines[:].set_visible(False)
        broken = rock.impacts.loc[rock.impacts["speed_m_s"] == speed_m_s, "broken_bonds"].item()
        axis.set_title(f"{rock.name}: {broken:.0f} of {rock.bonds} bonds break")
    return figure
