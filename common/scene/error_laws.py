"""The measured error of each numerical setting of a simulation by its value (docs/accuracy.md).

A law is an upper bound of the relative errors (largest value, and L2 norm over the run) of the force on the plate, the
energy of the plate and the acceleration of its centre of mass. A value is free of units, so that the law holds for
other scenes, and grows with the error:

    time_step   dt/t0 of bonded stones (dem/deck/time_step.py)
    contact     dt over the contact time of a whole stone, of unbonded spheres
    co_step     co-step over the contact time of a whole stone, under bonded stones
    co_step_spheres  the same under unbonded spheres
    modes       period of the highest of the plate's modes over that contact time, under bonded stones
    modes_spheres  the same under unbonded spheres, whose push begins more sharply

A tolerance is shared out equally among time step, co-step and modes; the expected error is
their sum. It is the error of the numerical solution. Breakage is chaotic, and differs from packing to packing by far
more (docs/accuracy.md).
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from common.tables import read_toml

LAWS = Path(__file__).with_name("error_laws.toml")  # written by `make accuracy`
SHARES = 3  # time step, co-step, modes: a tolerance is shared out equally among them
DEFAULT_TOLERANCE = 0.03  # of modes where a scene says nothing; below 3 kHz their error is half its share


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
def law(name: str) -> Law:
    """The law of a numerical setting."""
    table = read_toml(LAWS)[name]
    return Law(np.array(table["settings"]), np.array(table["errors"]))


def laws_of(bonded: bool) -> tuple[str, str, str]:
    """Names of the laws of time step, co-step and modes."""
    return ("time_step", "co_step", "modes") if bonded else ("contact", "co_step_spheres", "modes_spheres")


def least_tolerance(bonded: bool) -> float:
    """The smallest tolerance that the settings measured can keep."""
    return SHARES * max(float(law(name).errors[0]) for name in laws_of(bonded))


def settings_for(tolerance: float, bonded: bool) -> tuple[float, float, float]:
    """The coarsest time step, co-step and modes that each keep their share of a tolerance of at least
    `least_tolerance`."""
    time_step, co_step, modes = (law(name).setting(tolerance / SHARES) for name in laws_of(bonded))
    return time_step, co_step, modes


def expected_error(settings: dict[str, float]) -> dict[str, float]:
    """Expected relative error by numerical setting, for the settings of a run, and their sum as "total"."""
    errors = {name: law(name).error(setting) for name, setting in settings.items()}
    return errors | {"total": sum(errors.values())}
