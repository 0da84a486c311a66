"""Where the energy of the impact went.

The stones' side comes from the engine (fix ledger), the plate's side from the modal motion. Works are sums of force
times displacement over every step; each dissipation is what a work took and did not store:

    bond damping       = - work of bonds - elastic energy of bonds - released by breakage
    stone contacts     = - work of contacts between sub-spheres (their elastic part, damping and friction)
    plate contact      = - (work on stones + work on plate) - elastic energy of the contacts with the plate

Nothing in these sums refers to the kinetic energies or to the plate's own energy, so the sum of all can miss the energy
at the start, and `closure` says by how much.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

COLUMNS = ["kinetic_J", "momentum_z_kg_m_s", "mass_height_kg_m", "bond_elastic_J", "bond_work_J", "released_J",
           "broken", "pair_work_J", "wall_work_J", "plate_work_J", "wall_elastic_J"]


@dataclass(frozen=True)
class StoneLedger:
    """`step` (k,) and each column of COLUMNS as (k, agglomerates)."""

    step: np.ndarray
    column: dict[str, np.ndarray]


def read_ledger(file: Path, n_agglomerates: int) -> StoneLedger:
    """Read the engine's ledger."""
    record = np.dtype([("step", "<i8"), ("row", "<f8", (n_agglomerates, len(COLUMNS)))])
    data = np.fromfile(file, dtype=record)
    return StoneLedger(data["step"], {name: data["row"][:, :, k] for k, name in enumerate(COLUMNS)})


@dataclass(frozen=True)
class PlateEnergy:
    """Energies of the plate at the end, J; all zero for a rigid plate."""

    kinetic_J: float = 0.0
    internal_J: float = 0.0
    damped_J: float = 0.0
    work_J: float = 0.0


def energy_ledger(stones: StoneLedger, plate: PlateEnergy, gravity_m_s2: float, kinetic_start_J: float,
                  mass_height_start_kg_m: float) -> dict[str, float]:
    """Ledger at the end of the run, J, with `closure` relative to the energy of the impact.

    Summed over agglomerates; `kinetic_start_J` and `mass_height_start_kg_m` are those of the initial state.
    """
    end = {name: float(values[-1].sum()) for name, values in stones.column.items()}
    fall = gravity_m_s2 * (mass_height_start_kg_m - end["mass_height_kg_m"])
    supplied = kinetic_start_J + fall
    parts = {
        "stones_kinetic_J": end["kinetic_J"],
        "bond_elastic_J": end["bond_elastic_J"],
        "plate_contact_elastic_J": end["wall_elastic_J"],
        "plate_kinetic_J": plate.kinetic_J,
        "plate_internal_J": plate.internal_J,
        "plate_damping_J": plate.damped_J,
        "bond_damping_J": -end["bond_work_J"] - end["bond_elastic_J"] - end["released_J"],
        "released_by_breakage_J": end["released_J"],
        "stone_contacts_J": -end["pair_work_J"],
        "plate_contact_dissipation_J": -end["wall_work_J"] - end["plate_work_J"] - end["wall_elastic_J"],
    }
    return {"impact_J": kinetic_start_J, "gained_by_falling_J": fall, **parts,
            "given_to_plate_J": end["plate_work_J"], "plate_work_J": plate.work_J,
            "closure": (sum(parts.values()) - supplied) / kinetic_start_J if kinetic_start_J else float("nan")}
