"""Natural modes of the plate: frequencies, shapes and what else is needed of them."""

import hashlib
import os
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from plate_fem import hermite
from plate_fem.model import build_model
from plate_fem.stress import modal_surface_stress

CACHE_FORMAT = 1  # raise when the meaning of the cached arrays changes


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


def plate_modes(plate, cache_dir=None):
    """Return the `PlateModes` of a FlexiblePlate up to its `max_frequency_Hz`.

    cache_dir: folder for results, one .npz per table (optional).
    """
    if cache_dir is None:
        return _compute(plate)
    path = Path(cache_dir) / f"modes-{table_hash(plate)}.npz"
    if path.exists():
        with np.load(path, allow_pickle=False) as stored:
            values = {name: stored[name] for name in stored.files}
        return PlateModes(**{**values, "mass_kg": float(values["mass_kg"]), "theory": str(values["theory"])})
    modes = _compute(plate)
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_suffix(f".{os.getpid()}.npz")
    np.savez(beside, **{field.name: getattr(modes, field.name) for field in fields(modes)})
    beside.replace(path)
    return modes


def table_hash(plate):
    """Hash of everything in the plate's table that its modes depend on."""
    text = plate.model_dump_json(exclude={"sensors", "yield_stress_Pa"})
    return hashlib.sha256(f"{CACHE_FORMAT} {text}".encode()).hexdigest()[:16]


def _compute(plate):
    model = build_model(plate)
    omega_squared, vectors = eigenmodes(model.stiffness, model.mass, plate.max_frequency_Hz)
    system = model.system
    u = model.expansion @ vectors
    nodal = u[: 4 * system.n_nodes].reshape(4, system.n_nodes, -1)
    sign = _sign(nodal[0])
    area = plate.length_m * plate.width_m
    n = len(omega_squared)
    return PlateModes(
        frequency_Hz=np.sqrt(omega_squared) / (2 * np.pi),
        damping_ratio=np.full(n, plate.damping_ratio),
        lines_x_m=system.lines_x_m,
        lines_y_m=system.lines_y_m,
        nodal=nodal * sign,
        mean_shape=sign * np.tensordot(hermite.integration(system.lines_x_m, system.lines_y_m), nodal, 2) / area,
        rod_force=model.rod_force @ vectors * sign,
        surface_stress=modal_surface_stress(system, u) * sign,
        mass_kg=plate.density_kg_m3 * plate.thickness_m * area,
        theory=system.theory,
    )


def _sign(shape):
    """+-1 per mode, so that the first node near the largest deflection moves up."""
    size = abs(shape).max(axis=0)
    first = (abs(shape) > 0.9 * size).argmax(axis=0)
    return np.sign(shape[first, np.arange(shape.shape[1])])


def eigenmodes(stiffness, mass, max_frequency_Hz):
    """Return (omega^2 (n,), mass-normalised vectors (size, n)) of all modes up to max_frequency_Hz.

    Sylvester's law of inertia gives their number: that of the negative pivots of K - limit M. They come
    from shift-invert Lanczos about a small negative shift, which a free plate's singular stiffness does
    not disturb. RuntimeError if the two disagree.
    """
    limit = (2 * np.pi * max_frequency_Hz) ** 2
    count = int((factor(stiffness - limit * mass).U.diagonal() < 0).sum())
    if count == 0:
        return np.empty(0), np.empty((stiffness.shape[0], 0))
    shift = -1e-4 * limit
    inverse = LinearOperator(stiffness.shape, factor(stiffness - shift * mass).solve, dtype=float)
    start = np.random.default_rng(1).standard_normal(stiffness.shape[0])
    values, vectors = eigsh(
        stiffness, count + 1, mass, sigma=shift, OPinv=inverse, v0=start, ncv=2 * count + 20, tol=1e-12
    )
    order = np.argsort(values)
    values, vectors = values[order], vectors[:, order]
    if not values[count - 1] <= limit < values[count]:
        raise RuntimeError(f"{count} modes lie below {max_frequency_Hz:g} Hz, but the eigensolver found others")
    values, vectors = values[:count], vectors[:, :count]
    values[values < 1e-9 * limit] = 0.0  # rigid-body modes, zero but for rounding
    return values, vectors / np.sqrt(np.einsum("ij,ij->j", vectors, mass @ vectors))


def factor(matrix):
    """Sparse LU of a symmetric matrix with its pivots on the diagonal."""
    symmetric = {"SymmetricMode": True}
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
