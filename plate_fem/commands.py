"""What the commands on a plate alone answer: `modes` and `motion`."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from common.files.cache import user_cache
from common.files.export import export, refuse_export
from common.files.output_directory import is_stamped, refuse_file, stamped
from common.process.messages import told
from common.result import Result
from common.scene.plate import FlexiblePlate, read_plate
from common.tables import InputError, refused_in
from plate_fem.modes import PlateModes, plate_modes


@dataclass(frozen=True)
class ModesResult(Result):
    """Modes by rising frequency, of a plate of so many cells, and the file of their shapes if one was asked for."""

    theory: str
    cells: int
    mass_kg: float
    frequency_Hz: tuple[float, ...]
    damping_ratio: tuple[float, ...]
    shapes: Path | None

    def words(self) -> Iterator[str]:
        yield f"# {self.theory} plate, {self.cells} cells, mass {self.mass_kg:.6g} kg"
        yield f"{'mode':>5} {'Hz':>12} {'damping':>9}"
        for number, (frequency, damping) in enumerate(zip(self.frequency_Hz, self.damping_ratio, strict=True), 1):
            yield f"{number:5d} {frequency:12.4f} {damping:9.5f}"


def modes(scene_file: Path, out: Path | None = None) -> ModesResult:
    """Find the natural frequencies and damping ratios of a scene's plate; write the shapes to `out` (.vtu).

    Raises InputError for a scene that cannot be read, or whose plate is rigid or has no `max_frequency_Hz`.
    """
    plate = read_plate(scene_file)
    if not isinstance(plate, FlexiblePlate):
        raise InputError(f"{scene_file}: plate.thickness_m is missing: must be given for a plate with modes")
    if plate.max_frequency_Hz is None:
        raise InputError(f"{scene_file}: plate.max_frequency_Hz is missing: it must be given to list modes without "
                         "stones")
    if out is not None:
        refuse_file(str(out), is_stamped, ".vtu")
    with refused_in(scene_file, "plate"), told(f"{scene_file}: modes"):
        found = plate_modes(plate, user_cache())
    if out is not None:
        write_shapes(found, out)
    return ModesResult(found.theory, len(found.quad), float(found.mass_kg), tuple(found.frequency_Hz.tolist()),
                       tuple(found.damping_ratio.tolist()), out)


@dataclass(frozen=True)
class MotionResult(Result):
    """Largest displacement, velocity and acceleration at points of a run's plate, the table of them over time if one
    was asked for, and how large the file is that they follow from."""

    at_m: tuple[tuple[float, float], ...]
    max_u_m: tuple[float, ...]
    max_v_m_s: tuple[float, ...]
    max_a_m_s2: tuple[float, ...]
    table: Path | None
    modes_bytes: int

    def words(self) -> Iterator[str]:
        yield f"{'x, m':>9} {'y, m':>9} {'max u, m':>11} {'max v, m/s':>11} {'max a, m/s2':>11}"
        for (x_m, y_m), *largest in zip(self.at_m, self.max_u_m, self.max_v_m_s, self.max_a_m_s2, strict=True):
            yield f"{x_m:9.6g} {y_m:9.6g} " + " ".join(f"{value:11.6g}" for value in largest)
        yield (f"from {self.modes_bytes / 1e3:.0f} kB of modes, without the low pass of signals.parquet"
               + (f", written to {self.table}" if self.table else ""))


def motion(directory: Path, at_m: Sequence[Sequence[float]], out: Path | None = None) -> MotionResult:
    """The vertical motion, upwards, of points of the plate of a run, at its samples and without any filter, so that
    vibration above half their rate folds back; over time in `out` (.csv or .xlsx): `t_s`, and for each point from 1
    `u_1_m`, `v_1_m_s`, `a_1_m_s2`. Raises InputError."""
    from plate_fem.motion import FILE, RecordedMotion

    if out is not None:
        refuse_export(out)
    recorded = RecordedMotion.read(directory)
    found = recorded.at(at_m)
    if out is not None:
        import pandas as pd

        columns = {f"{name[0]}_{k + 1}{name[1:]}": found[name][:, k] for k in range(len(at_m)) for name in found}
        export({"motion": pd.DataFrame({"t_s": recorded.t_s, **columns})}, out)
    largest = {f"max_{name}": tuple(abs(values).max(axis=0).tolist()) for name, values in found.items()}
    return MotionResult(at_m=tuple((float(x), float(y)) for x, y in at_m), table=out,
                        modes_bytes=(directory / FILE).stat().st_size, **largest)


def write_shapes(modes: PlateModes, out: Path) -> None:
    """Write the mesh (.vtu) with one field of vertical displacement per mode, scaled to a largest value of one, or zero
    where rods twist below a plate at rest."""
    import meshio
    import numpy as np

    from common.files.whole import written_whole

    points = np.column_stack([modes.node_m, np.zeros(len(modes.node_m))])
    largest = abs(modes.shape).max(axis=0)
    shape = modes.shape / np.where(largest > 0, largest, 1.0)
    columns = zip(modes.frequency_Hz, shape.T, strict=True)
    fields = {f"mode_{j:03d}_{frequency:.1f}_Hz": column for j, (frequency, column) in enumerate(columns, 1)}
    with written_whole(out) as beside:
        meshio.Mesh(points, [("quad", modes.quad)], point_data=fields).write(beside, file_format="vtu")
        beside.write_text(stamped(beside.read_text()))
