"""Every method, those of a model and the baselines, on runs of a data set that it was not trained on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.sweep.runs import Run
from lab.recognition.baselines import EVALUATED
from lab.recognition.superposed import superposed
from lab.study import Row
from recognition.evaluation import CASES, Case, Evaluation, read_dataset, summary

FAMILIES, NOISE_db = ("clean", "stones", "natural", "wide"), 20.0


def recognise_families(out: Path, runs: int = 44) -> Iterator[Row]:
    """Every method on superposed runs of each family, 20 dB of noise on every sensor; by number, and by mass, where the
    stones of a material are taken to have one mass."""
    families, directory = [case for case in CASES if case.name in FAMILIES], out / "families"

    @cache
    def evaluation() -> Evaluation:
        for row in superposed(directory, runs=runs, families=FAMILIES):
            row.work()
        return Evaluation(read_dataset(directory))

    def found(case: Case, name: str) -> dict[str, Any]:
        result = evaluation().run(case, name, EVALUATED[name], (NOISE_db,))[0]
        by_mass = summary(replace(result, answers=of_mass(result.answers, evaluation().data.runs)))
        return summary(result) | {f"mass_{name}": by_mass[name] for name in ("mean_abs_error_points", "coverage_90")}

    for name in EVALUATED:
        for case in families:
            yield Row({"method": name, "family": case.name}, partial(found, case, name))


def of_mass(answers: pd.DataFrame, runs: list[Run]) -> pd.DataFrame:
    """Answers by number as shares of the mass, and the true ones."""
    if answers.empty:
        return answers
    stones = [table for k in answers["run"] if (table := runs[k].stones) is not None]
    true = [table.loc[table["kind"] == "gangue", "mass_kg"].sum() / table["mass_kg"].sum() for table in stones]
    materials = runs[0].scene.materials
    coal, gangue = np.array([materials[name].density_kg_m3 for name in ("coal", "gangue")], dtype=float)
    shares = {name: gangue * answers[name] / (coal + (gangue - coal) * answers[name]) for name in ("ratio", "low", "high")}
    return answers.assign(true=true, **shares)


def recognise_families_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """A row a method: mean and worst error in points, and coverage of 90 % intervals in per cent, by family; `mass`: mean
    error by mass."""
    rows = rows.assign(**{name: 100 * rows[name].astype(float) for name in ("coverage_90", "mass_coverage_90")})
    names = {"mean_abs_error_points": "mean", "worst_points": "worst", "coverage_90": "inside", "answered": "answered",
             "mass_mean_abs_error_points": "mass", "mass_coverage_90": "mass_inside"}
    wide = rows.pivot(index="method", columns="family", values=list(names)).reindex(list(EVALUATED))
    wide.columns = pd.Index([f"{column[1]}_{names[column[0]]}" for column in wide.columns.tolist()])
    return wide.reset_index()
