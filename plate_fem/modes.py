"""Natural modes of the plate: frequencies, shapes and what else is needed of them."""

import hashlib
import os
import zipfile
import zlib
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from plate_fem import hermite
from plate_fem.eigen import eigenmodes
from plate_fem.model import build_model
from plate_fem.residual import residual_modes
from plate_fem.stress import modal_surface_stress


@dataclass(frozen=True)
class PlateModes:
    """Modes of a flexible plate, mass-normalised: w(x, y, t) = sum_j shape_j(x, y) amplitude_j(t).

    amplitude has unit kg^1/2 m, shapes kg^-1/2. n modes in ascending frequency.
    frequency_Hz, damping_ratio: (n,); rigid-body modes have frequency zero exactly.
    nodal: (4, n_nodes, n), w, w_x, w_y, w_xy at the nodes; the deflection is bicubic between them.
    mean_shape: (n,), mean of w over the plate: displacement of its centre of mass.
    rod_force: (n_rods, n), axial force (N, tension positive) at the base of each rod.
    surface_stress: (n_nodes, 3, n), sx, sy, txy (Pa) at the top surface per amplitude.
    mass_kg: mass of the plate without rods. theory: "kirchhoff" or "mindlin".
    n_residual: how many modes, the last ones, stand for the compliance of those left out.
    """

    frequency_Hz: np.ndarray
    damping_ratio: np.ndarray
    lines_x_m: np.ndarray
    lines_y_m: np.ndarray
    nodal: np.ndarray
    mean_shape: np.ndarray
    rod_force: np.ndarray
    surface_stress: np.ndarray
    mass_kg: float
    theory: str
    n_residual: int

    @property
    def shape(self):
        """(n_nodes, n): deflection at the nodes."""
        return self.nodal[0]

    @cached_property
    def node_m(self):
        """(n_nodes, 2): positions of the nodes."""
        x, y = np.meshgrid(self.lines_x_m, self.lines_y_m, indexing="ij")
        return np.column_stack([x.ravel(), y.ravel()])

    @cached_property
    def quad(self):
        """(n_cells, 4): nodes of each cell, counter-clockwise seen from above."""
        number = np.arange(len(self.node_m)).reshape(len(self.lines_x_m), len(self.lines_y_m))
        corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
        return np.column_stack([c.ravel() for c in corners])

    @cached_property
    def largest_shape(self):
        """(n,): an upper bound for |shape| of each mode anywhere on the plate.

        From values on a grid four times as fine as the mesh and a bound for what lies between.
        """
        x, y = (_refined(lines, 4) for lines in (self.lines_x_m, self.lines_y_m))
        points = np.column_stack([v.ravel() for v in np.meshgrid(x, y, indexing="ij")])
        fine = abs(self.shape_at(points)).max(axis=0)
        coarse = abs(self.shape).max(axis=0)
        return fine + (fine - coarse)

    def shape_at(self, points_m):
        """(k, n): deflection of the modes at points (k, 2)."""
        rows = hermite.interpolation(self.lines_x_m, self.lines_y_m, points_m)
        return rows @ self.nodal.reshape(-1, self.nodal.shape[2])

    def grid(self, spacing_m):
        """Modes on a regular grid: (x_m (nx,), y_m (ny,), shape (nx, ny, n)).

        The sides are divided into cells no larger than spacing_m; two more cells beyond each edge continue
        the cubic of the outermost mesh cell smoothly.
        """
        axes = []
        for lines in (self.lines_x_m, self.lines_y_m):
            side = lines[-1] - lines[0]
            n = int(np.ceil(side / spacing_m - 1e-9))
            axes.append(lines[0] + side / n * np.arange(-2, n + 3))
        x, y = np.meshgrid(*axes, indexing="ij")
        shape = self.shape_at(np.column_stack([x.ravel(), y.ravel()]))
        return axes[0], axes[1], shape.reshape(*x.shape, -1)


def _refined(lines, times):
    return np.interp(np.arange(times * (len(lines) - 1) + 1) / times, np.arange(len(lines)), lines)


def plate_modes(plate, cache_dir=None, residual_points_m=None):
    """Return the `PlateModes` of a FlexiblePlate up to its `max_frequency_Hz`.

    cache_dir: folder for results, one .npz per table and set of points (optional). The modes below
    `max_frequency_Hz`, which take longest, have a file of their own that other points and dampings share.
    residual_points_m: (k, 2), where loads act (optional). Up to k modes above `max_frequency_Hz` are added
    that give these points the static compliance of all the modes left out (plate_fem/residual.py).
    Raises ValueError for a table whose `truncation_tolerance` has not been turned into a frequency.
    """
    if plate.max_frequency_Hz is None:
        raise ValueError("max_frequency_Hz is not known yet: see plate_fem.truncation.with_max_frequency")
    points = np.empty((0, 2)) if residual_points_m is None else np.atleast_2d(np.asarray(residual_points_m, float))
    if cache_dir is None:
        return _compute(plate, points, None)
    path = modes_file(plate, cache_dir, points)
    names = [field.name for field in fields(PlateModes)]
    if (stored := _load(path, names)) is not None:
        return _damped(PlateModes(**stored), plate)
    modes = _compute(plate, points, Path(cache_dir))
    _save(path, {name: getattr(modes, name) for name in names})
    return modes


def modes_file(plate, cache_dir, residual_points_m):
    """Where `plate_modes` keeps its result."""
    return Path(cache_dir) / f"modes-{table_hash(plate, residual_points_m)}.npz"


def _damped(modes, plate):
    return replace(modes, damping_ratio=np.full(len(modes.frequency_Hz), plate.damping_ratio))


def _save(path, arrays):
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_suffix(f".{os.getpid()}.npz")
    try:
        np.savez(beside, **arrays)
        beside.replace(path)  # at once, since another run may want the same file
    finally:
        beside.unlink(missing_ok=True)


def _load(path, names):
    """What is kept there; None if there is nothing, or a file that is cut off or foreign: it is made anew."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            if set(stored.files) != set(names):
                return None
            return {name: stored[name] if stored[name].shape else stored[name].item() for name in names}
    except (FileNotFoundError, ValueError, EOFError, zipfile.BadZipFile, zlib.error):
        return None


@cache
def _code():
    """Hash of this package, so that modes which another version of it found are not taken for those of this one."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def table_hash(plate, residual_points_m=()):
    """Hash of everything that frequencies and shapes depend on, the code included; the damping ratio is a
    number beside them."""
    table = plate.model_dump_json(exclude={"sensors", "yield_stress_Pa", "damping_ratio"})
    text = f"{_code()} {table} {np.asarray(residual_points_m, float).tolist()}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _kept_modes(plate, model, cache_dir):
    """omega^2 (n,) and vectors (size, n) up to `max_frequency_Hz`, from the cache if they are there."""
    path = None if cache_dir is None else cache_dir / f"eigen-{table_hash(plate)}.npz"
    if path is not None and (stored := _load(path, ["omega_squared", "vectors"])) is not None:
        return stored["omega_squared"], stored["vectors"]
    omega_squared, vectors = eigenmodes(model.stiffness, model.mass, plate.max_frequency_Hz)
    if path is not None:
        _save(path, {"omega_squared": omega_squared, "vectors": vectors})
    return omega_squared, vectors


def _compute(plate, residual_points_m, cache_dir):
    model = build_model(plate)
    omega_squared, vectors = _kept_modes(plate, model, cache_dir)
    n_residual = 0
    if len(residual_points_m):
        more_omega_squared, more = residual_modes(model, vectors, residual_points_m)
        omega_squared, vectors = np.append(omega_squared, more_omega_squared), np.hstack([vectors, more])
        n_residual = len(more_omega_squared)
    system = model.system
    u = model.expansion @ vectors
    u *= (sign := _sign(u[: system.n_nodes]))
    nodal = u[: 4 * system.n_nodes].reshape(4, system.n_nodes, -1)
    area = plate.length_m * plate.width_m
    return PlateModes(
        frequency_Hz=np.sqrt(omega_squared) / (2 * np.pi),
        damping_ratio=np.full(len(omega_squared), plate.damping_ratio),
        lines_x_m=system.lines_x_m,
        lines_y_m=system.lines_y_m,
        nodal=nodal,
        mean_shape=np.tensordot(hermite.integration(system.lines_x_m, system.lines_y_m), nodal, 2) / area,
        rod_force=model.rod_force @ vectors * sign,
        surface_stress=modal_surface_stress(system, u),
        mass_kg=plate.density_kg_m3 * plate.thickness_m * area,
        theory=system.theory,
        n_residual=n_residual,
    )


def _sign(shape):
    """+-1 per mode, so that the first node near the largest deflection moves up."""
    size = abs(shape).max(axis=0)
    first = (abs(shape) > 0.9 * size).argmax(axis=0)
    return np.where(shape[first, np.arange(shape.shape[1])] < 0, -1.0, 1.0)
