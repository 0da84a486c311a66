"""The page of two runs or sweeps side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from matplotlib.figure import Figure

from common.files.output_directory import is_stamped, refuse_file, stamped
from common.files.whole import write_text
from common.resources import resource
from report.comparison.compare import MAIN_NUMBERS, Comparison, Curve, Pair, compare
from report.drawing.style import ACCENT, GANGUE, PALE, RATIO_LABEL, canvas, styled, to_uri


def write_comparison(a: Path, b: Path, out: Path | None = None) -> Path:
    """Compare two run directories or two directories of runs, and return the page that was written.

    Raises RecordError for directories that cannot be compared, InputError where this program did not write what it
    would replace, OSError where a file cannot be read or written.
    """
    out = out or page_of(a, b)
    refuse_file(str(out), is_stamped)
    write_text(out, stamped(render(compare(a, b))))
    return out


def page_of(a: Path, b: Path) -> Path:
    """Where the page is written unless another place is named."""
    return b.parent / f"compare_{a.name}_{b.name}.html"


def render(comparison: Comparison) -> str:
    """Return the page as HTML with everything inside it."""
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(resource("templates")), autoescape=True,
                                     undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"number": as_text, "percent": as_percent}
    pairs = comparison.pairs
    names = comparison.a.name, comparison.b.name
    if names[0] == names[1]:
        names = f"{names[0]} (A)", f"{names[1]} (B)"
    return environment.get_template("compare.html.j2").render(
        name_a=names[0], name_b=names[1], comparison=comparison, pairs=pairs, scene_rows=pairs[0].scene_rows(),
        main_numbers=[(title, unit, [pair.number(key) for pair in pairs]) for title, unit, key in MAIN_NUMBERS],
        ratios_uri=to_uri(draw_ratios(pairs, names), "ratios") if len(pairs) > 1 else "",
        figures=[_figures(pair, names) for pair in pairs])


def _figures(pair: Pair, names: tuple[str, str]) -> list[tuple[str, str]]:
    """Picture and caption of each curve of a pair."""
    return [(to_uri(draw_curve(curve, names), f"{pair.a.gangue_ratio}_{k}"),
             f"The root mean square of the difference is {as_percent(curve.percent_rms)} of that of {names[0]}.")
            for k, curve in enumerate(pair.curves())]


@styled
def draw_curve(curve: Curve, names: tuple[str, str]) -> Figure:
    """Draw both curves, and below them their difference in the same unit."""
    figure, axes = canvas(2, height_in=3.0, sharex=True)
    above, below = axes[:, 0]
    t_ms = 1e3 * curve.t_s
    above.plot(t_ms, curve.a, color=PALE, linewidth=1.8, label=as_label(names[0]))
    above.plot(t_ms, curve.b, color=ACCENT, linewidth=0.8, label=as_label(names[1]))
    above.set_title(curve.title)
    above.legend()
    below.plot(t_ms, curve.b - curve.a, color=GANGUE, linewidth=0.8)
    below.set_title(f"difference, {as_label(names[1])} - {as_label(names[0])}")
    below.set_xlabel("time, ms")
    below.set_xlim(t_ms[0], t_ms[-1])
    return figure


@styled
def draw_ratios(pairs: list[Pair], names: tuple[str, str]) -> Figure:
    """Draw the main numbers of both sweeps against the ratio."""
    figure, axes = canvas(2, 2, height_in=4.2)
    ratios = 100 * np.array([pair.a.gangue_ratio for pair in pairs])
    for axis, (title, unit, key) in zip(axes.ravel(), MAIN_NUMBERS, strict=True):
        rows = [pair.number(key) for pair in pairs]
        sides = (names[0], PALE, [row.a for row in rows]), (names[1], ACCENT, [row.b for row in rows])
        for name, colour, values in sides:
            known = [np.nan if value is None else value for value in values]
            axis.plot(ratios, known, "o-", color=colour, markersize=3, label=as_label(name))
        axis.set_title(f"{title}, {unit}" if unit else title)
    axes[0, 0].legend()
    for axis in axes[1]:
        axis.set_xlabel(RATIO_LABEL)
    return figure


def as_text(value: Any) -> str:
    """A value of a table: numbers to six digits, a missing one as a dash."""
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def as_label(name: str) -> str:
    """The name of a directory in a picture, where dollars would enclose a formula and a leading _ would hide it."""
    return ("\u200b" if name.startswith("_") else "") + name.replace("$", r"\$")


def as_percent(value: float | None) -> str:
    """A share in per cent to three digits, a missing one as a dash."""
    return "-" if value is None else f"{value:.3g} %"
