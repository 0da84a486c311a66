"""Fit the bonds of a material to a rock: `gangue calibrate MATERIAL --scene SCENE --out DIR [--rock ROCK]`.

Specimens of the virtual tests have the sub-spheres of the scene's stones, by size. In this order:

1. volumetric ratio to Poisson's ratio at a stiffness ratio of MAX_STIFFNESS_RATIO, or a smaller stiffness ratio where
   that is already too much, by `network_stiffness`;
2. bond modulus to Young's modulus, by the same;
3. tensile strength of the bonds to that of the Brazilian test;
4. their shear strength to the uniaxial compressive strength (UCS).

The fracture energy of the bonds is not fitted: it follows from the rock's fracture toughness (`fracture_energy`).

Load at failure is nearly proportional to strength, as bonds are elastic until they break, so 3 and 4 converge in a few
rounds. What the tensile strength gains with pressure (STRENGTHENING) is the same for all rocks. What is reached is then
measured on packings that took no part in the fit, and beside it what was not fitted: direct tension, and compression
under a confining pressure. docs/calibration.md has the results.
"""

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from pydantic import Field
from scipy.optimize import brentq

from common.files.output_directory import stamped
from common.files.whole import write_text
from common.scene.plate import Modulus
from common.scene.scene import MaterialTable, Scene, contact_key, scene_hash
from common.tables import InputError, Positive, Table, check, refused_in
from dem.calibration.lab_sheet import find_sheet, scene_with
from dem.calibration.virtual_tests import (
    Rock,
    Specimen,
    brazilian_specimen,
    compression_specimen,
    strength_test,
    tension_specimen,
)
from dem.coupling.launch import check_engine, library_version
from dem.run.prepare import warned
from dem.run.run import RunError
from dem.stones.bonds import CRACK_AREA, bond_network, network_stiffness
from dem.stones.packing import pack_sphere

MAX_STIFFNESS_RATIO = 4.0  # beyond, nu rises little, and time step and isotropy are lost (docs/calibration.md)
MAX_VOLUMETRIC_RATIO = 0.6
# What the tensile strength gains per pressure. More would keep a disc from splitting in the middle, where the mean
# pressure is two thirds of the tension (docs/calibration.md).
STRENGTHENING = 2.0
FIT_SEEDS = 12             # of the Brazilian test and the elastic constants; half of them do for the other strengths
CHECK_SEEDS = 12           # likewise, and a quarter of them for confined compression
CONFINING_Pa = (2e6, 5e6)  # of the checks
DISC_RADIUS_RATIO = 1.5    # disc against stone: 14 sub-spheres across, as laboratories want ten grains at least
FIRST_GUESS = 1.25         # of the bonds' tensile strength over the rock's
STEP = 0.12                # of a strength: so near the law of proportion holds
STRENGTH_ROUNDS = 6
MISSED = 0.1               # share of a target by which the checks miss it: too few sub-spheres scatter too much
FIRST_PACKINGS = 4
POWERS = (0.3, 1.2)
# Files in ROCK.partial, in a directory for each kind of test.
AT_WORK = re.compile(r"(Brazilian|compression|tension)/(deck\.liggghts|atoms\.data|events\.csv|view\.dump"
                     r"|(bonds|agglomerates|load)\.txt|engine\.(out|log)|log\.liggghts)")
FITTED = ("bond_modulus_Pa", "stiffness_ratio", "volumetric_ratio", "tensile_strength_Pa", "shear_strength_Pa")


# Copied into the TOML file that is written: nothing that would end its string or its line.
Source = Annotated[str, Field(pattern=r'^[^"\\\x00-\x1f\x7f]*$', max_length=200)]


class TargetTable(Table):
    """The strengths of a rock, with their sources, and its elastic constants where they are not the scene's."""

    density_kg_m3: Positive | None = None
    youngs_modulus_Pa: Modulus | None = None
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5)] | None = None
    elastic_source: Source = "laboratory sheet, or else as in the scene"  # of the density, too
    tensile_strength_Pa: Positive
    compressive_strength_Pa: Positive
    strength_source: Source = "laboratory sheet"
    friction_angle_deg: Annotated[float, Field(ge=0, lt=90)] = 35.0
    friction_source: Source = "assumed"
    fracture_toughness_Pa_m05: Positive | None = None
    crack_energy_J_m2: Positive | None = None  # of a crack's area, in place of the toughness; without both bonds snap
    toughness_source: Source = ""
    flaw_modulus: Positive | None = None  # of strengths from place to place, with the length of their correlation
    flaw_length_m: Positive | None = None
    flaw_source: Source = ""

    def elastic(self, table: MaterialTable) -> tuple[float, float]:
        """Young's modulus in Pa and Poisson's ratio to be met."""
        modulus, nu = self.youngs_modulus_Pa, self.poisson_ratio
        return (table.youngs_modulus_Pa if modulus is None else modulus, table.poisson_ratio if nu is None else nu)


def fracture_energy(target: TargetTable, modulus_Pa: float, nu: float) -> float | None:
    """Of the bonds, in J/m^2 of their section: that of a crack's area, Irwin's K^2 (1 - nu^2)/E where the toughness is
    given, over what it breaks."""
    toughness, crack = target.fracture_toughness_Pa_m05, target.crack_energy_J_m2
    if toughness is not None:
        crack = toughness**2 * (1 - nu**2) / modulus_Pa
    return None if crack is None else _rounded(crack / CRACK_AREA)


@dataclass(frozen=True)
class Calibration:
    """The fitted bonds and what they reach; `tests` has one row a virtual test."""

    rock: Rock
    subsphere_radius_m: float
    stone_modulus_Pa: np.ndarray
    tests: pd.DataFrame


class _Laboratory:
    """Makes specimens by seed, and keeps a row for each test made with them."""

    def __init__(self, scene: Scene, target: TargetTable, work: Path, report: Callable[[str], None]):
        stones = scene.stones
        self.radius_m, self.count = stones.volley[1], scene.agglomerate.subspheres
        self._work, self._report = work, report
        self._target = target
        self._specimens: dict[tuple[str, int], Specimen] = {}
        self.rows: list[dict[str, Any]] = []

    def specimen(self, kind: str, seed: int) -> Specimen:
        """Sub-spheres as large as in a stone: their number goes with the volume."""
        if (kind, seed) not in self._specimens:
            if kind == "compression":
                made = compression_specimen(self.radius_m, 3 * self.count, seed)
            elif kind == "tension":
                made = tension_specimen(self.specimen("compression", seed))
            else:
                made = brazilian_specimen(DISC_RADIUS_RATIO * self.radius_m,
                                          round(0.75 * DISC_RADIUS_RATIO**3 * self.count), seed)
            self._specimens[kind, seed] = made
        return self._specimens[kind, seed]

    def elastic(self, stage: str, rock: Rock, seeds: range) -> np.ndarray:
        """(seeds, 2) Young's modulus in Pa and Poisson's ratio under compression, at rest: `elastic_test` in the engine
        agrees within 2e-5."""
        found = []
        for seed in seeds:
            specimen = self.specimen("compression", seed)
            at_rest = network_stiffness(specimen.packing, specimen.bonds, rock.bond_modulus_Pa, rock.stiffness_ratio,
                                        rock.volumetric_ratio)
            modulus, nu = float(at_rest.youngs_modulus_Pa[0]), float(at_rest.poisson_ratio[0])
            found.append((modulus, nu))
            self._note(stage, "elastic", seed, rock, youngs_modulus_Pa=modulus, poisson_ratio=nu)
        return np.array(found)

    def strengths(self, stage: str, kind: str, rock: Rock, seeds: range, confining_Pa: float = 0.0) -> np.ndarray:
        """(seeds,) in Pa."""
        # Stress of the platens at failure, roughly: it sets their speed.
        stress = 3 * self._target.tensile_strength_Pa
        if kind == "compression":
            stress = 1.2 * self._target.compressive_strength_Pa + 4 * confining_Pa
        elif kind == "tension":
            stress = self._target.tensile_strength_Pa
        found = []
        for seed in seeds:
            record = strength_test(self._work / kind, self.specimen(kind, seed), rock, stress / rock.bond_modulus_Pa,
                                   confining_Pa)
            found.append(record.strength_Pa)
            self._note(stage, kind, seed, rock, strength_Pa=record.strength_Pa, confining_Pa=confining_Pa)
        return np.array(found)

    def _note(self, stage: str, kind: str, seed: int, rock: Rock, **found: float) -> None:
        bond = {f"bond_{key.removeprefix('bond_')}": getattr(rock, key) for key in FITTED}
        self.rows.append({"stage": stage, "test": kind, "seed": seed, **bond, **found})
        self._report(f"{stage}: {kind} test, seed {seed}: "
                     + ", ".join(f"{key} {value:.4g}" for key, value in found.items()))


def calibrate(material: str, scene_file: str | Path, out: Path, report: Callable[[str], None] = print,
              rock: str | None = None, targets: Path | None = None) -> Calibration:
    """Fit the bonds of `material` in a scene to what `dem.calibration.lab_sheet` finds of it; leaves `out`/ROCK.toml
    and `out`/ROCK_tests.csv, where ROCK is `rock` or the name of the material's file in the scene.

    Raises InputError for bad input, RunError if LIGGGHTS fails or a strength is not reached.

    >>> found = calibrate("gangue", "scenes/small.toml", Path("runs/materials"), report=lambda line: None)
    >>> found.rock.bond_modulus_Pa > 9.966e9  # bonds are stiffer than the rock
    True
    """
    sheet = find_sheet(material, scene_file, rock, targets)
    target: TargetTable = check(TargetTable, sheet.table, sheet.file, where=sheet.where)
    scene, rock = scene_with(material, scene_file, sheet.table), sheet.rock
    if scene.stones.agglomerate is None:
        raise InputError(f"{scene_file}: stones.agglomerate is missing: the size of sub-spheres follows from it")
    with refused_in(scene_file, "stones"):
        _ = scene.stones.volley  # the size of specimens follows from that of the stones
    if scene.contact_of(material, material) is None:
        raise InputError(f"{scene_file}: contacts.{contact_key(material, material)} is missing: restitution and "
                         "friction of broken pieces must be given")
    if "friction_angle_deg" not in target.model_fields_set:
        report(f"note: {sheet.file}: friction_angle_deg is not given: {target.friction_angle_deg:g} is assumed")
    check_engine()
    out.mkdir(parents=True, exist_ok=True)
    work = out / f"{rock}.partial"
    shutil.rmtree(work, ignore_errors=True)
    laboratory = _Laboratory(scene, target, work, report)
    try:
        found = _fit(scene, material, target, laboratory)
    except RuntimeError as error:
        raise RunError(str(error)) from error
    fitted = _comparison(found, scene, material, target)[:4]
    warned(str(sheet.file), [
        f"{key} = {wanted:g}: packings that took no part in the fit reach {values.mean():.4g}; must be within "
        f"{MISSED:.0%}, by more stones.agglomerate.subspheres than {scene.agglomerate.subspheres}"
        for key, wanted, _, values in fitted if abs(values.mean() - wanted) > MISSED * wanted])
    tests = found.tests.to_csv(index=False, float_format="%.9g")
    write_text(out / f"{rock}_tests.csv", stamped(tests, "# {}"))
    write_text(out / f"{rock}.toml", stamped(calibration_toml(found, scene, material, rock, target), "# {}"))
    shutil.rmtree(work)
    return found


def _fit(scene: Scene, material: str, target: TargetTable, laboratory: _Laboratory) -> Calibration:
    first = scene.stones.seed
    fit, held_out = range(first, first + FIT_SEEDS), range(first + FIT_SEEDS, first + FIT_SEEDS + CHECK_SEEDS)
    rock = fit_stiffness(scene, material, target, laboratory, fit)
    rock = fit_strengths(rock, target, laboratory, fit)
    few = held_out[:CHECK_SEEDS // 2]
    laboratory.elastic("check", rock, held_out)
    for kind, seeds in (("Brazilian", held_out), ("compression", few), ("tension", few)):
        laboratory.strengths("check", kind, rock, seeds)
    for confining_Pa in CONFINING_Pa:
        laboratory.strengths("check", "compression", rock, held_out[:CHECK_SEEDS // 4], confining_Pa)
    stones = [pack_sphere(scene.stones.volley[1], scene.agglomerate.subspheres, seed) for seed in fit]
    stiffness = [network_stiffness(stone, bond_network(stone), rock.bond_modulus_Pa, rock.stiffness_ratio,
                                   rock.volumetric_ratio) for stone in stones]
    radius = float(np.mean([stone.radius_m.mean() for stone in stones]))
    return Calibration(rock, radius,
                       np.array([s.youngs_modulus_Pa.mean() for s in stiffness]), pd.DataFrame(laboratory.rows))


def fit_stiffness(scene: Scene, material: str, target: TargetTable, laboratory: _Laboratory, seeds: range) -> Rock:
    """Bond modulus, stiffness ratio and volumetric ratio; strengths are a first guess."""
    table = scene.materials[material]
    contact = scene.contact_of(material, material)
    assert contact is not None  # as `calibrate` has seen
    modulus_Pa, nu = target.elastic(table)
    rock = Rock(table.density_kg_m3, modulus_Pa, nu, contact.restitution, contact.friction, modulus_Pa, 1.0,
                FIRST_GUESS * target.tensile_strength_Pa, 0.36 * target.compressive_strength_Pa,
                float(np.tan(np.radians(target.friction_angle_deg))), scene.agglomerate.damping_ratio,
                pressure_strengthening=STRENGTHENING, fracture_energy_J_m2=fracture_energy(target, modulus_Pa, nu),
                flaw_modulus=target.flaw_modulus, flaw_length_m=target.flaw_length_m)
    specimen = laboratory.specimen("compression", seeds[0])

    def network(ratio: float, volumetric: float) -> tuple[float, float]:
        found = network_stiffness(specimen.packing, specimen.bonds, rock.bond_modulus_Pa, ratio, volumetric)
        return found.youngs_modulus_Pa[0], found.poisson_ratio[0]

    # Of one packing first, then by the mean of several.
    ratio, volumetric = MAX_STIFFNESS_RATIO, 0.0
    if nu < network(ratio, 0.0)[1]:
        ratio = brentq(lambda r: network(r, 0.0)[1] - nu, 1.0, ratio, xtol=0.01) if network(1.0, 0.0)[1] < nu else 1.0
    elif nu > network(ratio, MAX_VOLUMETRIC_RATIO)[1]:
        volumetric = MAX_VOLUMETRIC_RATIO
    else:
        volumetric = brentq(lambda v: network(ratio, v)[1] - nu, 0.0, MAX_VOLUMETRIC_RATIO, xtol=3e-3)
    ratio, volumetric = _rounded(ratio), _rounded(volumetric)
    rock = replace(rock, stiffness_ratio=ratio, volumetric_ratio=volumetric,
                   bond_modulus_Pa=rock.bond_modulus_Pa * modulus_Pa / network(ratio, volumetric)[0])
    reached = laboratory.elastic("modulus", rock, seeds)[:, 0].mean()
    return replace(rock, bond_modulus_Pa=_rounded(rock.bond_modulus_Pa * modulus_Pa / reached))


def fit_strengths(rock: Rock, target: TargetTable, laboratory: _Laboratory, seeds: range) -> Rock:
    """The tensile strength of the bonds by the Brazilian test, which is deaf to their shear strength, and then that one
    by compression. A last step below STEP is not tested again.

    Load goes with a power of the strength: 1 at first, and then that of the last two rounds on the same packings, which
    is less where the bonds' fracture energy carries part of it. The first packings find the way; near, all count.
    """
    for kind, key, wanted, packings in (
            ("Brazilian", "tensile_strength_Pa", target.tensile_strength_Pa, seeds),
            ("compression", "shear_strength_Pa", target.compressive_strength_Pa, seeds[:FIT_SEEDS // 2])):
        power, rounds, tried = 1.0, list[tuple[float, float]](), packings[:FIRST_PACKINGS]
        for _ in range(STRENGTH_ROUNDS):
            reached = float(laboratory.strengths("strength", kind, rock, tried).mean())
            rounds.append((getattr(rock, key), reached))
            if len(rounds) > 1:
                (bond, rock_Pa), (now, now_Pa) = rounds[-2:]
                power = float(np.clip(np.log(now_Pa / rock_Pa) / np.log(now / bond), *POWERS))
            rock = replace(rock, **{key: _rounded(rounds[-1][0] * (wanted / reached) ** (1 / power))})
            if abs(wanted / reached - 1) < STEP:
                if tried == packings:
                    break
                tried, rounds = packings, []
        else:
            raise RuntimeError(f"after {STRENGTH_ROUNDS} rounds the {kind} strength reached is {reached:.4g} Pa, not "
                               f"{wanted:.4g} Pa")
    return rock


def _rounded(value: float) -> float:
    """Four digits: more than a fit means."""
    return float(f"{value:.4g}")


def calibration_toml(found: Calibration, scene: Scene, material: str, name: str, target: TargetTable) -> str:
    """The file of a calibrated rock; `materials.MATERIAL = "{name}"` takes it into a scene."""
    rock, tests, density_kg_m3 = found.rock, found.tests, scene.materials[material].density_kg_m3
    modulus_Pa, nu = target.elastic(scene.materials[material])
    fit, held_out = (sorted(set(tests.seed[tests.stage == stage])) for stage in ("strength", "check"))
    head = f"""# Bonds of {name}, written by `gangue calibrate {material} --rock {name}`: docs/calibration.md.

# {target.elastic_source}
kind = "{scene.kind_of(material)}"
density_kg_m3 = {density_kg_m3:g}
youngs_modulus_Pa = {modulus_Pa:g}
poisson_ratio = {nu:g}

[bond]  # assumption, fitted to [reached]
youngs_modulus_Pa = {rock.bond_modulus_Pa:g}  # to E
stiffness_ratio = {rock.stiffness_ratio:g}  # k_n/k_s; {MAX_STIFFNESS_RATIO:g} is the most that isotropy allows
tensile_strength_Pa = {rock.tensile_strength_Pa:g}  # to the Brazilian strength
shear_strength_Pa = {rock.shear_strength_Pa:g}  # to the uniaxial compressive strength
friction_angle_deg = {target.friction_angle_deg:g}  # {target.friction_source}, not fitted
volumetric_ratio = {rock.volumetric_ratio:g}  # to nu
pressure_strengthening = {rock.pressure_strengthening:g}  # of the tensile strength, docs/calibration.md
{_fracture_lines(rock, target)}
[provenance]
scene = "{scene.name}"
scene_hash = "{scene_hash(scene)}"
liggghts = "{library_version()}"
stone_radius_m = {scene.stones.volley[1]:g}
subspheres = {scene.agglomerate.subspheres}
subsphere_radius_m = {found.subsphere_radius_m:.5g}  # mean
damping_ratio = {rock.damping_ratio:g}
fit_seeds = {fit}
check_seeds = {held_out}

# Mean and standard deviation over the packings of check_seeds, which took no part in the fit. The stone's modulus is
# that of the scene's stones themselves (network_stiffness, packings of fit_seeds).
"""
    reached = (_reached(*row) for row in _comparison(found, scene, material, target))
    return head + "".join(reached) + _beside(tests, target)


def _fracture_lines(rock: Rock, target: TargetTable) -> str:
    sources = {"fracture_energy_J_m2": target.toughness_source, "flaw_modulus": target.flaw_source,
               "flaw_length_m": target.flaw_source}
    return "".join(f"{key} = {getattr(rock, key):g}  # {source}\n" for key, source in sources.items()
                   if getattr(rock, key) is not None)


def _comparison(found: Calibration, scene: Scene, material: str,
                target: TargetTable) -> list[tuple[str, float, str, pd.Series]]:
    """Name, target, its source, and the values found in the checks."""
    table, checks = scene.materials[material], found.tests[found.tests.stage == "check"]
    rock_source = target.strength_source
    modulus_Pa, nu = target.elastic(table)
    strength = {kind: checks.strength_Pa[(checks.test == kind) & (checks.confining_Pa == 0)]
                for kind in ("Brazilian", "compression")}
    return [
        ("youngs_modulus_Pa", modulus_Pa, target.elastic_source, checks.youngs_modulus_Pa.dropna()),
        ("poisson_ratio", nu, target.elastic_source, checks.poisson_ratio.dropna()),
        ("tensile_strength_Pa", target.tensile_strength_Pa, rock_source, strength["Brazilian"]),
        ("compressive_strength_Pa", target.compressive_strength_Pa, rock_source, strength["compression"]),
        ("stone_youngs_modulus_Pa", modulus_Pa, target.elastic_source, pd.Series(found.stone_modulus_Pa)),
    ]


def _beside(tests: pd.DataFrame, target: TargetTable) -> str:
    """What was not fitted: direct tension, and compression under confining pressure p beside Mohr-Coulomb's
    UCS + p (1 + sin phi)/(1 - sin phi)."""
    checks = tests[tests.stage == "check"]
    sine = np.sin(np.radians(target.friction_angle_deg))
    tables = [("direct_tension_Pa", checks.strength_Pa[checks.test == "tension"], "")]
    for confining_Pa in CONFINING_Pa:
        law = target.compressive_strength_Pa + confining_Pa * (1 + sine) / (1 - sine)
        tables.append((f"confined_{confining_Pa / 1e6:g}_MPa", checks.strength_Pa[checks.confining_Pa == confining_Pa],
                       f"mohr_coulomb = {law:.4g}\n"))
    return "".join(f"\n[beside.{name}]\n{law}mean = {values.mean():.4g}\ndeviation = {values.std():.2g}\n"
                   for name, values, law in tables)


def _reached(name: str, wanted: float, source: str, values: pd.Series) -> str:
    return f"""
[reached.{name}]
target = {wanted:g}
source = "{source}"
mean = {values.mean():.4g}
deviation = {values.std():.2g}
error = {values.mean() / wanted - 1:.4f}
"""
