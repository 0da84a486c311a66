"""What an anti-alias filter before the samples does to the paper's statements, to features and to recognition: one
sweep, its samples taken of the fast stream in both ways."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from analysis import Run, read_sweep
from analysis.signals.features import BASE_PARAMETERS, signal_features
from analysis.sweep.runs import Sweep
from common.channels import ACCELEROMETERS
from common.process.processes import side_by_side
from dem.run.results import samples_of
from lab.study import Row
from recognition.methods import METHODS
from recognition.models import PreparedRuns
from report.page import STATEMENTS
from report.sweep_results import SweepResults
from report.verdicts import VERDICTS, check_statements

WAYS = {"as_they_are": False, "behind_filter": True}


def anti_alias(out: Path, sweep: str = "runs/paper") -> Iterator[Row]:
    """Statements by verdict; features of the accelerometers, mean over sensors and runs; error of each method that was
    trained on the other ratios, in points."""

    @cache
    def taken(filtered: bool) -> Sweep:
        whole = read_sweep(sweep)
        return replace(whole, runs=[resampled(run, filtered) for run in whole.runs])

    @cache
    def verdicts(filtered: bool) -> Counter[str]:
        results = SweepResults(taken(filtered))
        return Counter(claim.verdict for part in STATEMENTS for claim in check_statements(results, part))

    def count(verdict: str, filtered: bool) -> float:
        return verdicts(filtered)[verdict]

    def feature(name: str, filtered: bool) -> float:
        return mean_feature(taken(filtered).runs, name)

    @cache
    def errors(filtered: bool) -> dict[str, float]:
        runs = taken(filtered).runs
        prepared = PreparedRuns.of(runs)
        answers = side_by_side(prepared.answers_without, len(runs))
        return {name: 100 * float(np.mean([abs(one[name].ratio - run.gangue_ratio)
                                           for one, run in zip(answers, runs, strict=True)])) for name in METHODS}

    def error(name: str, filtered: bool) -> float:
        return errors(filtered)[name]

    def both(value: Callable[[bool], float]) -> dict[str, float]:
        return {way: value(filtered) for way, filtered in WAYS.items()}

    for verdict in VERDICTS:
        yield Row({"measure": f"statements {verdict}"}, partial(both, partial(count, verdict)))
    for name in BASE_PARAMETERS:
        yield Row({"measure": name}, partial(both, partial(feature, name)))
    for name in METHODS:
        yield Row({"measure": f"error of {name}, points"}, partial(both, partial(error, name)))


def resampled(run: Run, filtered: bool) -> Run:
    """The run as it would be with or without the filter."""
    assert run.fast is not None
    fast = {str(name): values.to_numpy(dtype=float) for name, values in run.fast.items()}
    every = round((len(fast["t_s"]) - 1) / (len(run.t_s) - 1))
    scene = run.info["scene"]
    info = run.info | {"scene": scene | {"time": scene["time"] | {"anti_alias": filtered}}}
    return Run(run.path, info, pd.DataFrame(samples_of(fast, every, filtered)))


def mean_feature(runs: list[Run], name: str) -> float:
    return float(np.mean([signal_features(run.record(column))[name].value for run in runs
                          for column in map(str, run.signals) if column.startswith(ACCELEROMETERS)]))
