"""Fit the bonds of a material to its rock: `python -m dem calibrate MATERIAL --scene SCENE --out DIR`.

Specimens of the virtual tests have the sub-spheres of the scene's stones, by size. In this order:

1. stiffness ratio to Poisson's ratio, within MAX_STIFFNESS_RATIO, by `network_stiffness`;
2. bond modulus to Young's modulus: by `network_stiffness`, then by compression in LIGGGHTS;
3. shear over tensile strength of the bonds to UCS over tensile strength, the best of SHEAR_RATIOS;
4. both strengths together to the tensile strength of the Brazilian test. Load at failure is nearly proportional to
   strength, as bonds are elastic until they break, so this converges in a step or two.

What is reached is then measured on packings that took no part in the fit. docs/calibration.md has the results.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from pydantic import Field
from scipy.optimize import brentq

from common.files import write_text, written_whole
from common.resources import resource
from common.scene import Positive, Scene, contact_key, read_scene, scene_hash
from common.tables import InputError, Table, check, read_toml
from dem.calibration.virtual_tests import (
    Rock,
    Specimen,
    brazilian_specimen,
    compression_specimen,
    elastic_test,
    strength_test,
)
from dem.coupling.launch import LIGGGHTS_VERSION, check_engine
from dem.run.errors import RunError
from dem.stones.bonds import bond_network, network_stiffness
from dem.stones.packing import pack_sphere

TARGETS = resource("scenes/materials/targets.toml")
MAX_STIFFNESS_RATIO = 4.0  # beyond, nu rises little, and time step and isotropy are lost (docs/packing.md)
SHEAR_RATIOS = (0.5, 1.0, 2.0, 4.0)
FIT_SEEDS = 5
CHECK_SEEDS = 5
DISC_RADIUS_RATIO = 1.5    # disc against stone: 14 sub-spheres across, as laboratories want ten grains at least
TENSILE_TOLERANCE = 0.01   # of the fit, on its own packings
STRENGTH_ROUNDS = 4
FITTED = ("bond_modulus_Pa", "stiffness_ratio", "tensile_strength_Pa", "shear_strength_Pa")


# Copied into the TOML file that is written: nothing that would end its string or its line.
Source = Annotated[str, Field(pattern=r'^[^"\\\x00-\x1f\x7f]*$', max_length=200)]


class TargetTable(Table):
    """The strengths of a rock, with their sources."""

    tensile_strength_Pa: Positive
    compressive_strength_Pa: Positive
    strength_source: Source
    friction_angle_deg: Annotated[float, Field(ge=0, lt=90)]
    friction_source: Source


@dataclass(frozen=True)
class Calibration:
    """The fitted bonds and what they reach; `tests` has one row a virtual test."""

    rock: Rock
    friction_angle_deg: float
    subsphere_radius_m: float
    stone_modulus_Pa: np.ndarray
    tests: pd.DataFrame


class _Laboratory:
    """Makes specimens by seed, and keeps a row for each test made with them."""

    def __init__(self, scene: Scene, work: Path, report: Callable[[str], None]):
        stones = scene.stones
        self.radius_m, self.count = stones.radius_m, scene.agglomerate.subspheres
        self._work, self._report = work, report
        self._specimens: dict[tuple[str, int], Specimen] = {}
        self.rows: list[dict[str, Any]] = []

    def specimen(self, kind: str, seed: int) -> Specimen:
        """Sub-spheres as large as in a stone: their number goes with the volume."""
        if (kind, seed) not in self._specimens:
            if kind == "compression":
                made = compression_specimen(self.radius_m, 3 * self.count, seed)
            else:
                made = brazilian_specimen(DISC_RADIUS_RATIO * self.radius_m,
                                          round(0.75 * DISC_RADIUS_RATIO**3 * self.count), seed)
            self._specimens[kind, seed] = made
        return self._specimens[kind, seed]

    def elastic(self, stage: str, rock: Rock, seeds: range) -> np.ndarray:
        """(seeds, 2) Young's modulus in Pa and Poisson's ratio."""
        found = []
        for seed in seeds:
            modulus, nu = elastic_test(self._work / "elastic", self.specimen("compression", seed), rock)
            found.append((modulus, nu))
            self._note(stage, "elastic", seed, rock, youngs_modulus_Pa=modulus, poisson_ratio=nu)
        return np.array(found)

    def strengths(self, stage: str, kind: str, rock: Rock, seeds: range) -> np.ndarray:
        """(seeds,) in Pa."""
        # Strain at failure, roughly: the stress under the platens is some times the bonds' tensile strength.
        strain = (1.5 if kind == "Brazilian" else 3.0) * min(rock.tensile_strength_Pa, rock.shear_strength_Pa)
        strain /= rock.bond_modulus_Pa
        found = []
        for seed in seeds:
            record = strength_test(self._work / kind, self.specimen(kind, seed), rock, strain)
            found.append(record.strength_Pa)
            self._note(stage, kind, seed, rock, strength_Pa=record.strength_Pa)
        return np.array(found)

    def _note(self, stage: str, kind: str, seed: int, rock: Rock, **found: float) -> None:
        bond = {f"bond_{key.removeprefix('bond_')}": getattr(rock, key) for key in FITTED}
        self.rows.append({"stage": stage, "test": kind, "seed": seed, **bond, **found})
        self._report(f"{stage}: {kind} test, seed {seed}: "
                     + ", ".join(f"{key} {value:.4g}" for key, value in found.items()))


def calibrate(material: str, scene_file: str | Path, out: Path, report: Callable[[str], None] = print) -> Calibration:
    """Fit the bonds of `material` in a scene; leaves `out`/MATERIAL.toml and `out`/MATERIAL_tests.csv.

    Raises InputError for bad input, RunError if LIGGGHTS fails or the tensile strength is not reached.
    """
    scene = read_scene(scene_file)
    if material not in scene.materials:
        raise InputError(f"MATERIAL = {material!r}: must be one of {sorted(scene.materials)}, the materials of "
                         f"{scene_file}")
    if scene.stones.agglomerate is None:
        raise InputError(f"{scene_file}: stones.agglomerate is missing: the size of sub-spheres follows from it")
    if contact_key(material, material) not in scene.contacts:
        raise InputError(f"{scene_file}: contacts.{contact_key(material, material)} is missing: restitution and "
                         "friction of broken pieces must be given")
    target = read_target(material)
    check_engine()
    out.mkdir(parents=True, exist_ok=True)
    work = out / f"{material}.partial"
    shutil.rmtree(work, ignore_errors=True)
    laboratory = _Laboratory(scene, work, report)
    try:
        found = _fit(scene, material, target, laboratory)
    except RuntimeError as error:
        raise RunError(str(error)) from error
    with written_whole(out / f"{material}_tests.csv") as beside:
        found.tests.to_csv(beside, index=False, float_format="%.9g")
    write_text(out / f"{material}.toml", calibration_toml(found, scene, material, target))
    shutil.rmtree(work)
    return found


def read_target(material: str, file: Path = TARGETS) -> TargetTable:
    """The strengths to be met. Raises InputError."""
    tables = read_toml(file)
    if material not in tables:
        raise InputError(f"{file}: {material} is missing: a table with the strengths of the rock must be given")
    return check(TargetTable, tables[material], file, where=material)


def _fit(scene: Scene, material: str, target: TargetTable, laboratory: _Laboratory) -> Calibration:
    first = scene.stones.seed
    fit, held_out = range(first, first + FIT_SEEDS), range(first + FIT_SEEDS, first + FIT_SEEDS + CHECK_SEEDS)
    rock = fit_stiffness(scene, material, target, laboratory, fit)
    rock = fit_shear_ratio(rock, target, laboratory, fit)
    rock = fit_tensile_strength(rock, target, laboratory, fit)
    laboratory.elastic("check", rock, held_out)
    for kind in ("Brazilian", "compression"):
        laboratory.strengths("check", kind, rock, held_out)
    stones = [pack_sphere(scene.stones.radius_m, scene.agglomerate.subspheres, seed) for seed in fit]
    stiffness = [network_stiffness(stone, bond_network(stone), rock.bond_modulus_Pa, rock.stiffness_ratio)
                 for stone in stones]
    radius = float(np.mean([stone.radius_m.mean() for stone in stones]))
    return Calibration(rock, target.friction_angle_deg, radius,
                       np.array([s.youngs_modulus_Pa.mean() for s in stiffness]), pd.DataFrame(laboratory.rows))


def fit_stiffness(scene: Scene, material: str, target: TargetTable, laboratory: _Laboratory, seeds: range) -> Rock:
    """Bond modulus and stiffness ratio; strengths are a first guess."""
    table = scene.materials[material]
    contact = scene.contacts[contact_key(material, material)]
    rock = Rock(table.density_kg_m3, table.youngs_modulus_Pa, table.poisson_ratio, contact.restitution,
                contact.friction, table.youngs_modulus_Pa, 1.0, 1.6 * target.tensile_strength_Pa,
                1.6 * target.tensile_strength_Pa, float(np.tan(np.radians(target.friction_angle_deg))),
                scene.agglomerate.damping_ratio)
    specimen = laboratory.specimen("compression", seeds[0])

    def network(ratio: float) -> tuple[float, float]:
        found = network_stiffness(specimen.packing, specimen.bonds, rock.bond_modulus_Pa, ratio)
        return found.youngs_modulus_Pa[0], found.poisson_ratio[0]

    ratio = MAX_STIFFNESS_RATIO
    if network(1.0)[1] < table.poisson_ratio < network(ratio)[1]:
        ratio = brentq(lambda r: network(r)[1] - table.poisson_ratio, 1.0, ratio, xtol=0.01)
    elif table.poisson_ratio <= network(1.0)[1]:
        ratio = 1.0
    rock = replace(rock, stiffness_ratio=_rounded(ratio),
                   bond_modulus_Pa=rock.bond_modulus_Pa * table.youngs_modulus_Pa / network(ratio)[0])
    reached = laboratory.elastic("modulus", rock, seeds)[:, 0].mean()
    return replace(rock, bond_modulus_Pa=_rounded(rock.bond_modulus_Pa * table.youngs_modulus_Pa / reached))


def fit_shear_ratio(rock: Rock, target: TargetTable, laboratory: _Laboratory, seeds: range) -> Rock:
    """The shear strength, of SHEAR_RATIOS times the tensile one, whose UCS over tensile strength is nearest."""
    wanted = target.compressive_strength_Pa / target.tensile_strength_Pa
    misses = []
    for ratio in SHEAR_RATIOS:
        trial = replace(rock, shear_strength_Pa=ratio * rock.tensile_strength_Pa)
        brazilian = laboratory.strengths("shear ratio", "Brazilian", trial, seeds).mean()
        compression = laboratory.strengths("shear ratio", "compression", trial, seeds).mean()
        misses.append(abs(np.log(compression / brazilian / wanted)))
    return replace(rock, shear_strength_Pa=SHEAR_RATIOS[int(np.argmin(misses))] * rock.tensile_strength_Pa)


def fit_tensile_strength(rock: Rock, target: TargetTable, laboratory: _Laboratory, seeds: range) -> Rock:
    """Both strengths by one factor, until the Brazilian test gives the tensile strength."""
    for _ in range(STRENGTH_ROUNDS):
        reached = laboratory.strengths("tensile strength", "Brazilian", rock, seeds).mean()
        factor = target.tensile_strength_Pa / reached
        if abs(factor - 1) < TENSILE_TOLERANCE:
            return rock
        ratio = rock.shear_strength_Pa / rock.tensile_strength_Pa
        tensile = _rounded(factor * rock.tensile_strength_Pa)
        rock = replace(rock, tensile_strength_Pa=tensile, shear_strength_Pa=ratio * tensile)
    raise RuntimeError(f"after {STRENGTH_ROUNDS} rounds the tensile strength reached is {reached:.4g} Pa, not "
                       f"{target.tensile_strength_Pa:.4g} Pa")


def _rounded(value: float) -> float:
    """Four digits: more than a fit means."""
    return float(f"{value:.4g}")


def calibration_toml(found: Calibration, scene: Scene, material: str, target: TargetTable) -> str:
    """The file of a calibrated material; `[bond]` is what a scene's materials.MATERIAL.bond takes."""
    rock, tests = found.rock, found.tests
    fit, held_out = (sorted(set(tests.seed[tests.stage == stage])) for stage in ("modulus", "check"))
    head = f"""# Bonds of {material}, written by `python -m dem calibrate {material}`; docs/calibration.md says how.

[bond]
youngs_modulus_Pa = {rock.bond_modulus_Pa:g}
stiffness_ratio = {rock.stiffness_ratio:g}
tensile_strength_Pa = {rock.tensile_strength_Pa:g}
shear_strength_Pa = {rock.shear_strength_Pa:g}
friction_angle_deg = {found.friction_angle_deg:g}  # {target.friction_source}, not fitted

[provenance]
scene = "{scene.name}"
scene_hash = "{scene_hash(scene)}"
liggghts = "{LIGGGHTS_VERSION}"
stone_radius_m = {scene.stones.radius_m:g}
subspheres = {scene.agglomerate.subspheres}
subsphere_radius_m = {found.subsphere_radius_m:.5g}  # mean; the strengths belong to this size (dem/stones/strength.py)
damping_ratio = {rock.damping_ratio:g}
fit_seeds = {fit}
check_seeds = {held_out}

# Mean and standard deviation over the packings of check_seeds, which took no part in the fit. The stone's modulus is
# that of the scene's stones themselves (network_stiffness, packings of fit_seeds).
"""
    return head + "".join(_reached(*row) for row in _comparison(found, scene, material, target))


def _comparison(found: Calibration, scene: Scene, material: str,
                target: TargetTable) -> list[tuple[str, float, str, pd.Series]]:
    """Name, target, its source, and the values found in the checks."""
    table, checks = scene.materials[material], found.tests[found.tests.stage == "check"]
    scene_source, rock_source = f"scene {scene.name}", target.strength_source
    strength = {kind: checks.strength_Pa[checks.test == kind] for kind in ("Brazilian", "compression")}
    return [
        ("youngs_modulus_Pa", table.youngs_modulus_Pa, scene_source, checks.youngs_modulus_Pa.dropna()),
        ("poisson_ratio", table.poisson_ratio, scene_source, checks.poisson_ratio.dropna()),
        ("tensile_strength_Pa", target.tensile_strength_Pa, rock_source, strength["Brazilian"]),
        ("compressive_strength_Pa", target.compressive_strength_Pa, rock_source, strength["compression"]),
        ("stone_youngs_modulus_Pa", table.youngs_modulus_Pa, scene_source, pd.Series(found.stone_modulus_Pa)),
    ]


def _reached(name: str, wanted: float, source: str, values: pd.Series) -> str:
    return f"""
[reached.{name}]
target = {wanted:g}
source = "{source}"
mean = {values.mean():.4g}
deviation = {values.std():.2g}
error = {values.mean() / wanted - 1:.4f}
"""
