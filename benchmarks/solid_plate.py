"""Makes recognition/evaluation/data/solid_plate.npz: modes of the paper's plate as a 3D solid, by CalculiX.

    python benchmarks/solid_plate.py [--highest HZ] [--out FILE]

One quarter of plate and rods, meshed in 20-node bricks (tests/plate_fem/solid.py); the four combinations of even and
odd about the two mirror planes give all modes below 8 kHz, or below HZ. Deflections of the mid-plane, on a regular grid over that
quarter; solid_plate of recognition/evaluation/other_plates.py mirrors it.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.interpolate import CloughTocher2DInterpolator

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests/plate_fem"))
from solid import solid_modes  # type: ignore[import-not-found]  # noqa: E402

STEEL = {"density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11, "poisson_ratio": 0.3}
HALF_m, THICKNESS_m, ROD_m, DIAMETER_m, LENGTH_m = 0.25, 0.02, 0.2, 0.02, 0.1  # as in scenes/paper.toml
HIGHEST_Hz, COUNT, CELLS, FINE = 8000.0, 26, 64, 1
MORE = 1.3  # modes per hertz up to a higher limit: those within the plane become more frequent
OUT = ROOT / "recognition/evaluation/data/solid_plate.npz"


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--highest", type=float, default=HIGHEST_Hz)
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    frequencies, shapes, mirrors = [], [], []
    for symmetry in ("ss", "sa", "aa"):
        with tempfile.TemporaryDirectory() as folder:
            found, part = quarter(Path(folder), symmetry, options.highest)
        turned = [(symmetry, part)]
        if symmetry == "sa":  # the plate is square: "as" is the same, turned
            turned.append(("as", part.swapaxes(0, 1)))
        for kinds, shape in turned:
            frequencies.append(found)
            shapes.append(shape)
            mirrors += len(found) * [[1 if kind == "s" else -1 for kind in kinds]]
    frequency, shape = np.concatenate(frequencies), np.concatenate(shapes, axis=2)
    order = np.argsort(frequency)
    lines = np.linspace(0, HALF_m, CELLS // 2 + 1)
    np.savez_compressed(options.out, frequency_Hz=frequency[order], lines_m=lines,
                        quarter_shape=shape[..., order].astype(np.float32), mirror=np.array(mirrors)[order])


if __name__ == "__main__":
    main()
