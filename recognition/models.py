"""Whole models on run directories and records, and their file.

A saved model is JSON: numbers and names only, safe to load from a stranger, with a version
of its format and where it came from.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from analysis import RecordError
from analysis.features import BASE_PARAMETERS
from analysis.records import sample_rate_Hz
from analysis.runs import Run
from recognition.errors import NotRecognised, RecognitionError
from recognition.methods import CALIBRATED, METHODS, load_method
from recognition.physics.arrangement_likelihood import LISTENED_S, MISFIT
from recognition.regression.saved_likelihood import Recognition

FORMAT = "coal-gangue mixing ratio"
VERSION = 4

#: The window of the paper: 0..0.04 s at 1.5e-4 s.
WINDOW_S = 0.04

#: Different ratios that a model needs.
LEAST_RATIOS = 4


@dataclass(frozen=True)
class Window:
    """The samples that a model takes: so many at a rate, from the first of a record on."""

    rate_Hz: float
    n_samples: int

    @classmethod
    def of(cls, runs: list[Run]) -> Window:
        """The paper's 0.04 s, or as much of it as all runs have."""
        if not runs:
            raise RecognitionError(f"no runs; needs at least {LEAST_RATIOS} different mixing ratios")
        rate_Hz = runs[0].rate_Hz
        wanted = int(np.floor(WINDOW_S * rate_Hz * (1 + 1e-9))) + 1
        return cls(rate_Hz, min(wanted, *(run.t_s.size for run in runs)))

    def cut(self, signals: pd.DataFrame, source: str) -> pd.DataFrame:
        """The window of a record. RecordError if it is too short or has another sample rate."""
        if "t_s" not in signals.columns:
            raise RecordError(f"{source}: no column 't_s'; needs the time of each sample")
        rate_Hz = sample_rate_Hz(signals["t_s"].to_numpy(dtype=float), f"{source}: t_s")
        if not np.isclose(rate_Hz, self.rate_Hz, rtol=1e-3):
            raise RecordError(f"{source}: {rate_Hz:.6g} Hz; the model needs {self.rate_Hz:.6g} Hz")
        if len(signals) < self.n_samples:
            raise RecordError(
                f"{source}: {len(signals)} samples; the model needs {self.n_samples} from the impact on"
            )
        return signals.iloc[: self.n_samples]


@dataclass
class Model:
    """Methods fitted to the same runs at the same sample times; left_out: those that the runs do not allow, and why."""

    window: Window
    methods: dict
    provenance: dict = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    @classmethod
    def fit(cls, runs: list[Run], groups=None, conditions: pd.DataFrame | None = None) -> Model:
        """Fit every method to runs of known ratio.

        groups (runs,): runs of one draw of arrangement, packing ..., for the intervals; conditions: a row a run of what
        a record will not tell, such as its impact speed; those that do not vary are left out.
        """
        return cls._fit_prepared(runs, *prepare(runs), groups, conditions)

    @classmethod
    def _fit_prepared(cls, runs, window, prepared: dict[str, np.ndarray], left_out, groups=None, conditions=None, lessons=None):
        ratios = np.array([run.gangue_ratio for run in runs])
        if np.unique(ratios).size < LEAST_RATIOS:
            raise RecognitionError(f"{len(runs)} runs; needs at least {LEAST_RATIOS} different mixing ratios")
        nuisance, names = None, []
        if conditions is not None:
            names = [name for name in conditions if np.ptp(conditions[name]) > 0]
            nuisance = conditions[names].to_numpy(dtype=float) if names else None
        methods, left_out = {}, dict(left_out)
        for name, rows in prepared.items():
            how = {"groups": groups, "nuisance": nuisance} if name in CALIBRATED else {}
            if name == "stones":
                how["lessons"] = _lessons(runs) if lessons is None else lessons
            try:
                methods[name] = METHODS[name]().fit(rows, ratios, **how)
            except RecognitionError as reason:
                left_out[name] = str(reason)
        if not methods:
            raise RecognitionError("; ".join(dict.fromkeys(left_out.values())))
        provenance = {"runs": [_origin(run) for run in runs], "conditions": names,
                      "groups": 1 if groups is None else int(np.unique(groups).size)}
        return cls(window, methods, provenance, left_out)

    def best(self, signals: pd.DataFrame, source: str = "record") -> tuple[str, Recognition]:
        """The first method, in order of the evaluation, for which the record has the columns, and what it gives. Stones that
        fall on other places than in training are none of `stones`' business: it leaves records that it does not fit to the next.

        Raises RecordError for an unusable record, RecognitionError where no such method applies.
        """
        table, reasons, misfit = self.window.cut(signals, source), [], None
        # Of one draw the others do not learn what other arrangements do: the fewest features are the safest.
        order = list(CALIBRATED) if self.provenance.get("groups", 1) > 2 else ["stones", "impulse", "energies_rms", *CALIBRATED]
        for name in order:
            if name not in self.methods:
                continue
            try:
                found = _recognised(self.methods[name], table)
            except RecognitionError as reason:
                reasons.append(str(reason))
                continue
            if name != "stones" or MISFIT not in found.strange:
                return name, found
            misfit = name, found
        if misfit is None:
            raise RecognitionError(f"{source}: {'; '.join(reasons) or 'the model has no method with an interval'}")
        return misfit

    def strange(self, signals: pd.DataFrame, source: str = "record") -> dict[str, str]:
        """Of each method that can say so and finds the record unlike its training: why."""
        table, why = self.window.cut(signals, source), {}
        for name in CALIBRATED:
            with suppress(RecognitionError):
                why[name] = _recognised(self.methods[name], table).strange if name in self.methods else ""
        return {name: text for name, text in why.items() if text}

    def recognise(self, signals: pd.DataFrame, source: str = "record") -> dict[str, float | str]:
        """Mixing ratio by each method that the columns allow; a text where there is no answer.

        Raises RecordError for an unusable record, RecognitionError where no method applies.
        """
        table = self.window.cut(signals, source)
        answers = {name: _answer(method, table) for name, method in self.methods.items()}
        answers |= {name: f"not applicable: {reason}" for name, reason in self.left_out.items()}
        reasons = [answer for answer in answers.values() if isinstance(answer, str)]
        if len(reasons) == len(answers) and all(text.startswith("not applicable") for text in reasons):
            raise RecognitionError(f"{source}: {'; '.join(dict.fromkeys(reasons))}")
        return answers

    def save(self, path) -> None:
        """Write the model, whole or not at all."""
        path = Path(path)
        data = {
            "format": FORMAT,
            "version": VERSION,
            "provenance": self.provenance,
            "rate_Hz": self.window.rate_Hz,
            "n_samples": self.window.n_samples,
            "parameters": list(BASE_PARAMETERS),
            "methods": {name: method.to_dict() for name, method in self.methods.items()},
        }
        beside = path.with_name(path.name + ".part")
        beside.write_text(json.dumps(data, allow_nan=False, separators=(",", ":")))
        beside.replace(path)

    @classmethod
    def load(cls, path) -> Model:
        """Read a saved model. RecognitionError, one line, for anything else."""
        path = Path(path)
        try:
            data = json.loads(path.read_text())
        except (OSError, ValueError) as error:
            raise RecognitionError(f"{path}: not a readable model ({error})") from None
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise RecognitionError(f"{path}: format is not {FORMAT!r}")
        if data.get("version") != VERSION:
            raise RecognitionError(f"{path}: version = {data.get('version')!r}; this program reads {VERSION}")
        if data.get("parameters") != list(BASE_PARAMETERS):
            raise RecognitionError(
                f"{path}: parameters differ from this program's {', '.join(BASE_PARAMETERS)}"
            )
        try:
            methods = {name: load_method(name, saved) for name, saved in data["methods"].items()}
            if not methods:
                raise ValueError("no method")
            window = Window(float(data["rate_Hz"]), int(data["n_samples"]))
            provenance = data["provenance"]
            if not isinstance(provenance, dict) or not isinstance(provenance.get("groups"), int):
                raise TypeError("provenance must say from how many groups of runs")
            return cls(window, methods, provenance)
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
            raise RecognitionError(f"{path}: broken model ({type(error).__name__}: {error})") from None


def prepare(runs: list[Run]) -> tuple[Window, dict[str, np.ndarray], dict[str, str]]:
    """What each method takes of each run, stacked over the runs: independent of the training. Then the methods that lack
    a column of the runs, and which."""
    window = Window.of(runs)
    tables = [window.cut(run.signals, str(run.path)) for run in runs]
    prepared, left_out = {}, {}
    for name, make in METHODS.items():
        try:
            prepared[name] = np.stack([make().prepare(table) for table in tables])
        except RecognitionError as reason:
            left_out[name] = str(reason)
    if not prepared:
        raise RecognitionError("; ".join(dict.fromkeys(left_out.values())))
    return window, prepared, left_out


def leave_one_out(runs: list[Run]) -> list[dict[str, float | str]]:
    """Recognise each run by a model fitted to the runs of all other ratios.

    Returns one dict per run, as of `Model.recognise`. The ends (0 and 100 %) are then outside
    the training ratios: the answer is an extrapolation.
    """
    window, prepared, left_out = prepare(runs)
    lessons, answers = _lessons(runs), []
    for i, held_out in enumerate(runs):
        rest = [j for j, run in enumerate(runs) if run.gangue_ratio != held_out.gangue_ratio]
        chosen = {name: rows[rest] for name, rows in prepared.items()}
        model = Model._fit_prepared([runs[j] for j in rest], window, chosen, left_out, lessons=[lessons[j] for j in rest])
        answers.append({name: _answer(method, prepared[name][i]) for name, method in model.methods.items()}
                       | {name: f"not applicable: {reason}" for name, reason in model.left_out.items()})
    return answers


def _lessons(runs: list[Run]) -> list:
    from recognition.physics.force_records import (
        lessons_of,  # late: records are recognised without the simulation
    )

    return lessons_of(runs, LISTENED_S)


@contextmanager
def _fitting_numbers() -> Iterator[None]:
    """A model file may hold numbers that do not fit together: arrays of other shapes, or too large to calculate with.
    Raises RecognitionError."""
    try:
        yield
    except RecognitionError:
        raise
    except (ValueError, TypeError, IndexError, ArithmeticError, np.linalg.LinAlgError) as error:
        raise RecognitionError(f"the model's numbers do not fit together ({error})") from error


def _recognised(method, table: pd.DataFrame) -> Recognition:
    row = method.prepare(table)
    with _fitting_numbers():
        found = method.recognise(row)
        if not np.isfinite(found.ratio) or np.isnan([found.low, found.high]).any():
            raise ValueError(f"ratio {found.ratio}, interval {found.low} to {found.high}")
    return found


def _answer(method, record: pd.DataFrame | np.ndarray) -> float | str:
    """The ratio of a record's window, or of what `method.prepare` makes of it; else the reason."""
    try:
        row = method.prepare(record) if isinstance(record, pd.DataFrame) else record
        with _fitting_numbers():
            ratio = float(method.predict(row[None])[0])
            if not np.isfinite(ratio):
                raise ValueError(f"ratio {ratio}")
        return ratio
    except NotRecognised as reason:
        return f"no answer: {reason}"
    except RecognitionError as reason:
        return f"not applicable: {reason}"


def _origin(run: Run) -> dict:
    keep = ("scene_hash", "deck_hash", "versions", "seeds")
    known = {key: run.info[key] for key in keep if key in run.info}
    return {"directory": run.path.name, "gangue_ratio": run.gangue_ratio, **known}
