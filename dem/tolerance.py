"""Settings that keep a tolerance, and the error that settings are expected to have.

Each numerical knob has a law, the measured error by setting: an upper bound of the relative errors (largest value, and
L2 norm over the run) of the force on the plate, the energy of the plate and the acceleration of its centre of mass. A
setting is free of units, so that the law holds for other scenes, and grows with the error:

    time_step   dt/t0 of bonded stones (dem/time_step.py)
    contact     dt over the contact time of a whole stone, of unbonded spheres
    co_step     co-step over the contact time of a whole stone, under bonded stones
    co_step_spheres  the same under unbonded spheres
    modes       period of the highest of the plate's modes over that contact time, under bonded stones
    modes_spheres  the same under unbonded spheres, whose push begins more sharply

A tolerance is shared out equally among time step, co-step and modes; the expected error is the sum. It is that of the
numerical solution; breakage is chaotic, and differs from packing to packing by far more (docs/accuracy.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from plate_fem.scene import FlexiblePlate
from plate_fem.tables import read_toml
from plate_fem.truncation import with_max_frequency

LAWS = Path(__file__).with_name("error_laws.toml")  # written by `make accuracy`
KNOBS = 3


@dataclass(frozen=True)
class Law:
    """`settings` and `errors` (k,), both ascending; between them a power law."""

    settings: np.ndarray
    errors: np.ndarray

    def error(self, setting: float) -> float:
        """Below the finest setting measured the error of that, above the coarsest the last power law goes on."""
        s, e = np.log(self.settings), np.log(self.errors)
        x = np.log(setting)
        if x > s[-1]:
            return float(np.exp(e[-1] + (e[-1] - e[-2]) / (s[-1] - s[-2]) * (x - s[-1])))
        return float(np.exp(np.interp(x, s, e)))

    def setting(self, error: float) -> float:
        """The coarsest of those measured whose error is at most this, which must not be below that of the finest. None
        between them is taken: one mode more or less can make a leap of the error."""
        return float(self.settings[np.flatnonzero(self.errors <= error)[-1]])


@cache
def law(knob: str) -> Law:
    table = read_toml(LAWS)[knob]
    return Law(np.array(table["settings"]), np.array(table["errors"]))


def least_tolerance(bonded: bool) -> float:
    """The smallest tolerance that the settings measured can keep."""
    knobs = ("time_step", "co_step", "modes") if bonded else ("contact", "co_step_spheres", "modes_spheres")
    return KNOBS * max(float(law(knob).errors[0]) for knob in knobs)


def modes_knob(bonded: bool) -> str:
    return "modes" if bonded else "modes_spheres"


def co_step_knob(bonded: bool) -> str:
    return "co_step" if bonded else "co_step_spheres"


def setting_for(knob: str, tolerance: float) -> float:
    """The coarsest setting of a knob that keeps its share of a tolerance of at least `least_tolerance`."""
    return law(knob).setting(tolerance / KNOBS)


def with_tolerance(plate: FlexiblePlate, tolerance: float | None, contact_time_s: float, bonded: bool) -> FlexiblePlate:
    """The plate's table with `max_frequency_Hz` from the tolerance; without one, from its own `truncation_tolerance`."""
    if tolerance is None:
        return with_max_frequency(plate, contact_time_s)
    return plate.model_copy(update={"max_frequency_Hz": 1 / (setting_for(modes_knob(bonded), tolerance) * contact_time_s)})


def expected_error(settings: dict[str, float]) -> dict[str, float]:
    """Expected relative error by knob, for the settings of a run, and their sum as "total"."""
    errors = {knob: law(knob).error(setting) for knob, setting in settings.items()}
    return errors | {"total": sum(errors.values())}
