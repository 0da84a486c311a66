"""The plate of a run, from its modes: its static compliance, and its stress under the recorded forces.

This is the only module of the package that needs `plate_fem`. It serves where the deflection of the actual plate on its
rods is wanted instead of the paper's beam formula.
"""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from analysis.signals.records import RecordError
from analysis.sweep.runs import Run
from analysis.theory.contact_states import places_of, setup_of
from common import hertz
from common.channels import force_column
from common.files.cache import user_cache
from common.input_error import raised_as
from common.scene.plate import FlexiblePlate
from common.tables import check
from plate_fem.modes import PlateModes, modes_for_loads
from plate_fem.motion import ModalMotion
from plate_fem.stress import HertzContact, total_stress, von_mises_3d


def modes_of(run: Run) -> PlateModes:
    """The modes that the run's plate moved in, found as the simulation finds them, or kept in the user's cache. Raises
    RecordError without a flexible plate, or for modes of another number than run.json states."""
    modes = modes_for_loads(flexible_plate(run), user_cache(), places_of(run))
    if modes.frequency_Hz.size != run.summary.n_modes:
        raise RecordError(f"{run.path}/run.json: n_modes = {run.summary.n_modes}; its plate has "
                          f"{modes.frequency_Hz.size} modes: made by another version")
    return modes


def flexible_plate(run: Run) -> FlexiblePlate:
    """Return the table of the run's plate. Raises RecordError if the scene has no flexible one."""
    plate = run.scene.plate
    if plate.thickness_m is None:
        raise RecordError(f"{run.path}/run.json: scene.plate.thickness_m = None; needs that of a plate that bends")
    if plate.max_frequency_Hz is None:
        raise RecordError(f"{run.path}/run.json: scene.plate.max_frequency_Hz = None; needs the run's own")
    with raised_as(RecordError):
        return check(FlexiblePlate, plate.as_json(), run.path / "run.json", "scene.plate")


def static_compliance_m_N(modes: PlateModes, points_m: np.ndarray) -> np.ndarray:
    """Deflection per force (k,), m/N, at points (k, 2): the sum of shape^2 / omega^2 over the modes. Modes left out
    would add a few per cent to those of a 20 mm plate up to 20 kHz. Raises RecordError for a plate that can move
    away."""
    if np.any(modes.frequency_Hz == 0):
        raise RecordError("the plate has a rigid-body mode: it has no static compliance")
    return modes.shape_at(np.asarray(points_m, dtype=float)) ** 2 @ (2 * np.pi * modes.frequency_Hz) ** -2.0


def particle_forces_N(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) of the fast stream, s, and the force of each particle on the plate (n, count), N. Raises RecordError
    if the run kept no fast stream, or not of every particle."""
    if run.fast is None:
        raise RecordError(f"{run.path}: no fast.parquet; needs it to drive the plate")
    columns = [force_column(k) for k in range(1, len(places_of(run)) + 1)]
    missing = [name for name in columns if name not in run.fast.columns]
    if missing:
        raise RecordError(f"{run.path}/fast.parquet: no column {missing[0]!r}")
    return run.fast["t_s"].to_numpy(dtype=float), run.fast[columns].to_numpy(dtype=float)


def amplitude_at_peak(modes: PlateModes, run: Run) -> np.ndarray:
    """Modal amplitudes (n,) at the instant of the largest total force: the modes are driven again by the recorded force
    of each particle at its position. The fast stream holds the mean force over each interval."""
    t_s, force_N = particle_forces_N(run)
    peak = int(np.argmax(force_N.sum(axis=1)))
    dt_s = float(np.diff(t_s).min())
    steps = np.rint(np.diff(t_s[: peak + 1]) / dt_s).astype(int)
    # The recorded force is the particles' push, downward; the modes count upward.
    drive = -force_N[: peak + 1] @ modes.shape_at(places_of(run))
    motion = ModalMotion(modes, dt_s)
    for row, gap in zip(drive[1:], steps, strict=True):
        if gap > 1:  # nothing touches where the stream has no rows
            motion.advance(np.zeros_like(row), gap - 1)
        motion.advance(row)
    return motion.amplitude


def hertz_contacts(run: Run, force_N: np.ndarray) -> list[HertzContact]:
    """The contact at each particle's position, for the force (count,) on each, as of one whole sphere: the few small
    sub-spheres that touch the plate have higher pressures, which depend more on the packing than on the stone."""
    s = setup_of(run)
    modulus_Pa = {name: hertz.contact_modulus_Pa(rock, s.plate) for name, rock in s.rocks.items()}
    rows = zip(s.places_m, force_N, run.materials, strict=True)
    return [HertzContact(x, y, max(float(f), 0.0), s.radius_m, modulus_Pa[name]) for (x, y), f, name in rows]


def contact_stress_map_Pa(modes: PlateModes, amplitude: np.ndarray, contacts: Sequence[HertzContact], number: int,
                          poisson_ratio: float, offset_m: np.ndarray) -> np.ndarray:
    """Von Mises stress (k, k) at the top surface from bending and every contact, on a square grid about contact
    `number` (from 1), at the offsets (k,) along x and along y."""
    centre = contacts[number - 1]
    x, y = np.meshgrid(centre.x_m + offset_m, centre.y_m + offset_m, indexing="ij")
    points_m = np.column_stack([x.ravel(), y.ravel()])
    return von_mises_3d(total_stress(modes, amplitude, contacts, points_m, poisson_ratio)).reshape(x.shape)


def nodal_at(modes: PlateModes, values: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """Return values (k,) at points (k, 2) of the plate, by cubic splines through those at the nodes (n_nodes,)."""
    lines = (modes.lines_x_m, modes.lines_y_m)
    return RegularGridInterpolator(lines, values.reshape(len(lines[0]), -1), method="cubic")(points_m)
