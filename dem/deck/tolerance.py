"""Settings that keep a tolerance, and the error that settings are expected to have.

A tolerance is shared out equally among time step, co-step and modes (common/error_laws.py); the expected error is the sum.
It is that of the numerical solution; breakage is chaotic, and differs from packing to packing by far more
(docs/accuracy.md).
"""

from __future__ import annotations

from common.error_laws import KNOBS, law
from common.plate import FlexiblePlate
from plate_fem.truncation import with_max_frequency


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
