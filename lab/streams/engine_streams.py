"""Streams that the engine simulates as a whole, where stones meet in the air, land on pieces and touch more than once, and
what `listen` makes of them, with 20 dB of noise. The ratio is that of the stones that touched the plate.

Known stones are of the sizes, shapes and speeds of each stream, and fall one by one: coal in a run of its own, and gangue.
Of streams with stones that the shipped law is not of, `learn-forces` makes one, by spheres of their sizes and speeds, and of
what varies from stone to stone.
"""

from __future__ import annotations

import fcntl
import json
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from common.scene.file import scene_tables
from common.scene.scene import Scene, changed_scene
from dem.batch.dataset import plan_dataset
from dem.run.run import run_scene
from gangue.learn_forces import learn_forces
from lab.known_truth.simulated import SILENCE_S
from lab.rock.stone import SCENES
from lab.streams.known_streams import ALL, HIGHEST_Hz, TRUE_Hz, learnt_by_taps
from lab.study import Row
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.innovations.prior import StonePrior
from recognition.innovations.signatures import Channels
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import load_forces
from recognition.stream.listen import Heard
from recognition.stream.recognise import QUIET_S, RATE_Hz, Recognised, channels_of, hear, recognise_stream
from recognition.stream.stones import UNKNOWN_ALL, Known, ratio_of

RATIOS = (0.15, 0.25, 0.35, 0.45, 0.6, 0.75)  # by mass
TAPS = 12  # small stones need more of them than four
TOLD = {"frequency_sd": 1e-3, "damping_sd": 0.1, "shape_sd": 0.03}
NOISE_dB, FIRST_SEED, KNOWN_STONES, KNOWN_1_s, PART = 20.0, 500, 15, 10.0, 4
SILENT, REACH = 10.0, 5.0  # points: an answer that reaches this far is one, and wrong if it is off by more
BY_STREAM = ("place_m", "arrival_s", "speed_factor", "radius_factor")  # what a stream draws itself
SCATTER = {key: value for key, value in scene_tables(SCENES / "natural.toml")["scatter"].items() if key not in BY_STREAM}
SHAPES = {name: scene_tables(SCENES / "caving.toml")["shapes"][name] for name in ("block", "slab")}


@dataclass(frozen=True)
class Kind:
    """Streams of a scene with what is changed in it, as many as `streams`, or the last of a family of
    scenes/streams.toml, one in PART; the limits that are told of their stones, and whether a law is learnt of them."""

    streams: int = 0
    changes: dict[str, Any] = field(default_factory=dict)
    radius_m: tuple[float, float] = (0.025, 0.025)
    speed_m_s: tuple[float, float] = (2.0, 4.0)
    scene: str = "listening.toml"
    family: str = ""
    known: bool = True
    own_law: bool = False


KINDS = {
    "clones": Kind(6),
    "natural": Kind(3, {"scatter": SCATTER, "stones.drawn.size_m": [0.042, 0.058]}, (0.021, 0.029), own_law=True),
    # A corner is sharper than a sphere of the stone's size, and a face is wider.
    "blocks": Kind(3, {"shapes": SHAPES, "stones.agglomerate.contact": "faces",
                       "stones.drawn.rate_1_s": 40.0}, (0.01, 0.06), (1.0, 6.0)),
    "caving": Kind(2, {"plate.max_frequency_Hz": HIGHEST_Hz, "stones.drawn.arrival_s": [SILENCE_S, 2.0]}, (0.03, 0.075),
                   (2.7, 3.9), "caving.toml", known=False),
    **{name: Kind(radius_m=radius_m, speed_m_s=(1.8, 4.0), scene="stream.toml", family=name, own_law=True)
       for name, radius_m in (("rates", (0.01, 0.03)), ("speeds", (0.01, 0.03)), ("sizes", (0.0125, 0.04)),
                              ("shapes", (0.01, 0.03)), ("whole", (0.01, 0.03)))},
}


def engine_streams(out: Path, kinds: tuple[str, ...] = tuple(KINDS)) -> Iterator[Row]:
    for kind in kinds:
        for number in range(len(scenes_of(kind))):
            for known in (False, True)[:1 + KINDS[kind].known]:
                yield Row({"kind": kind, "number": number, "known": known}, partial(heard, kind, number, known, out))


@cache
def scenes_of(kind: str) -> list[Scene]:
    of = KINDS[kind]
    if of.family:
        planned = [run.scene for run in plan_dataset(SCENES / "streams.toml") if run.directory.parts[0] == of.family]
        return planned[-len(planned) // PART:]
    return [changed_scene(SCENES / of.scene, {"stones.gangue_ratio": ratio, "stones.seed": FIRST_SEED + number} | of.changes)
            for number, ratio in enumerate(RATIOS[:of.streams])]


def known_scene(kind: str, number: int, gangue: int) -> Scene:
    """A stream with KNOWN_STONES of one material, which fall one by one."""
    scene = scenes_of(kind)[number]
    drawn = scene.stones.drawn
    assert drawn is not None
    until_s = SILENCE_S + KNOWN_STONES / KNOWN_1_s
    told = drawn.model_dump(exclude_none=True) | {"arrival_s": [SILENCE_S, until_s], "rate_1_s": KNOWN_1_s}
    stones = scene.stones.model_copy(update={"drawn": type(drawn).model_validate(told), "gangue_ratio": float(gangue),
                                             "seed": scene.stones.seed + 1 + gangue})
    return scene.model_copy(update={"stones": stones, "time": scene.time.model_copy(update={"duration_s": until_s + 0.05})})


@contextmanager
def alone(file: Path) -> Iterator[None]:
    """While no other process is: rows are made side by side, and share known streams and plates."""
    with open(file, "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def simulated(scene: Scene, name: str, out: Path) -> Path:
    directory = out / "engine_streams" / name
    directory.parent.mkdir(parents=True, exist_ok=True)
    with alone(directory.with_suffix(".lock")):
        if not (directory / "run.json").is_file():
            run_scene(scene, name, directory)
    return directory


def record_of(kind: str, directory: Path, out: Path) -> tuple[Channels, Floats]:
    """What the sensors of a run see, with noise."""
    _, values = channels_of(pd.read_parquet(directory / "fast.parquet"), plate_of(kind, out), str(directory))
    values = values[:len(ALL.accelerometers)]
    rms = np.sqrt(np.mean(values[:, round(SILENCE_S * RATE_Hz):] ** 2, axis=1, keepdims=True))
    rng = np.random.default_rng([41, zlib.crc32(directory.name.encode())])
    return ALL, values + 10 ** (-NOISE_dB / 20) * rms * rng.standard_normal(values.shape)


@cache
def plate_of(kind: str, out: Path) -> PlateModel:
    """What taps teach of the plate; the tail beam's, of more modes than a fit takes, is told within TOLD."""
    if KINDS[kind].scene == "caving.toml":
        return PlateModel.from_scene(SCENES / "caving.toml", HIGHEST_Hz, **TOLD)
    with alone(out / "engine_plate.lock"):
        return learnt_by_taps(PlateModel.from_scene(SCENES / "listening.toml", TRUE_Hz), out / "engine_plate.json",
                              np.random.default_rng(42), TAPS)


@cache
def known_of(kind: str, number: int, out: Path) -> tuple[tuple[list[Heard], int, bool], ...]:
    found = []
    for gangue in (0, 1):
        directory = simulated(known_scene(kind, number, gangue), f"{kind}_{number}_known_{gangue}", out)
        channels, values = record_of(kind, directory, out)
        found.append((hear(plate_of(kind, out), channels, prior_of(kind, out), values, QUIET_S).heard, gangue, False))
    return tuple(found)


@cache
def prior_of(kind: str, out: Path) -> StonePrior:
    limits = KINDS[kind].radius_m, KINDS[kind].speed_m_s
    if not KINDS[kind].own_law:
        return StonePrior(load_forces(), *limits)
    scene = f'base = "{SCENES / "single.toml"}"\n'
    if scatter := KINDS[kind].changes.get("scatter"):
        scene += "scatter = " + json.dumps(scatter).replace(": ", "= ") + "\n"
    file = out / f"engine_law_{zlib.crc32((scene + repr(limits)).encode()):08x}.json"
    with alone(file.with_suffix(".lock")):
        if not file.is_file():
            file.with_suffix(".toml").write_text(scene)
            learn_forces(file.with_suffix(".toml"), file, *limits)
    return StonePrior(load_forces(file), *limits)


def recognised(kind: str, number: int, known: bool, out: Path) -> Recognised:
    """What `listen` finds in the record of a stream. Raises RecognitionError."""
    directory = simulated(scenes_of(kind)[number], f"{kind}_{number}", out)
    channels, values = record_of(kind, directory, out)
    return recognise_stream(plate_of(kind, out), channels, prior_of(kind, out), values,
                            known=Known(others=known_of(kind, number, out)) if known else UNKNOWN_ALL)


def heard(kind: str, number: int, known: bool, out: Path) -> dict[str, object]:
    directory = simulated(scenes_of(kind)[number], f"{kind}_{number}", out)
    stones = pd.read_parquet(directory / "stones.parquet")
    touched = stones[stones["first_contact_s"].notna()]
    row: dict[str, object] = {"right": 100 * float((touched["kind"] == "gangue").mean()), "stones": len(touched)}
    try:
        found = recognised(kind, number, known, out)
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
        found.append({"kind": kind, "known": known, "streams": len(of), "answered": len(answered), "mean": off.mean(),
                      "worst": off.max(), "inside": int(inside.sum()), "sure": int(sure.sum()),
                      "silently_wrong": int((sure & (off > SILENT)).sum())})
    return pd.DataFrame(found)
