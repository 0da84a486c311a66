"""What a crack breaks of bonds, by their section, over its own area, and the work of fracture over the bonds' fracture
energy: `python -m benchmarks.crack_area [--packings 3]`.

Discs of the Brazilian test are pulled apart along their axis, with the bonds across their middle plane cut beyond
LIGAMENT of the radius. Bonds are those of scenes/materials/coal.toml with several fracture energies. A minute of processor
time; prints a row a test.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from common.tables import read_toml
from dem.calibration.virtual_tests import Rock, brazilian_specimen, fracture_specimen, fracture_test

LIGAMENT = 0.65
NEAR_m = 5e-3  # of the plane of the crack, a mean sub-sphere's diameter
STRAIN = 1e-4  # at failure, about
ENERGIES_J_m2 = (1.28, 2.56)


def rock(file: Path = Path("scenes/materials/coal.toml")) -> Rock:
    """The rock of a calibration."""
    table = read_toml(file)
    bond = table["bond"]
    return Rock(table["density_kg_m3"], table["youngs_modulus_Pa"], table["poisson_ratio"], 0.5, 0.6,
                bond["youngs_modulus_Pa"], bond["stiffness_ratio"], bond["tensile_strength_Pa"],
                bond["shear_strength_Pa"], float(np.tan(np.radians(bond["friction_angle_deg"]))), 0.05,
                bond["volumetric_ratio"], bond["pressure_strengthening"])


def part(seed: int, energy_J_m2: float) -> dict:
    """One disc, pulled apart."""
    disc = brazilian_specimen(0.0375, 1266, seed)
    specimen = fracture_specimen(disc, LIGAMENT)
    share = LIGAMENT**2
    with tempfile.TemporaryDirectory() as directory:
        work = fracture_test(Path(directory), specimen, replace(rock(), fracture_energy_J_m2=energy_J_m2), STRAIN)
        events = pd.read_csv(Path(directory) / "events.csv")
    near = events["area_m2"][events["z_m"].abs() < NEAR_m].sum() / (share * specimen.loaded_area_m2)
    return {"seed": seed, "bond_energy_J_m2": energy_J_m2, "crack_area": near,
            "work_over_energy": work / share / energy_J_m2}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--packings", type=int, default=3)
    options = parser.parse_args()
    rows = [part(20023 + k, energy) for k in range(options.packings) for energy in ENERGIES_J_m2]
    print(pd.DataFrame(rows).to_string(index=False, float_format=lambda x: f"{x:.3g}"))


if __name__ == "__main__":
    main()
