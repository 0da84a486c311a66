"""Streams that the engine simulates as a whole, where stones meet in the air, land on pieces and touch more than once, and
what `listen` makes of them on a tapped plate, with 20 dB of noise. The ratio is that of the stones that touched the plate.

Known stones are those of two more streams of the same kind, of coal alone and of gangue alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from common.scene.file import scene_tables
from common.scene.scene import Scene, changed_scene
from dem.run.run import run_scene
from lab.known_truth.simulated import SILENCE_S
from lab.rock.stone import SCENES
from lab.streams.known_streams import ALL, TRUE_Hz, learnt_by_taps
from lab.study import Row
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.innovations.prior import StonePrior
from recognition.innovations.signatures import Channels
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import load_forces
from recognition.stream.listen import Heard
from recognition.stream.recognise import QUIET_S, RATE_Hz, channels_of, hear, recognise_stream
from recognition.stream.stones import Known, ratio_of

SCENE = SCENES / "listening.toml"
RATIOS = (0.15, 0.25, 0.35, 0.45, 0.6, 0.75)  # by mass
NOISE_dB, KNOWN_UNTIL_s, FIRST_SEED = 20.0, 0.25, 400
SILENT, REACH = 10.0, 5.0  # points: an answer that reaches this far is one, and wrong if it is off by more
BY_STREAM = ("place_m", "arrival_s", "speed_factor", "radius_factor")  # what a stream draws itself
SCATTER = {key: value for key, value in scene_tables(SCENES / "natural.toml")["scatter"].items() if key not in BY_STREAM}
SHAPES = {name: scene_tables(SCENES / "caving.toml")["shapes"][name] for name in ("block", "slab")}


@dataclass(frozen=True)
class Kind:
    """How many streams of scenes/listening.toml, what is changed in it, and the limits that are told of its stones."""

    streams: int
    changes: dict[str, Any]
    radius_m: tuple[float, float]
    speed_m_s: tuple[float, float] = (2.0, 4.0)

    def made(self, ratio: float, seed: int, until_s: float | None = None) -> Scene:
        changes = {"stones.gangue_ratio": ratio, "stones.seed": seed} | self.changes
        if until_s is not None:
            changes |= {"stones.drawn.arrival_s": [0.05, until_s], "time.duration_s": until_s + 0.05}
        return changed_scene(SCENE, changes)


KINDS = {
    "clones": Kind(6, {}, (0.025, 0.025)),
    "natural": Kind(3, {"scatter": SCATTER, "stones.drawn.size_m": [0.042, 0.058]}, (0.021, 0.029)),
    "blocks": Kind(3, {"shapes": SHAPES, "stones.drawn.shapes": list(SHAPES), "stones.agglomerate.contact": "faces",
                       "stones.drawn.rate_1_s": 40.0}, (0.025, 0.025)),
}


def engine_streams(out: Path, kinds: tuple[str, ...] = tuple(KINDS)) -> Iterator[Row]:
    for kind in kinds:
        for number, ratio in enumerate(RATIOS[:KINDS[kind].streams]):
            for known in (False, True):
                yield Row({"kind": kind, "ratio": ratio, "known": known}, partial(heard, kind, ratio, number, known, out))


def simulated(kind: str, ratio: float, seed: int, out: Path, until_s: float | None = None) -> Path:
    directory = out / "engine_streams" / f"{kind}_{seed}"
    if not (directory / "run.json").is_file():
        run_scene(KINDS[kind].made(ratio, seed, until_s), SCENE.name, directory)
    return directory


def record_of(directory: Path, out: Path) -> tuple[Channels, Floats]:
    """What the sensors of a run see, with noise."""
    _, values = channels_of(pd.read_parquet(directory / "fast.parquet"), plate_of(out), str(directory))
    values = values[:len(ALL.accelerometers)]
    rms = np.sqrt(np.mean(values[:, round(SILENCE_S * RATE_Hz):] ** 2, axis=1, keepdims=True))
    rng = np.random.default_rng([41, int(directory.name.split("_")[1])])
    return ALL, values + 10 ** (-NOISE_dB / 20) * rms * rng.standard_normal(values.shape)


@cache
def plate_of(out: Path) -> PlateModel:
    return learnt_by_taps(PlateModel.from_scene(SCENE, TRUE_Hz), out / "engine_plate.json",
                          np.random.default_rng(42))


@cache
def known_of(kind: str, out: Path) -> tuple[tuple[list[Heard], int], ...]:
    found = []
    for gangue in (0, 1):
        channels, values = record_of(simulated(kind, float(gangue), FIRST_SEED - 1 - gangue, out, KNOWN_UNTIL_s), out)
        found.append((hear(plate_of(out), channels, prior_of(kind), values, QUIET_S).heard, gangue))
    return tuple(found)


def prior_of(kind: str) -> StonePrior:
    return StonePrior(load_forces(), KINDS[kind].radius_m, KINDS[kind].speed_m_s)


def heard(kind: str, ratio: float, number: int, known: bool, out: Path) -> dict[str, object]:
    directory = simulated(kind, ratio, FIRST_SEED + number, out)
    channels, values = record_of(directory, out)
    stones = pd.read_parquet(directory / "stones.parquet")
    touched = stones[stones["first_contact_s"].notna()]
    row: dict[str, object] = {"right": 100 * float((touched["kind"] == "gangue").mean()), "stones": len(touched)}
    try:
        found = recognise_stream(plate_of(out), channels, prior_of(kind), values,
                                 known=Known(dropped=known_of(kind, out) if known else ()))
    except RecognitionError as error:
        return row | {"refused": str(error)}
    low, said, high = (100 * v for v in ratio_of(found.stones))
    return row | {"refused": found.refused, "heard": len(found.stones), "low": low, "said": said, "high": high}


def engine_streams_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Errors in points, of the streams that have an answer; sure: whose interval reaches REACH at most."""
    found = []
    for (kind, known), of in rows.groupby(["kind", "known"], sort=False):
        answered = of[of["refused"].fillna("") == ""]
        off = (answered["said"] - answered["right"]).abs()
        inside = answered["right"].between(answered["low"] - 1e-9, answered["high"] + 1e-9)
        sure = np.maximum(answered["high"] - answered["said"], answered["said"] - answered["low"]) <= REACH
        found.append({"kind": kind, "known": known, "streams": len(of), "answered": len(answered),
                      "mean": off.mean(), "worst": off.max(), "inside": int(inside.sum()), "sure": int(sure.sum()), "silently_wrong": int((sure & (off > SILENT)).sum())})
    return pd.DataFrame(found)
