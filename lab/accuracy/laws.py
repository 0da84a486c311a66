"""The laws of common/scene/error_laws.py, from what `make accuracy` measured."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd

LAW_OF = {"time step": "time_step", "time step, spheres": "contact", "co-step": "co_step",
         "co-step, spheres": "co_step_spheres",
         "modes, thin plate": "modes", "modes, thin plate, spheres": "modes_spheres"}
ERRORS = ["force_peak", "force_l2", "energy_peak", "energy_l2", "acceleration_peak", "acceleration_l2"]


def worst_error(table: pd.DataFrame) -> pd.Series:
    """The largest of the deterministic errors of each row."""
    return table[ERRORS].max(axis=1)


def write_laws(table: pd.DataFrame, file: Path) -> None:
    """Write the law of each of LAW_OF (of the modes on the thinner plate, which needs more of them): the worst error of
    each setting, and of all finer ones, which chance may have made larger; a repeated error is raised by a thousandth,
    so that the law ascends."""
    lines = ["# Error of each numerical setting by its value; common/scene/error_laws.py says what they are.",
             f"# Written by `python -m lab run work_precision`, {date.today().isoformat()}.", ""]
    for varied, name in LAW_OF.items():
        rows = table[(table["numerical_setting"] == varied) & (table["outcome"] == "finished")]
        settings = rows["setting"].to_numpy()
        settings = 1 / settings if name.startswith("modes") else settings
        order = np.argsort(settings)
        errors = np.maximum.accumulate(worst_error(rows).to_numpy()[order]) * 1.001 ** np.arange(len(rows))
        lines += [f"[{name}]", f"settings = [{', '.join(f'{s:.5g}' for s in settings[order])}]",
                  f"errors = [{', '.join(f'{e:.4g}' for e in errors)}]", ""]
    file.write_text("\n".join(lines))
