"""Static deflection of a held plate."""

import numpy as np

from plate_fem.solution.eigen import factor


def pressure_load(model):
    """Load vector (n,) of a unit pressure (1 Pa, upward) on the whole plate, over the free unknowns."""
    weights = model.system.deflections.integrals
    return model.expansion.T @ np.pad(weights, (0, model.system.size - len(weights)))


def static_response(model, loads):
    """Free unknowns (n, k) at rest under loads (n, k); RuntimeError if the plate is not held."""
    response = factor(model.stiffness).solve(np.asarray(loads, float))
    scale = abs(model.stiffness).max()
    residual = abs(model.stiffness @ response - loads).max()
    if not residual <= 1e-6 * max(abs(np.asarray(loads)).max(), 1e-12 * scale * abs(response).max()):
        raise RuntimeError("the plate is not held: it has no static deflection")
    return response
