"""What a stone is made of: a material of the scene, and what its stones have of their own.

A substance is a type of particle in the engine. Density and strength are not among its properties: sub-spheres have a
mass each, and bonds a factor each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.scene.scene import BondTable, ContactTable, MaterialTable, Scene

LEAST_RESTITUTION = 0.051  # LIGGGHTS refuses 0.05 and less


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
