"""Natural modes of the plate: frequencies, shapes and what else is needed of them, such as the stress at the top
surface, from the curvature of a shape and its strain in the plane.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import chain, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from common.by_value import ByValue
from common.files.cache import cached, key_of
from common.scene.plate import FlexiblePlate
from common.tables import InputError, Refused
from plate_fem.elements import mesh
from plate_fem.elements.mesh import highest_frequency_Hz, refuse_too_many_modes
from plate_fem.elements.system import PlateSystem, sways

if TYPE_CHECKING:
    from plate_fem.solution.model import PlateModel

MOST_RESIDUAL_POINTS = 32  # each adds a mode
AT_ONCE = 48  # modes, whose unknowns are many more than what is kept of them
FINER = 3  # than the mesh, a grid on which the largest value of a shape is sought
NOWHERE = np.empty((0, 2))  # for residual modes of the rods alone


@dataclass(frozen=True, eq=False)
class PlateModes(ByValue):
    """The n modes of a flexible plate, in ascending frequency: w(x, y, t) = sum_j shape_j(x, y) amplitude_j(t).

    Shapes are mass-normalised and have unit kg^-1/2, amplitudes kg^1/2 m.

    frequency_Hz, damping_ratio (n,): rigid-body modes have frequency zero exactly.
    lines_x_m, lines_y_m: grid lines of the mesh; node (i, j) has number i * len(lines_y_m) + j.
    nodal (4, n_nodes, n): w, w_x, w_y, w_xy at the nodes; the deflection is bicubic between them.
    mean_shape (n,): mean of w over the mass of plate and ribs, the displacement of their centre of mass.
    rod_force (n_rods, n): axial force (N, tension positive) at the base of each rod, per amplitude.
    surface_stress (n_nodes, 3, n): sx, sy, txy (Pa) at the top surface, per amplitude, in single precision.
    mass_kg: mass of plate and ribs without rods.
    theory: "kirchhoff" or "mindlin".
    n_residual: how many modes, the last ones, stand for the compliance of the rest (plate_fem/solution/eigen.py).
    lateral (n_nodes, 2, n): displacement of the top surface along x and y at the nodes, of a plate that can sway; no
        rows of one that cannot. In single precision.

    >>> modes = plate_modes(read_plate("scenes/small.toml").model_copy(update={"max_frequency_Hz": 500.0}))
    >>> modes.shape_at([[0.0, 0.17]]).shape == (1, modes.frequency_Hz.size)
    True
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
    lateral: np.ndarray = field(default_factory=lambda: np.empty((0, 2, 0)))

    @property
    def shape(self) -> np.ndarray:
        """(n_nodes, n): deflection at the nodes."""
        return self.nodal[0]

    @cached_property
    def momentum(self) -> np.ndarray:
        """(n,): upward momentum of plate and rods per rate, of a plate that rods alone hold, or edges without rods.

        Lifted as a whole by the feet of its rods, the plate moves by the sum of all modes times their momentum, if
        there are residual modes of the rods. A mode gives the feet omega^2 times as much force as it has momentum; one
        on rods so soft that its frequency is zero has that of the plate.
        """
        omega_squared = (2 * np.pi * self.frequency_Hz) ** 2
        return np.divide(self.rod_force.sum(axis=0), omega_squared, out=self.mass_kg * self.mean_shape,
                         where=(omega_squared > 0) & (len(self.rod_force) > 0))

    @cached_property
    def node_m(self) -> np.ndarray:
        """(n_nodes, 2): positions of the nodes."""
        return mesh.nodes(self.lines_x_m, self.lines_y_m)

    @cached_property
    def quad(self) -> np.ndarray:
        """(n_cells, 4): nodes of each cell, counter-clockwise seen from above."""
        number = np.arange(len(self.node_m)).reshape(len(self.lines_x_m), len(self.lines_y_m))
        corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
        return np.column_stack([c.ravel() for c in corners])

    @cached_property
    def largest_shape(self) -> np.ndarray:
        """(n,): an upper bound for |shape| of each mode anywhere on the plate.

        It is the largest value on a grid FINER times as fine as the mesh, by what a plane wave exceeds such values by,
        plus what it exceeds those of the nodes by.
        """
        points = mesh.nodes(*(_refined(lines, FINER) for lines in (self.lines_x_m, self.lines_y_m)))
        fine = np.concatenate([abs(shape).max(axis=0) for shape in self.shapes_at(points)])
        wave = 1 - (np.pi / (FINER * mesh.CELLS_PER_WAVELENGTH)) ** 2 / 2  # half a cell of the grid from its crest
        return fine / wave + fine - abs(self.shape).max(axis=0)

    def shape_at(self, points_m: ArrayLike) -> np.ndarray:
        """Return the deflection (k, n) of the modes at points (k, 2) of the plate. Raises InputError for another."""
        points = refuse_off_plate(points_m, self.lines_x_m[[0, -1]], self.lines_y_m[[0, -1]])
        return np.hstack(list(self.shapes_at(points)))

    def shapes_at(self, points_m: np.ndarray) -> Iterator[np.ndarray]:
        """Yield the deflection (k, m) at points (k, 2) of m modes after others: all at once may fill much memory.
        Beyond an edge the cubics of the outermost cells go on."""
        rows = mesh.bicubics(self.lines_x_m, self.lines_y_m).values(points_m)
        for part in self.parts():
            yield rows @ part.nodal.reshape(rows.shape[1], -1)

    def grid(self, spacing_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the lines x_m (nx,) and y_m (ny,) of a regular grid.

        The sides are divided into cells no larger than spacing_m. Two more cells beyond each edge continue the cubic of
        the outermost mesh cell smoothly.
        """
        axes = []
        for lines in (self.lines_x_m, self.lines_y_m):
            side = lines[-1] - lines[0]
            n = int(np.ceil(side / spacing_m - 1e-9))
            axes.append(lines[0] + side / n * np.arange(-2, n + 3))
        return axes[0], axes[1]

    def lateral_grid(self, x_m: np.ndarray, y_m: np.ndarray, axis: int) -> np.ndarray:
        """Return `lateral` along one axis on a grid, (nx, ny, n), by cubic splines that continue beyond the edges."""
        nodes = self.lateral[:, axis].reshape(len(self.lines_x_m), len(self.lines_y_m), -1)
        along_x, along_y = (make_interp_spline(lines, np.eye(len(lines)))(at)
                            for lines, at in ((self.lines_x_m, x_m), (self.lines_y_m, y_m)))
        return np.asarray(along_y @ np.tensordot(along_x, nodes, 1))

    def parts(self) -> Iterator[PlateModes]:
        """Some of the modes after the others."""
        of_all = ("frequency_Hz", "damping_ratio", "nodal", "mean_shape", "rod_force", "surface_stress", "lateral")
        for k in range(0, len(self.frequency_Hz), AT_ONCE):
            yield replace(self, **{name: getattr(self, name)[..., k : k + AT_ONCE] for name in of_all})


def refuse_off_plate(points_m: ArrayLike, *ends_m: ArrayLike) -> np.ndarray:
    """Return points (k, 2) as numbers. Raises InputError for one that is not between the ends of the plate along x and
    along y, but for rounding."""
    points = np.atleast_2d(np.asarray(points_m, float))
    if points.ndim != 2 or points.shape[1] != 2:
        raise InputError(f"points_m has shape {points.shape}; must be points (x, y), (k, 2)")
    for name, values, (low, high) in zip("xy", points.T, np.asarray(ends_m, float), strict=True):
        off = ~((values >= low - 1e-9) & (values <= high + 1e-9))
        if off.any():
            raise InputError(f"{name} = {values[off][0]:g}: must lie on the plate, from {low:g} to {high:g} m")
    return points


def _refined(lines: np.ndarray, times: int) -> np.ndarray:
    return np.interp(np.arange(times * (len(lines) - 1) + 1) / times, np.arange(len(lines)), lines)


def modes_for_loads(plate: FlexiblePlate, cache_dir: Path | None, places_m: np.ndarray) -> PlateModes:
    """Return the modes of a plate on which stones fall at places (k, 2), as a run has them.

    A few places get the static compliance of the modes left out. More would need a mode each, and have the rods'
    share of it alone.
    """
    return plate_modes(plate, cache_dir, places_m if len(places_m) <= MOST_RESIDUAL_POINTS else NOWHERE)


def plate_modes(plate: FlexiblePlate, cache_dir: str | Path | None = None,
                residual_points_m: np.ndarray | None = None) -> PlateModes:
    """Return the modes of a plate up to its `max_frequency_Hz`.

    cache_dir: directory for results (common/files/cache.py), with an entry for each table and set of points. The modes
    below `max_frequency_Hz`, which take longest, have an entry of their own that other points and damping ratios
    share. Without it nothing is kept.
    residual_points_m (k, 2): where loads act. Up to k modes above `max_frequency_Hz` are added, which give these
    points the static compliance of all the modes left out (plate_fem/solution/eigen.py), and one for each rod, with
    which the rods bear their exact share of a steady force anywhere. Without it there are none.
    Raises InputError for points off the plate, and Refused for a table without `max_frequency_Hz`, with too many cells
    or modes, or whose numbers are so extreme that they cannot be found.

    >>> plate = FlexiblePlate(size_m=(1.0, 1.0), thickness_m=0.01, edges="simply_supported",
    ...     density_kg_m3=7830.0, youngs_modulus_Pa=2.07e11, poisson_ratio=0.3, damping_ratio=0.0, max_frequency_Hz=60)
    >>> exact_Hz = np.pi * np.sqrt(2.07e11 * 0.01**2 / (12 * (1 - 0.3**2) * 7830.0))
    >>> bool(abs(plate_modes(plate).frequency_Hz[0] / exact_Hz - 1) < 2e-3)
    True
    """
    if not isinstance(plate, FlexiblePlate):
        raise InputError(f"plate is a {type(plate).__name__}; must be a FlexiblePlate, such as read_plate(FILE) gives")
    refuse_too_many_modes(plate)
    cache_dir = None if cache_dir is None else Path(cache_dir)
    points = None if residual_points_m is None else refuse_off_plate(
        np.reshape(residual_points_m, (-1, 2)), *([-side / 2, side / 2] for side in plate.size_m))
    names, key = [one.name for one in fields(PlateModes)], table_hash(plate, points)

    def find() -> dict[str, object]:
        try:
            modes = _compute(plate, points, cache_dir)
        except (RuntimeError, np.linalg.LinAlgError) as error:  # of a factor, or of the eigensolver
            why = " ".join(str(error).split())
            raise Refused("thickness_m", plate.thickness_m, f"modes cannot be found ({why}): stiffness, density and "
                          "size of plate and rods must be less extreme") from error
        return {name: getattr(modes, name) for name in names}

    stored = cached(cache_dir, "modes", key, find)
    values: dict[str, Any] = {name: stored[name] if stored[name].shape else stored[name].item() for name in names}
    return replace(PlateModes(**values), damping_ratio=np.full(len(values["frequency_Hz"]), plate.damping_ratio))


def table_hash(plate: FlexiblePlate, residual_points_m: np.ndarray | None = None) -> str:
    """Return a hash of everything that frequencies and shapes depend on, the code included.

    The damping ratio does not belong to it: frequencies and shapes are those without damping.
    """
    table = plate.model_dump_json(exclude={"sensors", "yield_stress_Pa", "damping_ratio", "tilt_deg", "wall_height_m"})
    return key_of(Path(__file__), table, None if residual_points_m is None else np.asarray(residual_points_m).tolist())


def _kept_modes(plate: FlexiblePlate, model: PlateModel, cache_dir: Path | None) -> tuple[np.ndarray, sp.csc_array]:
    """Return omega^2 (n,) and sparse vectors (size, n) up to `max_frequency_Hz`, from the cache if they are there."""

    def find() -> dict[str, np.ndarray]:
        from plate_fem.solution.eigen import eigenmodes

        omega_squared, vectors = eigenmodes(model.parts, highest_frequency_Hz(plate))
        return {"omega_squared": omega_squared, "data": vectors.data, "row": vectors.indices, "start": vectors.indptr}

    kept = cached(cache_dir, "eigen", table_hash(plate), find)
    shape = (model.stiffness.shape[0], len(kept["omega_squared"]))
    return kept["omega_squared"], sp.csc_array((kept["data"], kept["row"], kept["start"]), shape=shape)


def _compute(plate: FlexiblePlate, residual_points_m: np.ndarray | None, cache_dir: Path | None) -> PlateModes:
    from plate_fem.elements import ribs
    from plate_fem.elements.rods import load_rows
    from plate_fem.solution.model import (
        LOAD_RADIUS,
        build_model,  # late: most modes are in the cache
        residual_modes,
    )

    model = build_model(plate)
    omega_squared, kept = _kept_modes(plate, model, cache_dir)
    vectors = (kept[:, k : k + AT_ONCE].toarray() for k in range(0, kept.shape[1], AT_ONCE))
    residual: list[np.ndarray] = []
    loads = [] if residual_points_m is None else [
        load_rows(model.system, residual_points_m, LOAD_RADIUS * plate.thickness_m) @ model.expansion, model.rod_force]
    if any(rows.shape[0] for rows in loads):
        more_omega_squared, *residual = residual_modes(model, kept, sp.csr_array(sp.vstack(loads)))
        omega_squared = np.append(omega_squared, more_omega_squared)
    model = replace(model)  # without the factors of its parts, which nothing needs any more
    system = model.system
    nodes_m = mesh.nodes(system.lines_x_m, system.lines_y_m)
    momentum = ribs.momentum(system)
    momentum[: system.deflections.size] += plate.density_kg_m3 * plate.thickness_m * system.deflections.integrals
    rows, mass_kg = _rows_of(system, nodes_m, momentum), float(momentum[: system.deflections.size].sum())
    shapes = (_shapes_of(model, rows, some) for some in chain(vectors, residual))
    nodal, surface_stress, lateral, moved, rod_force = _in_one_piece(shapes, len(omega_squared))
    return PlateModes(
        frequency_Hz=np.sqrt(omega_squared) / (2 * np.pi),
        damping_ratio=np.full(len(omega_squared), plate.damping_ratio),
        lines_x_m=system.lines_x_m, lines_y_m=system.lines_y_m, theory=system.theory,
        nodal=nodal, rod_force=rod_force, surface_stress=surface_stress, lateral=lateral,
        mean_shape=moved / mass_kg, mass_kg=mass_kg, n_residual=len(omega_squared) - kept.shape[1])


def _rows_of(system: PlateSystem, nodes_m: np.ndarray, momentum: np.ndarray) -> list[sp.csr_array]:
    """Return the sparse matrices (k, system.size) that give w, w_x, w_y and w_xy at nodes (k, 2), the stress and the
    displacement of the top surface there, and momentum."""
    top, swaying = system.plate.thickness_m / 2, nodes_m[: None if sways(system.plate) else 0]
    return [sp.vstack([system.deflection(nodes_m, by) for by in ((0, 0), (1, 0), (0, 1), (1, 1))]),
            sp.vstack(surface_stress_rows(system, nodes_m)),
            sp.vstack([system.lateral(swaying, axis, top) for axis in (0, 1)]), sp.csr_array(momentum[None])]


def _in_one_piece(shapes: Iterable[tuple[np.ndarray, ...]], count: int) -> list[np.ndarray]:
    """Return what `_shapes_of` gives for some vectors after the others, `count` in all, each in one piece."""
    found, start = list[np.ndarray](), 0
    for parts in shapes:
        end = start + parts[0].shape[-1]
        found = found or [np.empty((*part.shape[:-1], count), part.dtype) for part in parts]
        for whole, part in zip(found, parts, strict=True):
            whole[..., start:end] = part
        start = end
    return found


def _shapes_of(model: PlateModel, rows: list[sp.csr_array], vectors: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return `nodal`, `surface_stress`, `lateral`, the momentum and `rod_force` of PlateModes for some of its vectors
    (size, n), by the rows of `_rows_of`."""
    of_plate, n = model.expansion @ vectors, vectors.shape[1]
    w, stress, lateral, momentum = (one @ of_plate for one in rows)
    w, force = w.reshape(4, -1, n), model.rod_force @ vectors
    sign = _sign(w[0])
    stress, lateral = (np.asarray(sign * of.reshape(axes, -1, n).swapaxes(0, 1), np.float32)
                       for of, axes in ((stress, 3), (lateral, 2)))
    return sign * w, stress, lateral, sign * momentum[0], sign * force


def _sign(shape: np.ndarray) -> np.ndarray:
    """Return +1 or -1 for each mode, so that the first node near the largest deflection moves up."""
    first = (abs(shape) > 0.9 * abs(shape).max(axis=0)).argmax(axis=0)
    return np.where(shape[first, np.arange(shape.shape[1])] < 0, -1.0, 1.0)


def surface_stress_rows(system: PlateSystem, points_m: np.ndarray) -> list[sp.csr_array]:
    """Return the sparse matrices (k, system.size) of sx, sy, txy (Pa) of the top surface at points (k, 2); where
    curvature jumps they are the mean of its sides.

    The strain is that of the mid-plane less t/2 times the curvature: theta_x,x, theta_y,y and theta_x,y + theta_y,x,
    with theta = grad w in Kirchhoff's theory.
    """
    plate, nu, beside_m = system.plate, system.plate.poisson_ratio, 1e-9 * max(system.plate.size_m)
    sides = [points_m + beside_m * np.array(side) for side in product((-1, 1), repeat=2)]
    xx, yy, xy = (sum(middle - plate.thickness_m / 2 * bent for middle, bent in of_sides) / len(sides) for of_sides in
                  zip(*(zip(system.stretch(at), system.curvature(at), strict=True) for at in sides), strict=True))
    scale = plate.youngs_modulus_Pa / (1 - nu**2)
    return [scale * (xx + nu * yy), scale * (yy + nu * xx), scale * (1 - nu) / 2 * xy]
