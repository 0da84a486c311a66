"""Makes lab/known_truth/data/solid_plate.npz: modes of the paper's plate as a 3D solid, by CalculiX.

One quarter of plate and rods, meshed in 20-node bricks (tests/plate_fem/solid.py); the four combinations of even and odd
about the two mirror planes give all modes below 8 kHz, or below `highest_Hz`. Deflections of the mid-plane, on a regular
grid over that quarter; lab/known_truth/other_plates.py mirrors it. With another `highest_Hz` the file is OUT/solid_plate.npz.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import CloughTocher2DInterpolator

from lab.known_truth.other_plates import SOLID
from lab.study import Row
from tests.plate_fem.solid import solid_modes

STEEL = {"density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11, "poisson_ratio": 0.3}
HALF_m, THICKNESS_m, ROD_m, DIAMETER_m, LENGTH_m = 0.25, 0.02, 0.2, 0.02, 0.1  # as in scenes/paper.toml
HIGHEST_Hz, COUNT, CELLS, FINE = 8000.0, 26, 64, 1
MORE = 1.3  # modes per hertz up to a higher limit: those within the plane become more frequent


def quarter(folder: Path, symmetry: str, highest_Hz: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (n,) and deflections (k, k, n) on the grid's quarter x, y >= 0, mass-normalised for the whole."""
    count = COUNT if highest_Hz <= HIGHEST_Hz else round(MORE * COUNT * highest_Hz / HIGHEST_Hz)
    frequency, node_m, motion = solid_modes(folder, HALF_m, THICKNESS_m, ROD_m, DIAMETER_m, LENGTH_m, STEEL, symmetry,
                                            count, FINE)
    if frequency[-1] < highest_Hz:
        raise RuntimeError(f"{count} modes of symmetry {symmetry!r} end at {frequency[-1]:.0f} Hz")
    kept = frequency < highest_Hz
    x, y = np.meshgrid(*2 * [np.linspace(0, HALF_m, CELLS // 2 + 1)], indexing="ij")
    return frequency[kept], CloughTocher2DInterpolator(node_m, motion[kept, :, 2].T)(x, y) / 2


def solid_plate(out: Path, highest_Hz: float = HIGHEST_Hz) -> Iterator[Row]:
    """A row a symmetry, with its number of modes; what was found stands in a file of each."""
    def found(symmetry: str) -> dict[str, float]:
        with tempfile.TemporaryDirectory() as folder:
            frequency, part = quarter(Path(folder), symmetry, highest_Hz)
        np.savez(out / f"solid_{symmetry}.npz", frequency=frequency, part=part)
        return {"highest_Hz": highest_Hz, "modes": len(frequency), "lowest_mode_Hz": frequency[0]}

    for symmetry in ("ss", "sa", "aa"):
        yield Row({"symmetry": symmetry}, partial(found, symmetry))


def solid_plate_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    frequencies, shapes, mirrors = [], [], []
    for symmetry in rows["symmetry"]:
        with np.load(out / f"solid_{symmetry}.npz") as data:
            found, part = data["frequency"], data["part"]
        turned = [(symmetry, part)]
        if symmetry == "sa":  # the plate is square: "as" is the same, turned
            turned.append(("as", part.swapaxes(0, 1)))
        for kinds, shape in turned:
            frequencies.append(found)
            shapes.append(shape)
            mirrors += len(found) * [[1 if kind == "s" else -1 for kind in kinds]]
    frequency, shape = np.concatenate(frequencies), np.concatenate(shapes, axis=2)
    order = np.argsort(frequency)
    file = SOLID if rows["highest_Hz"].iloc[0] == HIGHEST_Hz else out / "solid_plate.npz"
    np.savez_compressed(file, frequency_Hz=frequency[order], lines_m=np.linspace(0, HALF_m, CELLS // 2 + 1),
                        quarter_shape=shape[..., order].astype(np.float32), mirror=np.array(mirrors)[order])
    return rows
