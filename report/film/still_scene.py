"""The instant of the largest force, as the still picture of the page shows it."""

from __future__ import annotations

import numpy as np

from analysis import Run
from analysis.sweep.breakage import Network
from report.film.pictures import instants, read_film
from report.film.still import StillScene

#: To which the plate's motion is enlarged, as in templates/film.js.
GREATEST_DEFLECTION_M = 0.01


def largest_force_s(run: Run) -> float:
    """When the force on the plate is largest."""
    table = run.fast if run.fast is not None else run.signals
    return float(table["t_s"].iloc[int(np.argmax(table["force_N"].to_numpy()))])


def still_scene(run: Run, network: Network) -> StillScene:
    """Return the picture of a run that is nearest to its largest force. Raises MissingResult if there is none."""
    peak_s = largest_force_s(run)
    film = read_film([min(instants(run.path), key=lambda instant: abs(instant.t_s - peak_s))], network)
    is_gangue = np.array([name == "gangue" for name in run.materials])[network.agglomerate - 1]
    if not film.quad.size:
        return StillScene(film.centre_m[0], network.radius_m, is_gangue, np.empty((0, 4, 3)), np.empty(0), 1.0,
                          run.scene.plate)
    w_m = film.deflection_m[0]
    enlarged = GREATEST_DEFLECTION_M / max(float(np.abs(w_m).max()), 1e-12)
    nodes_m = np.column_stack([film.node_m, w_m * min(enlarged, 1e4)])
    stress_Pa = film.stress_Pa[0][film.quad].mean(axis=1)
    return StillScene(film.centre_m[0], network.radius_m, is_gangue, nodes_m[film.quad], stress_Pa,
                      max(float(stress_Pa.max()), 1.0), run.scene.plate)
