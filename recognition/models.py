"""Whole models on run directories and records, and their file.

A saved model is JSON: numbers and names only, safe to load from a stranger, with a version
of its format and where it came from. A table of the file has exactly the fields of its dataclass. Numbers must be
finite and of their type; nothing is converted or filled in.
"""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Self, TypeVar, get_args, get_origin

import numpy as np
import pandas as pd
from cattrs import Converter
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

from analysis.signals.features import BASE_PARAMETERS
from analysis.signals.records import RecordError
from analysis.sweep.runs import Run
from common.channels import ACCELEROMETERS
from common.files.whole import is_sealed, seal, write_text
from common.input_error import raised_as, refuse_unreadable
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import Groups, Method
from recognition.estimation.window import LEAST_RATIOS, Window
from recognition.methods import METHODS
from recognition.physics.arrangement_method import ArrangementLikelihood
from recognition.plate.plate_model import PlateModel
from recognition.regression.feature_regression import FeatureRegression
from recognition.sensors.channel_check import channel_faults, samples_before_impact

T = TypeVar("T")


def _array(data: Any, of: Any) -> Any:
    """An array of the kind of number that its type names."""
    kind = np.dtype(get_args(get_args(of)[1])[0])
    found = np.array(data)
    if found.size == 0 or found.dtype.kind not in ("iu" if kind.kind == "i" else "iuf") or not np.isfinite(found).all():
        raise ValueError(f"an array of finite {kind.name} is needed")
    return found.astype(kind)


def _exactly(data: Any, of: type[T]) -> T:
    if type(data) is not of:
        raise TypeError(f"{data!r:.40} is not of type {of.__name__}")
    return data


def _float(data: Any, _: type) -> float:
    if isinstance(data, bool) or not isinstance(data, (int, float)) or not math.isfinite(data):
        raise TypeError(f"{data!r:.40} is not a finite number")
    return float(data)


def _structure(of: type) -> Callable[[Any, Any], Any]:
    names = {field.name for field in fields(of)}
    inner: Any = make_dict_structure_fn(of, _converter, _cattrs_include_init_false=True,
                                        _cattrs_detailed_validation=False)

    def structure(data: Any, _: Any) -> Any:
        if not isinstance(data, dict) or set(data) != names:
            raise ValueError(f"{of.__name__} needs {', '.join(sorted(names))}")
        return inner(data, of)

    return structure


def _unstructure(of: type) -> Callable[[Any], Any]:
    shortened: dict[str, Any] = {field.name: override(unstruct_hook=_to_digits(field.metadata["digits"]))
                                 for field in fields(of) if "digits" in field.metadata}
    hook: Any = make_dict_unstructure_fn(of, _converter, _cattrs_include_init_false=True, **shortened)
    return hook


def _to_digits(digits: int) -> Callable[[Any], Any]:
    return lambda array: np.vectorize(lambda number: float(f"{number:.{digits}g}"))(array).tolist()


def _is_array(of: Any) -> bool:
    return np.ndarray in (of, get_origin(of))


_converter = Converter(detailed_validation=False, forbid_extra_keys=True)
_converter.register_structure_hook(float, _float)
for _kind in (int, str, bool):
    _converter.register_structure_hook(_kind, _exactly)
_converter.register_structure_hook_func(_is_array, _array)
_converter.register_unstructure_hook_func(_is_array, lambda array: array.tolist())
_converter.register_structure_hook_factory(is_dataclass, _structure)
_converter.register_unstructure_hook_factory(is_dataclass, _unstructure)
#: A dataclass as nested dicts and lists, and one from these: ValueError, KeyError or TypeError for anything else.
encode, decode = _converter.unstructure, _converter.structure


FORMAT = "coal-gangue mixing ratio"
VERSION = 11
MOST_BYTES = 1e9
NOT_APPLICABLE = "not applicable"


@dataclass
class Model:
    """Methods fitted to the same runs at the same sample times.

    provenance: origin of the runs, their accelerometers, conditions that varied, and the number of draws in `groups`;
    left_out: methods that the runs do not allow, and why.

    >>> runs = read_sweep("runs/paper").runs
    >>> answer = Model.fit(runs[::2]).recognise(runs[3].signals)["energy_fusion_modified"]
    >>> abs(answer.ratio - 0.3) < 0.05
    True
    """

    window: Window
    methods: dict[str, Method]
    provenance: dict[str, Any]
    left_out: dict[str, str] = field(default_factory=dict)

    @classmethod
    def fit(cls, runs: list[Run], groups: Groups | None = None, conditions: pd.DataFrame | None = None) -> "Model":
        """Fit every method to runs of known ratio.

        groups (runs,): runs of one draw of arrangement, packing ... share a value, for the intervals; conditions: a row
        for each run of what a record will not tell, such as its impact speed; those that do not vary are left out.
        """
        return PreparedRuns.of(runs).fit(np.arange(len(runs)), groups, conditions)

    def recognise(self, signals: pd.DataFrame, source: str = "record") -> dict[str, Answer]:
        """Answer of each method; without a ratio, but with the reason, where the record does not allow it. Silence
        before the impact is cut off where the record has accelerometers.

        Raises RecordError for an unusable record, RecognitionError where no method applies.
        """
        if not isinstance(signals, pd.DataFrame):
            raise RecordError(f"{source}: is of type {type(signals).__name__}; must be a table with t_s and signals")
        values = _accelerations(signals)[1]
        early = samples_before_impact(values) if len(values) and np.isfinite(values).all() else 0
        table = self.window.cut(signals.iloc[early:].reset_index(drop=True) if early else signals, source)
        answers = self.answers_to(lambda name: self._features(name, table))
        if all(answer.reason.startswith(NOT_APPLICABLE) for answer in answers.values()):
            reasons = dict.fromkeys(answer.reason for answer in answers.values())
            raise RecognitionError(f"{source}: {'; '.join(reasons)}")
        return answers

    def _features(self, name: str, table: pd.DataFrame) -> Any:
        """What a method takes of a record. RecognitionError where it pools sensors and these are not the training's."""
        here, known = sorted(_accelerations(table)[0]), self.provenance.get("accelerometers")
        if known is not None and here and here != known and isinstance(self.methods[name], FeatureRegression):
            raise RecognitionError(f"accelerometers {', '.join(here)}; the training has {', '.join(map(str, known))}")
        return self.methods[name].prepare(table)

    def on_plate(self, plate: PlateModel) -> Self:
        """For records of a plate that was learnt by tapping. Only the arrangement likelihood knows of the plate; what
        other methods have learnt holds for the plate of the training alone, so they are left out.

        Raises RecognitionError where plate and model do not fit each other."""
        fitted: dict[str, Method] = {name: method.on_plate(plate) for name, method in self.methods.items()
                                     if isinstance(method, ArrangementLikelihood)}
        if not fitted:
            raise RecognitionError("this model has no method that knows of the plate; a data set gives one")
        others = {name: "learnt on another plate" for name in self.methods if name not in fitted}
        return replace(self, methods=fitted, left_out=self.left_out | others)

    @staticmethod
    def faults(signals: pd.DataFrame) -> list[str]:
        """Which accelerometers of a record cannot be used, and why, one line each."""
        names, values = _accelerations(signals)
        return channel_faults(values, names) if len(names) and np.isfinite(values).all() else []

    @staticmethod
    def vetoes(answers: dict[str, Answer]) -> dict[str, str]:
        """Which methods find the record unlike all that they know, and by which measure. One is enough for no answer to
        count: what another method makes of such a record may be confident and wrong. But where a method that seeks the
        moment of the impact knows the record, those that take it for known do not count: a trigger that is 10 us off
        is a misfit to them."""
        found = {name: answer.out_of_distribution for name, answer in answers.items() if answer.out_of_distribution}
        seeks = [name for name, answer in answers.items() if METHODS[name].seeks_impact and answer.has_interval]
        return found if not seeks or any(name in found for name in seeks) else {}

    def best(self, answers: dict[str, Answer]) -> tuple[str, Answer] | None:
        """The answer with an interval whose method has the least held-out error; None if there is none, or a veto."""
        errors: dict[str, float] = {name: method.error_ for name, method in self.methods.items()
                                    if name in answers and answers[name].has_interval and hasattr(method, "error_")}
        name = min(errors, key=lambda name: errors[name], default=None)
        return None if name is None or self.vetoes(answers) else (name, answers[name])

    def answers_to(self, features: Callable[[str], Any]) -> dict[str, Answer]:
        """Answer of each method to its features of one record, which `features` gives by the method's name."""
        answers = {}
        for name, method in self.methods.items():
            try:
                answers[name] = _answer(method, features(name))
            except RecognitionError as reason:
                answers[name] = Answer(math.nan, reason=f"{NOT_APPLICABLE}: {reason}")
        return answers | {name: Answer(math.nan, reason=f"{NOT_APPLICABLE}: {reason}")
                          for name, reason in self.left_out.items()}

    def save(self, path: str | Path) -> None:
        """Write the model, whole or not at all."""
        data = {
            "format": FORMAT,
            "version": VERSION,
            "provenance": self.provenance,
            "window": encode(self.window),
            "parameters": list(BASE_PARAMETERS),
            "methods": {name: encode(method) for name, method in self.methods.items()},
        }
        write_text(Path(path), json.dumps(seal(data), allow_nan=False, separators=(",", ":")))

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a saved model. RecognitionError, one line, for anything else."""
        path = Path(path)
        data = _read(path)
        try:
            methods = {name: _load_method(name, saved) for name, saved in data["methods"].items()}
            if not methods:
                raise ValueError("no method")
            provenance = data["provenance"]
            if not isinstance(provenance, dict) or not isinstance(provenance.get("groups"), int) or not isinstance(
                    provenance.get("accelerometers", []), list):
                raise TypeError("provenance must say from how many groups of runs, and list accelerometers")
            return cls(decode(data["window"], Window), methods, provenance)
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
            raise RecognitionError(f"{path}: broken model ({type(error).__name__}: {error})") from None


def _accelerations(signals: pd.DataFrame) -> tuple[list[str], Floats]:
    """Names and values (s, n)."""
    names = [name for name in signals.columns if name.startswith(ACCELEROMETERS)]
    return names, signals[names].to_numpy(dtype=float).T


@dataclass(frozen=True)
class PreparedRuns:
    """What each method takes of each run, which does not depend on the training, so that many models share it;
    left_out: methods that lack a column of the runs, and which."""

    runs: list[Run]
    window: Window
    features: dict[str, list[Any]]
    left_out: dict[str, str]

    @classmethod
    def of(cls, runs: list[Run]) -> Self:
        window = Window.of(runs)
        tables = [window.cut(run.signals, str(run.path)) for run in runs]
        features, left_out = {}, {}
        for name, entry in METHODS.items():
            method = entry.make()
            try:
                features[name] = [method.prepare(table, run) for table, run in zip(tables, runs, strict=True)]
            except RecognitionError as reason:
                left_out[name] = str(reason)
        return cls(runs, window, features, left_out)

    def fit(self, chosen: Sequence[int] | np.ndarray[Any, Any], groups: Groups | None = None,
            conditions: pd.DataFrame | None = None) -> Model:
        """A model of the chosen runs; groups and conditions of these. RecognitionError where no method can be used."""
        runs = [self.runs[k] for k in chosen]
        ratios = np.array([run.gangue_ratio for run in runs])
        if (different := np.unique(ratios).size) < LEAST_RATIOS:
            raise RecognitionError(f"{len(runs)} runs at {different} mixing ratios; needs at least {LEAST_RATIOS}")
        varied = [] if conditions is None else [name for name in conditions if np.ptp(conditions[name]) > 0]
        nuisance = conditions[varied] if conditions is not None and varied else None
        methods, left_out = {}, dict(self.left_out)
        for name, features in self.features.items():
            try:
                X = [features[k] for k in chosen]
                methods[name] = METHODS[name].make().fit(X, ratios, groups=groups, nuisance=nuisance)
            except RecognitionError as reason:
                left_out[name] = str(reason)
        if not methods:
            raise RecognitionError("; ".join(dict.fromkeys(left_out.values())))
        provenance = {"runs": [_origin(run) for run in runs], "conditions": varied,
                      "accelerometers": sorted(_accelerations(runs[0].signals)[0]),
                      "groups": 1 if groups is None else int(np.unique(np.asarray(groups)).size)}
        return Model(self.window, methods, provenance, left_out)

    def answers_without(self, held_out: int) -> dict[str, Answer]:
        """Answers to one run by the runs of all other ratios, the moment of the impact being known."""
        ratio = self.runs[held_out].gangue_ratio
        return self.answers_by(self.fit([k for k, run in enumerate(self.runs) if run.gangue_ratio != ratio]), held_out)

    def answers_by(self, model: Model, index: int) -> dict[str, Answer]:
        """Answers of a model to one of these runs, the moment of the impact being known."""
        at_impact = {name: method.at_impact() for name, method in model.methods.items()
                     if isinstance(method, ArrangementLikelihood)}
        known = replace(model, methods=model.methods | at_impact)
        return known.answers_to(lambda name: self.features[name][index])


def _answer(method: Method, features: Any) -> Answer:
    """Raises RecognitionError where the method does not apply to these features, or the numbers of its file do not fit
    together: arrays of other shapes, or too large to calculate with."""
    try:
        (answer,) = method.answer([features])
        if not answer.reason and not (np.isfinite(answer.ratio) and answer.has_interval):
            raise ValueError(f"ratio {answer.ratio}, interval {answer.low} to {answer.high}")
        return answer
    except RecognitionError:
        raise
    except (ValueError, TypeError, LookupError, ArithmeticError, np.linalg.LinAlgError) as error:
        raise RecognitionError(f"the model's numbers do not fit together ({error})") from error


def _read(path: Path) -> dict[str, Any]:
    """The content of a model file of this version."""
    with raised_as(RecognitionError):
        refuse_unreadable(path, MOST_BYTES)
    try:
        data = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise RecognitionError(f"{path}: not a readable model ({getattr(error, 'strerror', None) or error})") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise RecognitionError(f"{path}: format is not {FORMAT!r}")
    if data.get("version") != VERSION:
        raise RecognitionError(f"{path}: version = {data.get('version')!r}; this program reads {VERSION}")
    if not is_sealed(data):
        raise RecognitionError(f"{path}: damaged or changed by hand: its contents do not have the hash that it names")
    if data.get("parameters") != list(BASE_PARAMETERS):
        raise RecognitionError(f"{path}: parameters differ from this program's {', '.join(BASE_PARAMETERS)}")
    return data


def _load_method(name: str, saved: Any) -> Method:
    if name not in METHODS:
        raise RecognitionError(f"method {name!r}; this program has {', '.join(METHODS)}")
    return decode(saved, type(METHODS[name].make()))


def _origin(run: Run) -> dict[str, Any]:
    keep = ("scene_hash", "deck_hash", "versions", "seeds")
    summary = run.summary.as_json()
    known = {key: summary[key] for key in keep if key in summary}
    return {"directory": run.path.name, "gangue_ratio": run.gangue_ratio, **known}
