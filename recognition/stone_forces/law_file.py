"""The law of the stones' forces as a file, and the one that comes with this package."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import numpy as np

from common.files.whole import read_sealed_json, seal, write_text
from common.tables import InputError
from recognition.estimation.errors import RecognitionError
from recognition.stone_forces.forces import StoneForces

FORMAT = "stone forces 5"
#: Of the rock of scenes/single.toml: the stones of the set "learnt" of lab/streams/stone_forces.py.
SHIPPED = Path(__file__).parent / "stone_forces.json"


def save_forces(forces: StoneForces, file: Path) -> None:
    """Write a JSON file, sealed by its hash."""
    values = {field.name: getattr(forces, field.name).tolist() for field in fields(StoneForces)}
    write_text(file, json.dumps(seal({"format": FORMAT, **values})) + "\n")


def load_forces(file: Path = SHIPPED) -> StoneForces:
    """Read what `save_forces` wrote. RecognitionError, one line, for anything else."""
    try:
        content = read_sealed_json(file)
    except InputError as error:
        raise RecognitionError(str(error)) from None
    names = {field.name for field in fields(StoneForces)}
    if content is None or content.get("format") != FORMAT or set(content) - {"sha256", "format"} != names:
        raise RecognitionError(f"{file}: no law of the stones' forces; `gangue learn-forces` writes one")
    return StoneForces(**{name: np.array(content[name], float) for name in names})
