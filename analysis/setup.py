"""What the theory needs of a run's scene: places, materials, restitution, support of the plate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.records import RecordError
from analysis.runs import Run
from analysis.theory import Elastic, ring_positions_m


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
    scene = run.info.get("scene", {})
    try:
        stones, plate = scene["stones"], scene["plate"]
        names = {kind: stones.get(kind, kind) for kind in ("coal", "gangue")}
        rods = plate["rods"]
        count = int(stones["count"])
        return Setup(
            places_m=_places(stones),
            radius_m=float(stones["radius_m"]),
            speed_m_s=float(stones["speed_m_s"]),
            gangue_order=list(stones.get("gangue_order") or range(1, count + 1)),
            rocks={kind: _elastic(scene["materials"][name]) for kind, name in names.items()},
            restitution={k: _restitution(scene["contacts"], name) for k, name in names.items()},
            plate=_elastic(plate),
            support_length_m=float(np.ptp([rod["x_m"] for rod in rods])),
            support_width_m=float(np.ptp([rod["y_m"] for rod in rods])),
            thickness_m=float(plate["thickness_m"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise RecordError(f"{run.path}/run.json: scene: no usable {error}; needs it for the theory") from None


def places_of(run: Run) -> np.ndarray:
    """Where the particles hit, shape (count, 2). RecordError, naming the key, where the scene does not say."""
    try:
        return _places(run.info["scene"]["stones"])
    except (KeyError, TypeError, ValueError) as error:
        raise RecordError(f"{run.path}/run.json: scene.stones: no usable {error}; needs the places") from None


def _places(stones: dict) -> np.ndarray:
    if stones.get("positions"):
        return np.array([[place["x_m"], place["y_m"]] for place in stones["positions"]], dtype=float)
    return ring_positions_m(int(stones["count"]), float(stones["circle_radius_m"]))


def _elastic(table: dict) -> Elastic:
    return Elastic(*(float(table[key]) for key in ("density_kg_m3", "youngs_modulus_Pa", "poisson_ratio")))


def _restitution(contacts: dict, name: str) -> float:
    found = contacts.get(f"{name}_plate") or contacts[f"plate_{name}"]
    return float(found["restitution"])
