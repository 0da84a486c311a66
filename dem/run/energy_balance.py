"""Where the energy of the impact went, agglomerate by agglomerate.

The stones' side comes from the engine (fix ledger), the plate's side from the modal motion. Works are sums of force
times displacement over every step, elastic energies are those of the state, and friction, dashpots and yielding of the
contacts and the damping of the bonds are each summed on their own.

A tangential spring whose stiffness grows with the normal force gains energy by that, and loses it as the force goes:
`contact_springs_J` is what they lost on balance.

Nothing in these refers to the kinetic energies, to the plate's own energy or to the work of the contacts, so the sum of
all can miss the energy at the start; `closure` says by how much, relative to the energy supplied: the kinetic energy of
the impact and what gravity did until the stones were lowest. `bonds_unexplained_J` and `contacts_unexplained_J` are the
parts of it that a wrong law of either would have: what they took from stones and plate (their work) less all that is
known of it.
`given_to_stones_J` is what passed through contacts from one stone to others; over all stones it is zero.

A run ends with the limit that it broke. The engine's half is fix monitor (dem/engine/record/fix_monitor.h):
displacement in a step, numbers that are none, energy that bonds or contacts give from nothing; LIGGGHTS itself counts
the particles. This half watches the plate, whose energy the engine does not know, and the ledger of the whole run.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from common.files.parquet import Columns
from common.result import Result
from common.scene.scene import Scene
from dem.stones.assembly import Assembly

# As fix_ledger.cpp writes them.
COLUMNS = ["kinetic_J", "momentum_z_kg_m_s", "mass_height_kg_m", "bond_elastic_J", "bond_work_J", "released_J",
           "bond_damped_J", "broken", "pair_work_J", "wall_work_J", "plate_work_J", "wall_elastic_J", "wall_damped_J",
           "pair_elastic_J", "pair_damped_J", "wall_plastic_J", "wall_released_J", "friction_J", "springs_gained_J",
           "wall_deepest", "waited_steps"]
LEAST_SUPPLIED_J = 1e-300  # of a stone that has not entered: what no stone explains is shared among all, it too
UNEXPLAINED = ("bonds_unexplained_J", "contacts_unexplained_J")  # by the law of either, and so in no sum


@dataclass(frozen=True)
class StoneLedger:
    """`step` (k,) and each column of COLUMNS as (k, agglomerates), zero before a stone enters and as it was last when
    it has left; `is_near` (k, agglomerates)."""

    step: np.ndarray
    column: dict[str, np.ndarray]
    is_near: np.ndarray

    @property
    def has_entered(self) -> np.ndarray:
        """(k, agglomerates)"""
        return np.logical_or.accumulate(self.is_near, axis=0)


def read_ledger(file: Path, n_agglomerates: int) -> StoneLedger:
    record = np.dtype([("step", "<i8"), ("agglomerate", "<i8"), ("row", "<f8", (len(COLUMNS),))])
    data = np.fromfile(file, dtype=record)
    step, at = np.unique(data["step"], return_inverse=True)
    of_stone = data["agglomerate"] > 0  # without a stone near there is a row of none
    data, at = data[of_stone], at[of_stone]
    shape, here = (len(step), n_agglomerates), (at, data["agglomerate"] - 1)
    is_near = np.zeros(shape, dtype=bool)
    is_near[here] = True
    # Of each stone at each time the last row so far; 0 before the first.
    last = np.maximum.accumulate(np.where(is_near, np.arange(len(step))[:, None], -1), axis=0)
    column = {}
    for k, name in enumerate(COLUMNS):
        values = np.zeros(shape)
        values[here] = data["row"][:, k]
        if not is_near.all():
            values = np.where(last >= 0, np.take_along_axis(values, np.maximum(last, 0), axis=0), 0.0)
        column[name] = values
    return StoneLedger(step, column, is_near)


@dataclass(frozen=True)
class PlateEnergy(Result):
    """Energies of the plate at the end of a run, what its damping took, and what the stones did on it, J; all zero for
    a rigid plate."""

    line = "plate: kinetic {kinetic_J:.6g} J, internal {internal_J:.6g} J, damped {damped_J:.6g} J, work {work_J:.6g} J"
    kinetic_J: float = 0.0
    internal_J: float = 0.0
    damped_J: float = 0.0
    work_J: float = 0.0


def stone_energies(ledger: StoneLedger, gravity_m_s2: float,
                   mass_height_start_kg_m: np.ndarray) -> dict[str, np.ndarray]:
    """Energy parts by name, each (k, agglomerates) in J. `mass_height_start_kg_m` (agglomerates,) is the sum of m z at
    the start or at its entry, from where the potential energy counts."""
    c = ledger.column
    contact_elastic = c["wall_elastic_J"] + c["pair_elastic_J"]
    contact_damping = c["wall_damped_J"] + c["pair_damped_J"]
    parts = {
        "kinetic_J": c["kinetic_J"],
        "potential_J": gravity_m_s2 * (c["mass_height_kg_m"] - ledger.has_entered * mass_height_start_kg_m),
        "bond_elastic_J": c["bond_elastic_J"],
        "contact_elastic_J": contact_elastic,
        "bond_damping_J": c["bond_damped_J"],
        "contact_damping_J": contact_damping,
        "plastic_J": c["wall_plastic_J"],
        "friction_J": c["friction_J"],
        "contact_springs_J": -c["springs_gained_J"],
        "released_by_breakage_J": c["released_J"] + c["wall_released_J"],
        "given_to_plate_J": c["plate_work_J"],
    }
    took = -(c["pair_work_J"] + c["wall_work_J"] + c["plate_work_J"])
    known = sum(parts[name] for name in ("contact_elastic_J", "contact_damping_J", "plastic_J", "friction_J",
                                         "contact_springs_J")) + c["wall_released_J"]
    # What a contact between two stones keeps or takes counts half for each, yet its force does more work on one than on
    # the other: the difference passes between them. Only the sum over the stones can see a wrong law.
    unexplained = (took - known).mean(axis=1, keepdims=True)
    return parts | {
        "given_to_stones_J": took - known - unexplained,
        "bonds_unexplained_J": -c["bond_work_J"] - c["bond_elastic_J"] - c["released_J"] - c["bond_damped_J"],
        "contacts_unexplained_J": unexplained + np.zeros_like(took),
    }


def energy_table(parts: dict[str, np.ndarray], ledger: StoneLedger, dt_s: float) -> Columns:
    """What `stone_energies` gave as a table, one row a time and agglomerate (1-based) that was near then."""
    row, agglomerate = np.nonzero(ledger.is_near)
    index = {"t_s": (ledger.step * dt_s)[row], "agglomerate": agglomerate + 1}
    return index | {name: values[ledger.is_near] for name, values in parts.items()}


def energy_ledger(parts: dict[str, np.ndarray], plate: PlateEnergy, kinetic_start_J: np.ndarray) -> dict[str, Any]:
    """The ledger at the end of the run, J, with its closures: of all with the plate's own energies, and of each
    agglomerate with what it gave to the plate. `kinetic_start_J` (agglomerates,), 0 of one that did not enter."""
    end = {name: values[-1] for name, values in parts.items()}
    supplied = np.maximum(kinetic_start_J + np.maximum(0.0, -parts["potential_J"].min(axis=0)), LEAST_SUPPLIED_J)
    stones = sum(values for name, values in end.items() if name not in UNEXPLAINED) - kinetic_start_J
    plate_energy = plate.kinetic_J + plate.internal_J + plate.damped_J
    total = float(stones.sum()) - float(end["given_to_plate_J"].sum()) + plate_energy
    return {
        "impact_J": float(kinetic_start_J.sum()),
        "supplied_J": float(supplied.sum()),
        **{name: float(values.sum()) for name, values in end.items()},
        "plate_kinetic_J": plate.kinetic_J, "plate_internal_J": plate.internal_J, "plate_damping_J": plate.damped_J,
        "plate_work_J": plate.work_J,
        "closure": total / float(supplied.sum()),
        "by_agglomerate": [{name: float(values[k]) for name, values in end.items()}
                           | {"closure": float(stones[k] / supplied[k]) if supplied[k] > LEAST_SUPPLIED_J else 0.0}
                           for k in range(len(stones))],
    }


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
