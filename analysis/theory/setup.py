"""What the theory needs of a run's scene: places, materials, restitution, support of the plate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from analysis.signals.records import RecordError
from analysis.sweep.runs import Run
from analysis.theory.contact_states import Elastic, ring_positions_m
from common.run_summary import RecordedMaterial
from common.scene.stones import KINDS

Given = TypeVar("Given")


@dataclass(frozen=True)
class Setup:
    """Of one scene. places_m (count, 2); rocks and restitution by "coal" and "gangue".

    support_length_m, support_width_m: distances between the rods along x and y, the L and B
    of the paper's beam formula.
    """

    places_m: np.ndarray
    radius_m: float
    speed_m_s: float
    gangue_order: list[int]
    rocks: dict[str, Elastic]
    restitution: dict[str, float]
    plate: Elastic
    support_length_m: float
    support_width_m: float
    thickness_m: float


def setup_of(run: Run) -> Setup:
    """The setup of a run. RecordError, naming the key, where the scene does not hold it."""
    stones, plate = run.scene.stones, run.scene.plate
    rods = _given(run, "plate.rods", plate.rods or None)
    length_m, width_m = map(float, np.ptp([[rod.x_m, rod.y_m] for rod in rods], axis=0))
    if not length_m or not width_m:
        raise RecordError(f"{run.path}/run.json: scene.plate.rods stand on one line; needs a length and a width "
                          "between them for the theory")
    count = _given(run, "stones.count", stones.count)
    return Setup(
        places_m=places_of(run),
        radius_m=_given(run, "stones.radius_m", stones.radius_m),
        speed_m_s=_given(run, "stones.speed_m_s", stones.speed_m_s),
        gangue_order=stones.gangue_order or list(range(1, count + 1)),
        rocks={name: _elastic(run, f"materials.{name}", run.scene.materials.get(name)) for name in KINDS},
        restitution={name: _restitution(run, name) for name in KINDS},
        plate=_elastic(run, "plate", plate),
        support_length_m=length_m,
        support_width_m=width_m,
        thickness_m=_given(run, "plate.thickness_m", plate.thickness_m),
    )


def places_of(run: Run) -> np.ndarray:
    """Where the particles hit, shape (count, 2), by stones.parquet, or by the scene of a run without one. RecordError,
    naming the key, where neither says."""
    stones = run.scene.stones
    if run.stones is not None:
        return run.stones[["place_x_m", "place_y_m"]].to_numpy(dtype=float)
    if stones.positions_m:
        return np.array(stones.positions_m, dtype=float)
    return ring_positions_m(_given(run, "stones.count", stones.count),
                            _given(run, "stones.circle_radius_m", stones.circle_radius_m))


def _given(run: Run, key: str, value: Given | None) -> Given:
    if value is None:
        raise RecordError(f"{run.path}/run.json: scene.{key} is missing; needs it for the theory")
    return value


def _elastic(run: Run, key: str, table: RecordedMaterial | None) -> Elastic:
    found = _given(run, key, table)
    return Elastic(_given(run, f"{key}.density_kg_m3", found.density_kg_m3),
                   _given(run, f"{key}.youngs_modulus_Pa", found.youngs_modulus_Pa),
                   _given(run, f"{key}.poisson_ratio", found.poisson_ratio))


def _restitution(run: Run, name: str) -> float:
    contacts = run.scene.contacts
    found = contacts.get(f"{name}_plate") or contacts.get(f"plate_{name}")
    return _given(run, f"contacts.{name}_plate.restitution", found.restitution if found else None)
