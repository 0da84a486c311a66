"""Cross-validation: answers of methods to runs of a data set whose arrangement, packing ... they were not trained on.

A data set is what `gangue dataset` leaves: DIRECTORY/FAMILY/GROUP/ratio_050. A `Case` says on which runs to train and
on which to test. Runs of the same arrangement or packings are never split, scaling is learnt from training runs alone,
and sensor noise is added only to the records that are tested, from a seed of each run's own.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from sklearn.model_selection import GroupKFold

from analysis import RecordError, read_run
from analysis.sweep.runs import Run
from common.files.output_directory import stamped
from common.files.whole import write_text
from recognition.estimation.arrays import Floats, Integers
from recognition.estimation.errors import RecognitionError
from recognition.estimation.method import MethodEntry, Registry
from recognition.estimation.noise import with_noise
from recognition.estimation.window import Window

#: Conditions that a record does not tell.
CONDITIONS = ("speed_m_s", "damping_ratio")
Noises = Sequence[float | None]  # below the signals' rms, dB
NOISES_DB = (None, 40.0, 20.0)
FOLDS, LEAST_FOLDS = 8, 3
PLACE = "arrangement, packing"
RINGS = ("paper", "clean")  # 3 m/s, 1 % damping, on the circle
ONE_THING = ("radius", "density", "modulus", "restitution", "speeds", "strength", "places", "free", "arrivals")


@dataclass(frozen=True)
class DataSet:
    """runs, their signals cut to one window, and what distinguishes them.

    table: a row a run with family, group ("family/000": one draw of all that varies), kin (the same in groups that have
    the order of gangue or the packings in common, if only by way of other groups), gangue_ratio, speed_m_s,
    damping_ratio. passed_over: directories that hold no finished run, and why.
    """

    runs: list[Run]
    table: pd.DataFrame
    passed_over: list[str]

    @cached_property
    def window(self) -> Window:
        return Window.of(self.runs)

    @cached_property
    def signals(self) -> list[pd.DataFrame]:
        return [self.window.cut(run.signals, str(run.path)) for run in self.runs]

    @property
    def ratios(self) -> Floats:
        return self.table["gangue_ratio"].to_numpy()

    def of(self, *families: str) -> Integers:
        """Numbers of the runs of some families."""
        return np.flatnonzero(self.table["family"].isin(families))

    def calibration(self) -> "DataSet":
        """The runs of the plate, the materials and the agglomerates that most runs have; the others are passed over."""
        kinds = pd.Series([_kind(run) for run in self.runs])
        same = (kinds == kinds.mode()[0]).to_numpy()
        others = [f"{self.runs[k].path}: another plate, other materials or other agglomerates"
                  for k in np.flatnonzero(~same)]
        runs = [run for run, one in zip(self.runs, same, strict=True) if one]
        return DataSet(runs, self.table[same].reset_index(drop=True), self.passed_over + others)


def _kind(run: Run) -> str:
    scene = run.scene.as_json()
    plate = {key: value for key, value in scene["plate"].items() if key != "damping_ratio"}
    return json.dumps([plate, scene.get("materials"), scene["stones"].get("agglomerate")], sort_keys=True)


def read_dataset(path: str | Path) -> DataSet:
    """Every finished run below a directory. RecordError if there is none."""
    path = Path(path)
    runs, rows, passed_over = [], [], []
    for directory in sorted(p for p in path.glob("*/*/ratio_*") if p.is_dir() and p.suffix != ".partial"):
        try:
            run = read_run(directory)
            rows.append(_row(run, directory))
        except (RecordError, RecognitionError) as error:
            passed_over.append(str(error))
        else:
            runs.append(run)
    if not runs:
        what = "no finished run" if path.is_dir() else "no such directory"
        raise RecordError(f"{path}: {what}; needs FAMILY/GROUP/ratio_* of `gangue dataset` or, for `gangue fit` alone, "
                          "ratio_* of `gangue sweep`")
    table = pd.DataFrame(rows)
    table.insert(2, "kin", _kin(table["group"], table.pop("order"), table.pop("packing")))
    return DataSet(runs, table, passed_over)


def _kin(group: pd.Series, *shared: pd.Series) -> Integers:
    """Number of the class of each run: runs that have a group, or any of `shared`, in common are in one class."""
    nodes = np.stack([pd.factorize(one)[0] for one in (group, *shared)])
    nodes += np.cumsum([0, *(nodes.max(axis=1) + 1)])[:-1, None]  # of all kinds numbered through
    n, first = int(nodes.max()) + 1, np.repeat(nodes[:1], len(nodes) - 1, axis=0)
    graph = coo_array((np.ones(first.size), (first.ravel(), nodes[1:].ravel())), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1][nodes[0]])


def _speed_m_s(run: Run) -> float | None:
    """That of a volley, or the mean of stones that were drawn."""
    if run.scene.stones.speed_m_s is not None or run.stones is None:
        return run.scene.stones.speed_m_s
    velocity = run.stones[["velocity_x_m_s", "velocity_y_m_s", "velocity_z_m_s"]].to_numpy(dtype=float)
    return float(np.linalg.norm(velocity, axis=1).mean())


def _row(run: Run, directory: Path) -> dict[str, Any]:
    conditions = {"speed_m_s": _speed_m_s(run), "damping_ratio": run.scene.plate.damping_ratio}
    for name, value in conditions.items():
        if value is None:
            raise RecognitionError(f"{directory}/run.json: scene has no {name!r}")
    family = directory.parent.parent.name
    group, stones = f"{family}/{directory.parent.name}", run.scene.stones
    order = group if not stones.gangue_order else str(list(stones.gangue_order))
    packing = str(run.scene.as_json()["stones"].get("seed", group))
    return {"family": family, "group": group, "order": order, "packing": packing, "gangue_ratio": run.gangue_ratio,
            **conditions}


@dataclass(frozen=True)
class Case:
    """families: runs to test on, and to train on, classes of kin held out; also_trained: runs to train on besides.
    nuisance: conditions that vary, and are not known with a record."""

    name: str
    held_out: str
    families: tuple[str, ...]
    also_trained: tuple[str, ...] = ()
    nuisance: tuple[str, ...] = ()


CASES = (
    Case("clean", PLACE, RINGS),
    Case("stones", "all that a stone is", ("stones",)),
    Case("natural", "all that a stone is, places, arrivals", ("natural",)),
    Case("wide", "the same, far more", ("wide",)),
    *(Case(f"{name} alone", name, (name,)) for name in ONE_THING),
    Case("damping unknown", f"{PLACE}, damping", ("damping",), RINGS, nuisance=("damping_ratio",)),
    Case("speed unknown", f"{PLACE}, speed", ("speed",), RINGS, nuisance=("speed_m_s",)),
)


@dataclass(frozen=True)
class Result:
    """Answers of one method in a case at one noise: a row for each run tested and training, with the number of the run,
    its true ratio and the fields of `Answer`; or the reason why there are none."""

    case: Case
    method: str
    noise_db: float | None
    answers: pd.DataFrame
    reason: str = ""


class Evaluation:
    """A data set with the features that each method takes of each record, computed once for each noise."""

    def __init__(self, data: DataSet):
        self.data = data
        self._features: dict[tuple[str, float | None, int], Any] = {}

    def features(self, name: str, entry: MethodEntry, noise_db: float | None, numbers: Integers) -> list[Any]:
        """Features of some runs; only records without noise are trained on."""
        for number in map(int, numbers):
            if (name, noise_db, number) not in self._features:
                run, rng = self.data.runs[number], np.random.default_rng([number, int(noise_db or 0)])
                noisy = with_noise(self.data.signals[number], noise_db, rng)
                told = run if noise_db is None or entry.told else None
                self._features[name, noise_db, number] = entry.make().prepare(noisy, told)
        return [self._features[name, noise_db, int(number)] for number in numbers]

    def run(self, case: Case, name: str, entry: MethodEntry, noises_db: Noises = NOISES_DB) -> list[Result]:
        """A result for each noise; a reason and no answers where runs, signals or method do not allow it."""
        rows: dict[float | None, list[pd.DataFrame]] = {noise_db: [] for noise_db in noises_db}
        nuisance = self.data.table[list(case.nuisance)] if case.nuisance else None
        groups = self.data.table["kin"].to_numpy()
        try:
            for train, test in self.splits(case):
                clean = self.features(name, entry, None, train)
                varied = None if nuisance is None else nuisance.iloc[train]
                method = entry.make().fit(clean, self.data.ratios[train], groups=groups[train], nuisance=varied)
                for noise_db in noises_db:
                    features = self.features(name, entry, noise_db, test)
                    rows[noise_db].append(pd.DataFrame([{"run": k, "true": self.data.ratios[k], **asdict(answer)} for
                                                        k, answer in zip(test, method.answer(features), strict=True)]))
        except (RecordError, RecognitionError) as reason:
            return [Result(case, name, noise_db, pd.DataFrame(), str(reason)) for noise_db in noises_db]
        return [Result(case, name, noise_db, pd.concat(parts, ignore_index=True)) for noise_db, parts in rows.items()]

    def splits(self, case: Case) -> Iterator[tuple[Integers, Integers]]:
        """Numbers of the runs to train on and to test on."""
        tested, groups = self.data.of(*case.families), self.data.table["kin"].to_numpy()
        if not tested.size:
            raise RecognitionError(f"no run of the families {', '.join(case.families)}")
        count = np.unique(groups[tested]).size
        if count < LEAST_FOLDS:
            raise RecognitionError(f"{case.name}: {count} different of kin; needs at least {LEAST_FOLDS}")
        always = self.data.of(*case.also_trained)
        for train, test in GroupKFold(min(FOLDS, count)).split(tested, groups=groups[tested]):
            shared = np.flatnonzero(np.isin(groups, groups[tested[test]]))
            yield np.setdiff1d(np.concatenate([always, tested[train]]), shared), tested[test]


def summary(result: Result) -> dict[str, Any]:
    """A row of evaluation.csv; errors in points of mixing ratio, of the records that were answered."""
    case, rows = result.case, result.answers
    row = {"method": result.method, "held_out": case.held_out, "noise_db": result.noise_db, "n": len(rows)}
    told = rows.dropna(subset="ratio") if len(rows) else rows
    error = 100 * (told["ratio"] - told["true"]).to_numpy() if len(told) else np.array([])
    numbers = dict.fromkeys(("mean_abs_error_points", "p95_points", "worst_points", "bias_points", "coverage_90"))
    if error.size:
        size = np.abs(error)
        numbers |= {"mean_abs_error_points": size.mean(), "p95_points": np.quantile(size, 0.95),
                    "worst_points": size.max(), "bias_points": error.mean()}
        if told["low"].notna().any():
            numbers["coverage_90"] = told["true"].between(told["low"], told["high"]).mean()
    flagged = (rows["out_of_distribution"] != "").mean() if len(rows) else None
    return row | numbers | {"case": case.name, "answered": error.size, "flagged": flagged, "reason": result.reason}


def evaluate(data: DataSet, methods: Registry, cases: Sequence[Case] = CASES, noises_db: Noises = NOISES_DB,
             progress: Callable[[str], None] = print) -> list[Result]:
    """Every method in every case at every noise; what cannot be had says why in `reason`."""
    evaluation, results = Evaluation(data), []
    for case in cases:
        for name, entry in methods.items():
            found = evaluation.run(case, name, entry, noises_db)
            results += found
            for result in found:
                progress(_line(summary(result)))
    return results


def _line(row: dict[str, Any]) -> str:
    start = f"{row['case']:<32} {row['method']:<32} {row['noise_db'] or '-':>4} dB "
    if row["mean_abs_error_points"] is None:
        return start + (row["reason"] or "no answer")
    coverage = "-" if row["coverage_90"] is None else f"{100 * row['coverage_90']:.0f} %"
    return start + (f"{row['answered']:>4} of {row['n']:<4} mean {row['mean_abs_error_points']:6.2f} worst "
                    f"{row['worst_points']:6.2f} bias {row['bias_points']:+6.2f} coverage {coverage} "
                    f"flagged {100 * row['flagged']:.0f} %")


def write_evaluation(data: DataSet, directory: str | Path, methods: Registry) -> Path:
    """Evaluate methods on a data set; writes evaluation.csv into a directory and returns its path. Raises
    RecognitionError where it has no run of any case."""
    file, known = Path(directory) / "evaluation.csv", dict.fromkeys(name for case in CASES for name in case.families)
    if not data.of(*known).size:
        raise RecognitionError(f"{directory}: families {', '.join(data.table['family'].unique())}; needs one of "
                               f"{', '.join(known)}")
    rows = pd.DataFrame(map(summary, evaluate(data, methods)))
    write_text(file, stamped(rows.to_csv(index=False, float_format="%.4g"), "# {}"))
    return file
