"""The page of two runs or two sweeps side by side: what differs in scene, counts, peaks, energies, error estimates and
curves."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from analysis import RecordError, Run, as_record, read_run, read_sweep
from analysis.sweep.run_table import dotted
from common.files.output_directory import is_stamped, refuse_file, stamped
from common.files.whole import write_text
from common.result import Result
from report.drawing.pages import rendered
from report.drawing.style import ACCENT, GANGUE, PALE, RATIO_LABEL, STYLE, canvas, to_uri

#: Keys of run.json that are compared number by number, by the title of their table; a table below a key counts with it.
GROUPS = {
    "Counts": ("n_particles", "n_bonds", "n_bonds_broken", "n_modes", "steps", "n_samples"),
    "Peaks": ("peak_force_N", "impulse_N_s", "plate", "yield"),
    "Energies": ("energy",),
    "Numerical settings and error estimates": ("dt_s", "co_step", "plate_energy_left_out", "expected_error"),
    "Wall time by stage, s": ("wall_time_s",),
}
#: What a sweep is compared by at every ratio: (title, unit, key of run.json).
MAIN_NUMBERS = (("peak force", "N", "peak_force_N"), ("bonds broken", "", "n_bonds_broken"),
                ("peak acceleration of the plate's centre of mass", "m/s²", "plate.max_a_m_s2"),
                ("peak energy of the plate", "J", "plate.max_total_J"))
IMPACT_s = 1e-3  # the curves of the fast stream


@dataclass(frozen=True)
class Row:
    """A number of both runs. `b` less `a` is None where one is missing."""

    key: str
    a: Any
    b: Any

    @property
    def difference(self) -> float | None:
        return None if self.a is None or self.b is None else self.b - self.a

    @property
    def percent(self) -> float | None:
        """Of a; None where a is 0."""
        return 100 * self.difference / abs(self.a) if self.difference is not None and self.a else None


@dataclass(frozen=True)
class Curve:
    """A signal of both runs at the times `t_s` (n,) of run A, as far as both have them: `a` and `b` (n,)."""

    title: str
    t_s: np.ndarray
    a: np.ndarray
    b: np.ndarray

    @property
    def percent_rms(self) -> float | None:
        """Root mean square of b - a over that of a, per cent; None where a is 0."""
        rms = float(np.sqrt(np.mean(self.a**2)))
        return 100 * float(np.sqrt(np.mean((self.b - self.a) ** 2))) / rms if rms else None


@dataclass(frozen=True)
class Pair:
    """A run of A and the run of B at the same mixing ratio."""

    a: Run
    b: Run

    def scene_rows(self) -> list[Row]:
        """The keys of scene and versions that differ, dotted; None where a side lacks one."""
        sides = [_values(run.info.get("scene", {})) | _values(run.info.get("versions") or {}, "versions.")
                 for run in (self.a, self.b)]
        return [row for row in _rows(*sides) if row.a != row.b]

    def groups(self) -> dict[str, list[Row]]:
        """The rows of each table of GROUPS, those that only one side has included."""
        return {title: _rows(*(_numbers({key: run.info.get(key) for key in keys}) for run in (self.a, self.b)))
                for title, keys in GROUPS.items()}

    def number(self, key: str) -> Row:
        """One of MAIN_NUMBERS."""
        return Row(key, *(_numbers(run.info).get(key) for run in (self.a, self.b)))

    def curves(self) -> list[Curve]:
        """Force, and acceleration where both plates move: the impact from the fast stream where both have it, and the
        whole record. Raises RecordError for a sample that is not finite."""
        found = []
        for column, title in (("force_N", "force on the plate, N"),
                              ("a_m_s2", "acceleration of the plate's centre of mass, m/s²")):
            if column not in self.a.signals or column not in self.b.signals:
                continue
            for run in (self.a, self.b):
                for name, table in (("signals", run.signals), ("fast", run.fast)):
                    if table is not None:  # a Record refuses what is not finite
                        as_record(table[column].to_numpy(), 1.0, name=f"{run.path}/{name}.parquet: {column}")
            if self.a.fast is not None and self.b.fast is not None:
                found.append(_curve(title, column, self.a.fast, self.b.fast, IMPACT_s))
            found.append(_curve(title, column, self.a.signals, self.b.signals, np.inf))
        return found


@dataclass(frozen=True)
class Comparison:
    """Pairs of runs in order of their ratio; `only_a` and `only_b` are ratios that the other side lacks."""

    a: Path
    b: Path
    pairs: list[Pair]
    only_a: list[float]
    only_b: list[float]
    passed_over: list[str]


def compared(a: str | Path, b: str | Path) -> Comparison:
    """Pair the runs of two run directories or of two sweeps. Raises RecordError, in one line, for a directory that is
    neither, for one of each kind, and for sweeps without a common ratio."""
    a, b = Path(a), Path(b)
    are_runs = [(path / "run.json").is_file() for path in (a, b)]
    if all(are_runs):
        return Comparison(a, b, [Pair(read_run(a), read_run(b))], [], [], [])
    if any(are_runs):
        run, other = (a, b) if are_runs[0] else (b, a)
        raise RecordError(f"{other}: no run.json, but {run} is a run directory; needs two runs or two sweeps")
    sweeps = [read_sweep(path, expected=()) for path in (a, b)]
    runs = [{round(run.gangue_ratio, 6): run for run in sweep.runs} for sweep in sweeps]
    common = sorted(set(runs[0]) & set(runs[1]))
    if not common:
        raise RecordError(f"{a} and {b}: no mixing ratio that both have; needs one at least")
    return Comparison(a, b, [Pair(runs[0][ratio], runs[1][ratio]) for ratio in common],
                      sorted(set(runs[0]) - set(runs[1])), sorted(set(runs[1]) - set(runs[0])),
                      [reason.replace(f"{sweep.path}/", "") for sweep in sweeps for reason in sweep.passed_over])


def _curve(title: str, column: str, a: pd.DataFrame, b: pd.DataFrame, until_s: float) -> Curve:
    times = [table["t_s"].to_numpy(dtype=float) for table in (a, b)]
    end = min(until_s, times[0][-1], times[1][-1]) * (1 + 1e-9)
    here = times[0] <= end
    of_b = np.interp(times[0][here], times[1], b[column].to_numpy(dtype=float))
    return Curve(title, times[0][here], a[column].to_numpy(dtype=float)[here], of_b)


def _values(table: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """By dotted key; a list is one value, as text."""
    return {key: json.dumps(value) if isinstance(value, list) else value for key, value in dotted(table, above)}


def _numbers(table: Mapping[str, Any]) -> dict[str, float]:
    return {key: value for key, value in dotted(table)
            if isinstance(value, (int, float)) and not isinstance(value, bool)}


def _rows(a: Mapping[str, Any], b: Mapping[str, Any]) -> list[Row]:
    return [Row(key, a.get(key), b.get(key)) for key in {**a, **b}]


@dataclass(frozen=True)
class ComparisonResult(Result):
    line = "comparison written to {page}"
    page: Path


def compare(a: Path, b: Path, out: Path | None = None) -> ComparisonResult:
    """Write the page of what differs between two run directories or two directories of runs.

    Raises RecordError for directories that cannot be compared, InputError where this program did not write what it
    would replace, OSError where a file cannot be read or written.
    """
    out = out or b.parent / f"compare_{a.name}_{b.name}.html"
    refuse_file(str(out), is_stamped, ".html")
    write_text(out, stamped(render(compared(a, b))))
    return ComparisonResult(out)


def render(comparison: Comparison) -> str:
    pairs = comparison.pairs
    names = comparison.a.name, comparison.b.name
    if names[0] == names[1]:
        names = f"{names[0]} (A)", f"{names[1]} (B)"
    with matplotlib.rc_context(STYLE):
        ratios_uri = to_uri(draw_ratios(pairs, names), "ratios") if len(pairs) > 1 else ""
        figures = [_figures(pair, names) for pair in pairs]
    return rendered(
        "compare.html.j2", {"number": as_text, "percent": as_percent},
        name_a=names[0], name_b=names[1], comparison=comparison, pairs=pairs, scene_rows=pairs[0].scene_rows(),
        main_numbers=[(title, unit, [pair.number(key) for pair in pairs]) for title, unit, key in MAIN_NUMBERS],
        ratios_uri=ratios_uri, figures=figures)


def _figures(pair: Pair, names: tuple[str, str]) -> list[tuple[str, str]]:
    return [(to_uri(draw_curve(curve, names), f"{pair.a.gangue_ratio}_{k}"),
             f"The root mean square of the difference is {as_percent(curve.percent_rms)} of that of {names[0]}.")
            for k, curve in enumerate(pair.curves())]


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
    below.set(title=f"difference, {as_label(names[1])} - {as_label(names[0])}", xlabel="time, ms", xlim=t_ms[[0, -1]])
    return figure


def draw_ratios(pairs: list[Pair], names: tuple[str, str]) -> Figure:
    """Draw the main numbers of both sweeps against the ratio."""
    figure, axes = canvas(2, 2, height_in=4.2)
    ratios = 100 * np.array([pair.a.gangue_ratio for pair in pairs])
    for axis, (title, unit, key) in zip(axes.ravel(), MAIN_NUMBERS, strict=True):
        values = np.array([(row.a, row.b) for row in (pair.number(key) for pair in pairs)], dtype=float)  # None: NaN
        for name, colour, of_side in zip(names, (PALE, ACCENT), values.T, strict=True):
            axis.plot(ratios, of_side, "o-", color=colour, markersize=3, label=as_label(name))
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
