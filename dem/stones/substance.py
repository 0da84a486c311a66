"""What a stone is made of: a material of the scene, and what its stones have of their own.

A substance is a type of particle in the engine. Density and strength are not among its properties: sub-spheres have a
mass each, and bonds a factor each.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
from scipy.special import gamma, log_ndtr

from common.scene.distribution import LEAST_RESTITUTION
from common.scene.scene import BondTable, ContactTable, MaterialTable, Scene

WAVES = 256  # of a field of flaws; with so many it is Gaussian within its statistical error


@dataclass(frozen=True, order=True)
class Substance:
    """A material of the scene with a factor on its Young's modulus. `restitution` on the plate; 0: that of the scene's
    contacts."""

    material: str
    youngs_modulus_factor: float = 1.0
    restitution: float = 0.0


def material_of(scene: Scene, substance: Substance) -> MaterialTable:
    """The material with the substance's Young's modulus."""
    table = scene.materials[substance.material]
    return table.model_copy(update={
        "youngs_modulus_Pa": table.youngs_modulus_Pa * substance.youngs_modulus_factor,
        "bond": None if table.bond is None else bond_of(scene, substance)})


def bond_of(scene: Scene, substance: Substance) -> BondTable:
    """The bonds of a substance."""
    bond = scene.bond_of(substance.material)
    return bond.model_copy(update={"youngs_modulus_Pa": bond.youngs_modulus_Pa * substance.youngs_modulus_factor})


def plate_contact(scene: Scene, substance: Substance) -> ContactTable:
    """The contact of a substance with the plate."""
    contact = scene.plate_contact(substance.material)
    return contact if substance.restitution == 0 else contact.model_copy(update={"restitution": substance.restitution})


def pair_contact(scene: Scene, first: Substance, second: Substance) -> ContactTable | None:
    """The contact of two substances: that of their materials, whose restitution changes by the geometric mean of what
    the restitutions of both on the plate have changed by. None where the scene gives none."""
    contact = scene.contact_of(first.material, second.material)
    if contact is None or first.restitution == second.restitution == 0:
        return contact
    gained = [plate_contact(scene, one).restitution / scene.plate_contact(one.material).restitution
              for one in (first, second)]
    restitution = float(np.clip(contact.restitution * np.sqrt(gained[0] * gained[1]), LEAST_RESTITUTION, 1.0))
    return contact.model_copy(update={"restitution": restitution})


def flaw_factors(modulus: float | None, length_m: float | None, seed: int, place_m: np.ndarray) -> np.ndarray:
    """Factors (m,) on the strengths of bonds at `place_m` (m, 3) from the centre of a stone that is not turned: a field
    of the seed alone, whatever the packing. They have a Weibull law of mean 1 and the correlation exp(-r^2/length^2);
    all are 1 without a modulus.

    The field is a sum of cosines of random waves, which is Gaussian with the correlation that their spectrum has, and
    each value takes the place in the Weibull law that it has in the normal one.
    """
    if modulus is None or length_m is None:
        return np.ones(len(place_m))
    rng = np.random.default_rng([seed, zlib.crc32(b"flaws")])
    wave, phase = rng.normal(0, np.sqrt(2) / length_m, (WAVES, 3)), rng.uniform(0, 2 * np.pi, WAVES)
    normal = np.sqrt(2 / WAVES) * np.cos(place_m @ wave.T + phase).sum(axis=1)
    return np.asarray((-log_ndtr(-normal)) ** (1 / modulus) / gamma(1 + 1 / modulus))
