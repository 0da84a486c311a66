"""Forces of single simulated stones on the plate (lab/streams/stone_forces.py), in sets that keep apart what is learnt,
tried and held out."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from common.scene.scene import read_scene
from recognition.stone_forces.forces import History

FILE = Path(__file__).with_name("data") / "stone_histories.npz"

#: learnt: by which the law was fitted; tried: of streams by which limits were set; other_rock: stones of the paper's
#: size whose bonds are a quarter weaker or stronger; held_out: of none before the last evaluation; one_fall: held out
#: too, of all sizes and one speed, as stones have that fall from one height; any_fall: held out too, sizes and speeds
#: evenly spread over all that there may be.
SETS = ("learnt", "tried", "other_rock", "held_out", "one_fall", "any_fall")


def histories(name: str) -> list[History]:
    """Those of one of SETS."""
    with np.load(FILE) as data:
        chosen = np.flatnonzero(data["set"] == name)
        return [History(data["force_N"][k].astype(float), float(data["step_s"][k]), bool(data["gangue"][k]),
                        float(data["radius_m"][k]), float(data["density_kg_m3"][k]), float(data["speed_m_s"][k]))
                for k in chosen]


def write_histories(found: Sequence[History], sets: Sequence[str], rock: str) -> None:
    """Write FILE; rock: `rock_of` the scene of the runs."""
    columns: dict[str, Any] = {name: np.array([getattr(h, name) for h in found])
                               for name in ("step_s", "gangue", "radius_m", "density_kg_m3", "speed_m_s")}
    force = np.array([h.force_N for h in found]).astype(np.float32)
    np.savez_compressed(FILE, force_N=force, set=np.array(sets), rock=np.array(rock), **columns)


NO_FORCE: Mapping[str, Any] = {"kind": True, "bond": {"flaw_modulus", "flaw_length_m"}}  # of a material without flaws


def rock_of(scene: str | Path) -> str:
    """Hash of a scene's materials, contacts and bonds: of all that a stone's force depends on but size and speed."""
    read = read_scene(scene)
    materials = [read.materials["coal"], read.materials["gangue"]]
    flaws = any(material.bond is not None and material.bond.flaw_modulus for material in materials)
    parts = [*materials, read.contacts["coal_plate"], read.contacts["gangue_plate"], read.stones.agglomerate]
    text = "".join(part.model_dump_json(exclude=None if flaws else NO_FORCE) for part in parts if part is not None)
    # Kept records name their rock with a threshold of pressure, which is 0.
    text = re.sub(r'"pressure_strengthening":[^,]+,', r'\g<0>"pressure_threshold_Pa":0.0,', text)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def stored_rock() -> str:
    """`rock_of` the scene that FILE was made with."""
    with np.load(FILE) as data:
        return str(data["rock"])
