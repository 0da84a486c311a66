"""Two runs or two sweeps side by side: what differs in scene, counts, peaks, energies, error estimates and curves."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis import RecordError, Run, read_run, read_sweep

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
                ("peak acceleration of the plate", "m/s²", "plate.max_a_m_s2"),
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
        """b - a."""
        return self.b - self.a if _is_number(self.a) and _is_number(self.b) else None

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
        sides = [dict(_flat(run.info.get("scene", {}))) | dict(_flat(run.info.get("versions") or {}, "versions"))
                 for run in (self.a, self.b)]
        return [Row(key, sides[0].get(key), sides[1].get(key)) for key in {**sides[0], **sides[1]}
                if sides[0].get(key) != sides[1].get(key)]

    def groups(self) -> dict[str, list[Row]]:
        """The rows of each table of GROUPS, those that only one side has included."""
        found = {}
        for title, keys in GROUPS.items():
            sides = [dict(pair for key in keys for pair in _flat_numbers(run.info.get(key), key))
                     for run in (self.a, self.b)]
            found[title] = [Row(key, sides[0].get(key), sides[1].get(key)) for key in {**sides[0], **sides[1]}]
        return found

    def number(self, key: str) -> Row:
        """One of MAIN_NUMBERS."""
        values = [dict(_flat_numbers(run.info)).get(key) for run in (self.a, self.b)]
        return Row(key, *values)

    def curves(self) -> list[Curve]:
        """Force, and acceleration where both plates move: the impact from the fast stream where both have it, and the
        whole record."""
        found = []
        for column, title in (("force_N", "force on the plate, N"), ("a_m_s2", "acceleration of the plate, m/s²")):
            if column not in self.a.signals or column not in self.b.signals:
                continue
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


def compare(a: str | Path, b: str | Path) -> Comparison:
    """Pair the runs of two run directories or of two sweeps. Raises RecordError, in one line, for a directory that is
    neither, for one of each kind, and for sweeps without a common ratio."""
    a, b = Path(a), Path(b)
    if (a / "run.json").is_file() != (b / "run.json").is_file():
        run, other = (a, b) if (a / "run.json").is_file() else (b, a)
        raise RecordError(f"{other}: no run.json, but {run} is a run directory; needs two runs or two sweeps")
    if (a / "run.json").is_file():
        return Comparison(a, b, [Pair(read_run(a), read_run(b))], [], [], [])
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


def _flat(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys of nested tables; a list is one value, as text."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(inner, f"{key}.{name}" if key else name)
    else:
        yield key, json.dumps(value) if isinstance(value, list) else value


def _flat_numbers(value: Any, key: str = "") -> Iterator[tuple[str, float]]:
    return ((name, found) for name, found in _flat(value, key) if _is_number(found))


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
