"""What a crack breaks of bonds, by their section, over its own area, and the work of fracture over the bonds' fracture
energy.

Discs of the Brazilian test are pulled apart along their axis, with the bonds across their middle plane cut beyond
LIGAMENT of the radius. Bonds are those of scenes/materials/coal.toml with several fracture energies.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from common.tables import read_toml
from dem.calibration.virtual_tests import Rock, Specimen, brazilian_specimen, run_test, tension_specimen
from lab.rock.stone import SCENES
from lab.study import Row

LIGAMENT = 0.65
NEAR_m = 5e-3  # of the plane of the crack, a mean sub-sphere's diameter
STRAIN = 1e-4  # at failure, about
ENERGIES_J_m2 = (1.28, 2.56)
PARTED = 0.1  # of the largest load: below, a specimen that is pulled has parted


def rock(file: Path = SCENES / "materials" / "coal.toml") -> Rock:
    """The rock of a calibration."""
    table = read_toml(file)
    bond = table["bond"]
    return Rock(table["density_kg_m3"], table["youngs_modulus_Pa"], table["poisson_ratio"], 0.5, 0.6,
                bond["youngs_modulus_Pa"], bond["stiffness_ratio"], bond["tensile_strength_Pa"],
                bond["shear_strength_Pa"], float(np.tan(np.radians(bond["friction_angle_deg"]))), 0.05,
                bond["volumetric_ratio"], bond["pressure_strengthening"])


def fracture_specimen(disc: Specimen, ligament: float) -> Specimen:
    """The disc of a Brazilian test in grips along its own axis, so short that it gives way steadily, without the bonds
    that cross its middle plane beyond the share `ligament` of its radius."""
    bonds, center = disc.bonds, disc.packing.center_m
    ends = center[bonds.first], center[bonds.second]
    distance = np.hypot(*(0.5 * (ends[0] + ends[1])[:, :2]).T)
    crosses = (ends[0][:, 2] > 0) != (ends[1][:, 2] > 0)
    kept = ~(crosses & (distance > ligament * disc.packing.container.half_size_m[0]))
    left = replace(bonds, **{f.name: getattr(bonds, f.name)[kept] for f in fields(bonds)})
    return replace(tension_specimen(replace(disc, axis=2, bonds=left)), kind="fracture")


def fracture_test(directory: Path, specimen: Specimen, rock: Rock, failure_strain: float) -> float:
    """Work of fracture in J/m^2: that of the grips over the whole section, until the load is PARTED of its peak.

    Raises RuntimeError if the engine fails or the specimen has not parted at ten times `failure_strain`.
    """
    record = run_test(directory, specimen, rock, failure_strain, until=PARTED)
    if record.stress_Pa[-1] > 2 * PARTED * record.stress_Pa.max():
        raise RuntimeError(f"{directory}: the specimen has not parted within 10 times the strain {failure_strain:g}")
    return float(np.trapezoid(record.stress_Pa, record.strain)) * 2 * specimen.half_size_m


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
