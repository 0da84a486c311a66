"""Limits that every run keeps, or ends with the one that it broke.

The engine's half is fix monitor (dem/engine/record/fix_monitor.h): displacement in a step, numbers that are none,
energy that bonds or contacts give from nothing; LIGGGHTS itself counts the particles. This half watches the plate,
whose energy the engine does not know, and the ledger of the whole run.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from common.scene.scene import Scene
from dem.stones.assembly import Assembly

ENERGY_SHARE = 0.01  # of the energy supplied


class Unstable(RuntimeError):
    """A limit was broken; one line that names it."""


class PlateMonitor:
    """Refuses a plate that holds more energy than the stones could bring, at any row of the fast stream."""

    def __init__(self, scene: Scene, assembly: Assembly):
        radius = np.array([stone.radius_m for stone in assembly.stones])
        height = np.array([entry.offset_m[2] for entry in assembly.entries]) + 2 * radius  # until all of it lies flat
        fall = scene.time.gravity_m_s2 * assembly.stone_mass_kg * height
        self._limit_J = (1 + ENERGY_SHARE) * float((assembly.kinetic_start_J + fall).sum())

    def __call__(self, t_s: np.ndarray, total_J: np.ndarray) -> None:
        """Check the plate's energies `total_J` (k,) at the times `t_s` (k,). Raises Unstable."""
        broken = np.flatnonzero(~(total_J <= self._limit_J))  # so written that what is no number is refused
        if len(broken):
            at = broken[0]
            raise Unstable(f"at {t_s[at]:.4g} s the plate holds {total_J[at]:.3g} J, the limit of energy is what "
                           f"impact and fall supply, {self._limit_J:.3g} J: plate and contact are not stable with this "
                           "co-step")


def check_closure(energy: dict[str, Any]) -> None:
    """Raises Unstable if the ledger of a finished run, as `energy_ledger` gives it, misses more than 1 % of the energy
    supplied."""
    closure, supplied_J = energy["closure"], energy["supplied_J"]
    if abs(closure) <= ENERGY_SHARE:  # so written that what is no number is refused
        return
    bonds, contacts = (-energy[f"{part}_unexplained_J"] / supplied_J for part in ("bonds", "contacts"))
    raise Unstable(f"the energy ledger misses {closure:.2%} of the energy of impact and fall, the limit is "
                   f"{ENERGY_SHARE:.0%}: {bonds:.2%} in the bonds, {contacts:.2%} in the contacts, "
                   f"{closure - bonds - contacts:.2%} in the motion of stones and plate. If a run with half the time "
                   "step misses less, the step is too long; if not, a law is wrong there")
