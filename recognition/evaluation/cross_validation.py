"""Honest evaluation: what recognisers make of runs whose arrangement, packing, speed ... they were not trained on.

A `Case` says on which runs to train and on which to test. Groups are never split, scaling is learnt from training runs
alone, and sensor noise is put on the records that are tested, from a seed of each run's own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.model_selection import GroupKFold

from analysis import RecordError
from recognition.errors import RecognitionError
from recognition.evaluation.dataset import DataSet
from recognition.evaluation.estimators import RECOGNISERS, Answers, make
from recognition.evaluation.sensor_noise import with_noise

NOISES_DB = (None, 40.0, 20.0)
FOLDS, LEAST_FOLDS = 8, 3
MOST_TRAININGS = 8  # of eleven runs, one after the other
BANDS = 5  # of speed or damping, whole ones held out


@dataclass(frozen=True)
class Case:
    """families: runs to test on (and to train on, what is held out apart). eleven: trained on the eleven runs of one group
    of the family `ring` at a time instead. key: column of the table that is held out in whole, "group" or a
    condition; of a condition that is no ratio, whole bands. nuisance: conditions that vary and are not told."""

    name: str
    held_out: str
    families: tuple[str, ...]
    also_trained: tuple[str, ...] = ()
    eleven: bool = False
    key: str = "group"
    nuisance: tuple[str, ...] = ()
    told: bool = False  # the nuisance is told with the record
    goal: dict[float | None, tuple[float | None, float | None]] = field(default_factory=dict)  # noise: mean, worst


PLACE = "arrangement, packing"
RINGS = ("paper", "packing", "ring")  # 3 m/s, 1 % damping, on the circle
CASES = (
    Case("eleven runs", PLACE, RINGS, eleven=True, goal={None: (1, 3), 20.0: (1.5, 5)}),
    Case("eleven runs, damping varies", f"{PLACE}, damping", ("damping",), eleven=True, goal={None: (2, None)}),
    Case("eleven runs, speed varies", f"{PLACE}, speed", ("speed",), eleven=True),
    Case("eleven runs, free positions", f"{PLACE}, positions", ("free",), eleven=True),
    Case("eleven runs, scatter", f"{PLACE}, arrival times, strengths, positions", ("scatter",), eleven=True),
    Case("many runs", PLACE, RINGS, goal={None: (1, 3), 20.0: (1.5, 5)}),
    Case("many runs, whole ratios", "mixing ratio", RINGS, key="gangue_ratio"),
    Case("many runs, scatter", f"{PLACE}, arrival times, strengths, positions", ("scatter",), RINGS),
    Case("damping untold", f"{PLACE}, damping", ("damping",), RINGS, nuisance=("damping_ratio",),
         goal={None: (2, None)}),
    Case("damping untold, whole bands", "band of damping", ("damping",), key="damping_ratio",
         nuisance=("damping_ratio",)),
    Case("speed untold", f"{PLACE}, speed", ("speed",), RINGS, nuisance=("speed_m_s",),
         goal={None: (2, None), 20.0: (2, None)}),
    Case("speed told", f"{PLACE}, speed", ("speed",), RINGS, nuisance=("speed_m_s",), told=True),
    Case("speed untold, whole bands", "band of speed", ("speed",), key="speed_m_s", nuisance=("speed_m_s",)),
    Case("free positions", f"{PLACE}, positions", ("free",), goal={None: (1, None)}),
    Case("everything varies", f"{PLACE}, speed, damping, arrival times, strengths, positions", ("all",),
         nuisance=("speed_m_s", "damping_ratio")),
)


@dataclass(frozen=True)
class Result:
    """What one method gave for each run tested in a case at one noise: a row of `answers` a run and training."""

    case: Case
    method: str
    noise_db: float | None
    answers: pd.DataFrame
    reason: str = ""


class Evaluation:
    """A data set with what each method makes of each record, computed once for each noise."""

    def __init__(self, data: DataSet):
        self.data = data
        self._prepared: dict[tuple[str, float | None], np.ndarray] = {}

    def prepared(self, method: str, noise_db: float | None) -> np.ndarray:
        """`prepare` of every run, stacked."""
        key = (method, noise_db)
        if key not in self._prepared:
            recogniser = make(method)
            records = self.data.fast if recogniser.fast else self.data.signals
            self._prepared[key] = np.stack([recogniser.prepare(signals) for signals in self._noisy(records, noise_db)])
        return self._prepared[key]

    @staticmethod
    def _noisy(records: list[pd.DataFrame], noise_db: float | None) -> Iterator[pd.DataFrame]:
        for number, signals in enumerate(records):
            yield with_noise(signals, noise_db, np.random.default_rng([number, int(noise_db or 0)]))

    def run(self, case: Case, method: str, noises_db=NOISES_DB) -> list[Result]:
        """A result a noise; where the runs, their signals or the method do not allow it, with the reason and no answers."""
        table = self.data.table
        rows: dict[float | None, list[pd.DataFrame]] = {noise: [] for noise in noises_db}
        nuisance = table[list(case.nuisance)].to_numpy() if case.nuisance else None
        try:
            clean = self.prepared(method, None)
            for train, test in self.splits(case):
                known = None if nuisance is None else nuisance[train]
                recogniser = make(method)
                lessons = {"lessons": [self.data.lessons[k] for k in train]} if recogniser.learns_from_stones else {}
                recogniser.fit(clean[train], self.data.ratios[train], table["group"].to_numpy()[train], known, **lessons)
                for noise_db in noises_db:
                    told = nuisance[test] if nuisance is not None and case.told else None
                    answers = recogniser.answer(self.prepared(method, noise_db)[test], told)
                    rows[noise_db].append(self._rows(answers, test))
        except (RecordError, RecognitionError) as reason:
            return [Result(case, method, noise_db, pd.DataFrame(), str(reason)) for noise_db in noises_db]
        return [Result(case, method, noise_db, pd.concat(parts, ignore_index=True)) for noise_db, parts in rows.items()]

    def _rows(self, answers: Answers, test: np.ndarray) -> pd.DataFrame:
        return pd.DataFrame({"run": test, "true": self.data.ratios[test], **vars(answers)})

    def splits(self, case: Case) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Numbers of the runs to train on and to test on."""
        table, tested = self.data.table, self.data.of(*case.families)
        if not tested.size:
            raise RecognitionError(f"no run of the families {', '.join(case.families)}")
        if case.eleven:
            yield from self._by_eleven(tested)
            return
        keys = self._keys(case, tested)
        count = np.unique(keys).size
        if count < LEAST_FOLDS:
            raise RecognitionError(f"{case.name}: {count} different of {case.key}; needs at least {LEAST_FOLDS}")
        always = self.data.of(*case.also_trained)
        groups = table["group"].to_numpy()
        for train, test in GroupKFold(min(FOLDS, count) if case.key == "group" else count).split(tested, groups=keys):
            for part in self._without_shared_groups(tested[train], tested[test], groups):
                yield np.concatenate([always, np.setdiff1d(tested[train], np.flatnonzero(np.isin(groups, groups[part])))]
                                     ), part

    @staticmethod
    def _without_shared_groups(train: np.ndarray, test: np.ndarray, groups: np.ndarray) -> list[np.ndarray]:
        """The runs to test, in parts where some of their groups are also in the training, so that a part's groups can be
        left out of it."""
        if not set(groups[train]) & set(groups[test]):
            return [test]
        parts = min(FOLDS, np.unique(groups[test]).size)
        return [test[rows] for _, rows in GroupKFold(parts).split(test, groups=groups[test])]

    def _by_eleven(self, tested: np.ndarray):
        table = self.data.table
        trainings = [np.flatnonzero(table["group"] == group)
                     for group in table["group"][self.data.of(*RINGS)].unique()]
        trainings = [rows for rows in trainings if np.unique(self.data.ratios[rows]).size == 11]
        if not trainings:
            raise RecognitionError(f"no group of the families {', '.join(RINGS)} has all eleven ratios")
        for train in trainings[::-(-len(trainings) // MOST_TRAININGS)]:
            yield train, np.setdiff1d(tested, train)

    def _keys(self, case: Case, tested: np.ndarray) -> np.ndarray:
        values = self.data.table[case.key].to_numpy()[tested]
        if case.key in ("group", "gangue_ratio"):
            return values
        return pd.qcut(values, BANDS, labels=False)


def summary(result: Result) -> dict:
    """A row of evaluation.csv; errors in points of mixing ratio, of the records that were answered."""
    case, rows = result.case, result.answers
    row = {"method": result.method, "held_out": case.held_out, "noise_db": result.noise_db, "n": len(rows)}
    error = 100 * (rows["ratio"] - rows["true"]).dropna().to_numpy() if len(rows) else np.array([])
    numbers = dict.fromkeys(("mean_abs_error_points", "p95_points", "worst_points", "bias_points", "coverage_90"))
    if error.size:
        size = np.abs(error)
        numbers |= {"mean_abs_error_points": size.mean(), "p95_points": np.quantile(size, 0.95),
                    "worst_points": size.max(), "bias_points": error.mean()}
        if rows["low"].notna().any():
            numbers["coverage_90"] = ((rows["low"] <= rows["true"]) & (rows["true"] <= rows["high"])).mean()
    flagged = rows["strange"].mean() if len(rows) else None
    return row | numbers | {"case": case.name, "answered": error.size, "flagged": flagged, "reason": result.reason}


def evaluate(data: DataSet, methods, cases=CASES, noises_db=NOISES_DB, tell: Callable[[str], None] = print) -> list[Result]:
    """Every method in every case at every noise; what cannot be had says why in `reason`."""
    evaluation, results = Evaluation(data), []
    for case in cases:
        for method in methods:
            found = evaluation.run(case, method, noises_db)
            results += found
            for result in found:
                tell(_line(summary(result)))
    return results


def _line(row: dict) -> str:
    start = f"{row['case']:<32} {row['method']:<32} {row['noise_db'] or '-':>4} dB "
    if row["mean_abs_error_points"] is None:
        return start + (row["reason"] or "no answer")
    coverage = "-" if row["coverage_90"] is None else f"{100 * row['coverage_90']:.0f} %"
    return start + (f"{row['answered']:>4} of {row['n']:<4} mean {row['mean_abs_error_points']:6.2f} worst "
                    f"{row['worst_points']:6.2f} bias {row['bias_points']:+6.2f} coverage {coverage} "
                    f"flagged {100 * row['flagged']:.0f} %")


def table(results: list[Result]) -> pd.DataFrame:
    """evaluation.csv."""
    return pd.DataFrame([summary(result) for result in results])


def write_whole(frame: pd.DataFrame, path: Path) -> Path:
    """A CSV file, whole or not at all; returns its path."""
    beside = path.with_name(path.name + ".part")
    frame.to_csv(beside, index=False, float_format="%.4g")
    beside.replace(path)
    return path


def write_evaluation(data: DataSet, directory, methods=None) -> Path:
    """Evaluate every method, or some, on a data set; writes evaluation.csv and returns its path. RecognitionError for an
    unknown method."""
    return write_whole(table(evaluate(data, methods or list(RECOGNISERS))), Path(directory) / "evaluation.csv")
