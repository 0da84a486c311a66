"""view.pvd: particles, bonds and the plate for ParaView, on one time axis in seconds."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pandas as pd

from dem.assembly import Assembly
from dem.bonds import fragments
from dem.time_step import TimeStep
from plate_fem.modes import PlateModes
from plate_fem.stress import surface_stress, von_mises


def write_view(directory: Path, dump: Path, assembly: Assembly, step: TimeStep, events: pd.DataFrame,
               modes: PlateModes | None, amplitudes: list[np.ndarray]) -> None:
    """Turn the engine's dump into view/*.vtu and view.pvd in `directory`."""
    pictures = directory / "view"
    pictures.mkdir()
    broken_at = np.full(assembly.n_bonds, np.inf)
    broken_at[events["bond"].to_numpy(dtype=int) - 1] = events["t_s"]
    entries = []
    for k, (dem_step, particles) in enumerate(read_dump(dump)):
        t = dem_step * step.dt_s
        intact = broken_at > t + 0.5 * step.dt_s
        entries.append((t, 0, _write(pictures / f"particles_{k:04d}.vtu", _particles(particles, assembly, intact))))
        if assembly.n_bonds:
            entries.append((t, 1, _write(pictures / f"bonds_{k:04d}.vtu", _bonds(particles, assembly, intact))))
        if modes is not None:
            entries.append((t, 2, _write(pictures / f"plate_{k:04d}.vtu", _plate(modes, amplitudes[k]))))
    _write_pvd(directory / "view.pvd", entries)


def read_dump(file: Path):
    """Yield (DEM step, array (n, columns) sorted by id) of each frame of `dump custom id x y z ...`."""
    with open(file) as lines:
        for line in lines:
            if not line.startswith("ITEM: TIMESTEP"):
                raise RuntimeError(f"{file}: not a dump of the engine")
            dem_step = int(next(lines))
            next(lines)
            count = int(next(lines))
            for _ in range(5):
                next(lines)
            text = [next(lines) for _ in range(count)]
            frame = np.array([row.split() for row in text], dtype=float).reshape(count, -1)
            yield dem_step, frame[np.argsort(frame[:, 0])]


def _particles(frame: np.ndarray, assembly: Assembly, intact: np.ndarray) -> meshio.Mesh:
    n = len(frame)
    label = fragments(assembly.n_particles, assembly.bond_first, assembly.bond_second, intact)
    return meshio.Mesh(
        frame[:, 1:4], [("vertex", np.arange(n).reshape(-1, 1))],
        point_data={"radius_m": frame[:, 7], "velocity_m_s": frame[:, 4:7], "material": assembly.material + 1.0,
                    "agglomerate": assembly.agglomerate + 1.0, "fragment": label + 1.0})


def _bonds(frame: np.ndarray, assembly: Assembly, intact: np.ndarray) -> meshio.Mesh:
    ends = np.column_stack([assembly.bond_first, assembly.bond_second])[intact]
    length = np.linalg.norm(frame[ends[:, 1], 1:4] - frame[ends[:, 0], 1:4], axis=1)
    strain = length / np.linalg.norm(assembly.bond_vector_m[intact], axis=1) - 1
    return meshio.Mesh(frame[:, 1:4], [("line", ends)],
                       cell_data={"strain": [strain], "radius_m": [assembly.bond_radius_m[intact]],
                                  "agglomerate": [assembly.agglomerate[ends[:, 0]] + 1.0]})


def _plate(modes: PlateModes, amplitude: np.ndarray) -> meshio.Mesh:
    w = modes.shape @ amplitude
    points = np.column_stack([modes.node_m, np.zeros(len(w))])
    displacement = np.column_stack([np.zeros((len(w), 2)), w])
    return meshio.Mesh(points, [("quad", modes.quad)],
                       point_data={"displacement_m": displacement,
                                   "von_mises_Pa": von_mises(surface_stress(modes, amplitude))})


def _write(file: Path, mesh: meshio.Mesh) -> str:
    mesh.write(file, file_format="vtu")
    return f"view/{file.name}"


def _write_pvd(file: Path, entries: list[tuple[float, int, str]]) -> None:
    rows = "\n".join(f'    <DataSet timestep="{t:.9g}" part="{part}" file="{name}"/>' for t, part, name in entries)
    file.write_text('<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
                    f"  <Collection>\n{rows}\n  </Collection>\n</VTKFile>\n")
