"""Settings that keep a tolerance, and the error that settings are expected to have.

A tolerance is shared out equally among time step, co-step and modes (common/scene/error_laws.py); the expected error is
their sum. It is the error of the numerical solution. Breakage is chaotic, and differs from packing to packing by far
more (docs/accuracy.md).
"""

from __future__ import annotations

from common.scene.error_laws import SHARES, law
from common.scene.plate import FlexiblePlate

CUT_OFF_ERROR = 0.01  # that modes left out may make where a scene says nothing; below 3 kHz it is half as much


def modes_setting(bonded: bool) -> str:
    """Name of the error law of the modes."""
    return "modes" if bonded else "modes_spheres"


def co_step_setting(bonded: bool) -> str:
    """Name of the error law of the co-step."""
    return "co_step" if bonded else "co_step_spheres"


def setting_for(name: str, tolerance: float) -> float:
    """The coarsest value of a numerical setting that keeps its share of a tolerance of at least `least_tolerance`."""
    return law(name).setting(tolerance / SHARES)


def with_cut_off(plate: FlexiblePlate, tolerance: float | None, contact_time_s: float, bonded: bool) -> FlexiblePlate:
    """The plate's table with its `max_frequency_Hz`, or with that of the tolerance, or of an error of its modes of
    CUT_OFF_ERROR."""
    if plate.max_frequency_Hz is not None:
        return plate
    setting = law(modes_setting(bonded)).setting(CUT_OFF_ERROR if tolerance is None else tolerance / SHARES)
    return plate.model_copy(update={"max_frequency_Hz": 1 / (setting * contact_time_s)})


def expected_error(settings: dict[str, float]) -> dict[str, float]:
    """Expected relative error by numerical setting, for the settings of a run, and their sum as "total"."""
    errors = {name: law(name).error(setting) for name, setting in settings.items()}
    return errors | {"total": sum(errors.values())}
