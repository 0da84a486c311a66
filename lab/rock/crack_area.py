"""What a crack breaks of bonds, by their section, over its own area, and the work of fracture over the bonds' fracture
energy.

Discs of the Brazilian test are pulled apart along their axis, with the bonds across their middle plane cut beyond
LIGAMENT of the radius. Bonds are those of scenes/materials/coal.toml with several fracture energies.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from common.tables import read_toml
from dem.calibration.virtual_tests import Rock, brazilian_specimen, fracture_specimen, fracture_test
from lab.rock.stone import SCENES
from lab.study import Row

LIGAMENT = 0.65
NEAR_m = 5e-3  # of the plane of the crack, a mean sub-sphere's diameter
STRAIN = 1e-4  # at failure, about
ENERGIES_J_m2 = (1.28, 2.56)


def rock(file: Path = SCENES / "materials" / "coal.toml") -> Rock:
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
    return {"crack_area": near, "work_over_energy": work / share / energy_J_m2}


def crack_area(out: Path, packings: int = 3) -> Iterator[Row]:
    """Of each packing, with each fracture energy."""
    for seed in range(20023, 20023 + packings):
        for energy in ENERGIES_J_m2:
            yield Row({"seed": seed, "bond_energy_J_m2": energy}, partial(part, seed, energy))
