"""The real plate, from its modes: its static compliance, and its stress under recorded forces.

The only module that needs `plate_fem`, and only where the deflection of the actual plate
on its rods is wanted instead of the paper's beam formula.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from analysis.records import RecordError
from analysis.runs import Run


def modes_of(run: Run):
    """Modes (`plate_fem.modes.PlateModes`) of a run's plate, from the cache beside the runs where it is there.

    RecordError if the scene has no flexible plate.
    """
    from plate_fem.modes import plate_modes
    from plate_fem.scene import FlexiblePlate

    table = run.info.get("scene", {}).get("plate", {})
    if table.get("model") != "flexible":
        raise RecordError(
            f"{run.path}/run.json: scene.plate.model = {table.get('model')!r}; needs 'flexible'"
        )
    cache = Path(run.path).parent / ".modes"
    return plate_modes(FlexiblePlate.model_validate(table), cache if cache.is_dir() else None)


def static_compliance_m_N(modes, points_m: np.ndarray) -> np.ndarray:
    """Deflection per force at points (k, 2), m/N, shape (k,): sum of shape^2 / omega^2 over the modes.

    Low by what the modes left out would add (a few per cent for modes up to 20 kHz of a
    20 mm plate). RecordError for a plate that can move away freely.
    """
    if np.any(modes.frequency_Hz == 0):
        raise RecordError("the plate has a rigid-body mode: it has no static compliance")
    return modes.shape_at(np.asarray(points_m, dtype=float)) ** 2 @ (2 * np.pi * modes.frequency_Hz) ** -2.0


def amplitude_at_peak(modes, run: Run, places_m: np.ndarray) -> np.ndarray:
    """Modal amplitudes (n,) at the instant of the largest total force.

    The modes are driven again by the recorded force of each agglomerate (fast stream: the
    mean over each of its intervals), taken to act at its place (count, 2).
    """
    from plate_fem.motion import ModalMotion

    if run.fast is None:
        raise RecordError(f"{run.path}: no fast.parquet; needs it to drive the plate")
    t_s = run.fast["t_s"].to_numpy(dtype=float)
    columns = [f"force_{k:02d}_N" for k in range(1, len(places_m) + 1)]
    missing = [name for name in columns if name not in run.fast.columns]
    if missing:
        raise RecordError(f"{run.path}/fast.parquet: no column {missing[0]!r}")
    force_N = run.fast[columns].to_numpy(dtype=float)
    peak = int(np.argmax(force_N.sum(axis=1)))
    dt_s = float(np.diff(t_s).min())
    steps = np.rint(np.diff(t_s[: peak + 1]) / dt_s).astype(int)
    # The recorded force is the particles' push, downward; the modes count upward.
    drive = -force_N[: peak + 1] @ modes.shape_at(np.asarray(places_m, dtype=float))
    motion = ModalMotion(modes, dt_s)
    for row, gap in zip(drive[1:], steps, strict=True):
        if gap > 1:  # nothing touches where the stream has no rows
            motion.advance(np.zeros_like(row), gap - 1)
        motion.advance(row)
    return motion.amplitude


def surface_von_mises_Pa(modes, amplitude: np.ndarray) -> np.ndarray:
    """Von Mises stress of bending at the plate's surface at the nodes of the modes, shape (n_nodes,)."""
    from plate_fem.stress import surface_stress, von_mises

    return von_mises(surface_stress(modes, amplitude))
