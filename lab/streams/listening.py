"""Streams of known truth, and what `listen` makes of them.

Streams are superpositions (lab/known_truth/simulated.py) of forces of single stones (stone_forces.py) on plates that are
not the model's: frequencies, damping and shapes scattered by 1, 10 and 1 % (plates "1" and "2"). Each plate is tapped at
the same four places with 20 dB of noise, and what `tap` learnt is what `listen` is given. Places, arrivals and speeds are
unknown, noise is 20 dB at 20 kHz.

listening_limits: streams of the set "tried", from which the limits of recognition/stream/checks.py were set.
listening_noise: the same in a machine's noise, also on plates and with sensors that are not as `listen` is told.
listening: streams of the sets "held_out", "one_fall" and "any_fall", whose forces no law or limit has seen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from lab.known_truth.machine_noise import KINDS, noise
from lab.known_truth.simulated import Stream
from lab.known_truth.stone_histories import histories
from lab.streams.differences import Difference, differences
from lab.streams.known_streams import ONE, SCENE, Case, HIGHEST_Hz, heard, stream, tapped, true_plate
from lab.study import Row
from recognition.plate.plate_model import PlateModel
from recognition.stream.recognise import RATE_Hz

#: Name, case, set of the forces, and how many streams at most, which fall on the plates "1" and "2" in turn.
GOALS: list[tuple[str, Case, str, int]] = [
    ("100 a second", Case(100, 100), "held_out", 20),
    ("200 a second", Case(200, 100), "held_out", 20),
    ("all sizes, any speed", Case(50, 100, all_sizes=True), "any_fall", 40),
    ("all sizes, 41 stones", Case(50, 100, all_sizes=True), "held_out", 20),
    ("all sizes, one fall", Case(50, 100, all_sizes=True), "one_fall", 20),
    ("5 to 30 mm, one fall", Case(50, 100, all_sizes=True, brought_to_m=(0.005, 0.03)), "one_fall", 20),
    ("20 a second", Case(20, 100), "held_out", 20),
    ("400 stones", Case(100, 400), "held_out", 10),
    ("one accelerometer", Case(20, 60, ONE), "held_out", 20),
    ("volley of ten", Case(100, 30, at_once=10), "held_out", 4)]
STREAMS, NOISE_SEEDS, FAULT_NOISES = 3, 5, ("mixture",)  # of the results
NOISY, QUIET_S, BURSTS_QUIET_S = Case(50, 60, noise_db=None), 1.0, 4.0
SILENTLY_WRONG = 5.0  # points


def listening(out: Path, streams: int = STREAMS) -> Iterator[Row]:
    """Of each goal so many of its streams, in turn."""
    def one(kind: str, seed: int, case: Case, pool: str) -> dict[str, object]:
        rng = np.random.default_rng([3, int(case.rate_1_s), case.count, len(case.channels.accelerometers), seed])
        case = replace(case, gangue=rng.uniform(0.2, 0.8))
        record = stream(true_plate(kind), case, histories(pool), rng)
        return {"gangue": case.gangue, **heard(tapped(kind, out), case, record)}

    for seed in range(streams):
        kind = "12"[seed % 2]
        for name, case, pool, most in GOALS:
            if seed < most:
                yield Row({"case": name, "plate": kind, "seed": seed}, partial(one, kind, seed, case, pool))


def listening_limits(out: Path) -> Iterator[Row]:
    """Rates and plates; every fifth stream has all sizes."""
    def one(kind: str, number: int, rate: int) -> dict[str, object]:
        rng = np.random.default_rng([5, number])
        case = Case(rate, 60, gangue=rng.uniform(0.2, 0.8), all_sizes=number % 5 == 4)
        record = stream(true_plate(kind), case, histories("tried"), rng)
        return {"rate_1_s": rate, "all_sizes": case.all_sizes, **heard(tapped(kind, out), case, record)}

    for number, (kind, rate) in enumerate(product(("1", "2", "other theory"), (20, 50, 100, 200, 50))):
        yield Row({"plate": kind, "number": number}, partial(one, kind, number, rate))


def listening_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Of each case the errors in points, mean and 95th percentile of their sizes over the streams that were answered."""
    return grouped(rows, ["case"], told_of)


def listening_noise(out: Path, seeds: int = NOISE_SEEDS, fault_noises: tuple[str, ...] = FAULT_NOISES) -> Iterator[Row]:
    """Each kind of noise of a machine at each level, for some seeds; and each fault under some of them."""
    for seed, noise_db, kind in product(range(seeds), (20.0, 10.0, 5.0), KINDS):
        yield Row({"noise": kind, "noise_db": noise_db, "fault": "none", "seed": seed},
                  partial(_in_noise, kind, noise_db, seed, Difference("none"), out))
    for fault, kind in product(differences(), fault_noises):
        yield Row({"noise": kind, "noise_db": 20.0, "fault": fault.name, "seed": 0},
                  partial(_in_noise, kind, 20.0, 0, fault, out))


def _in_noise(kind: str, noise_db: float, seed: int, fault: Difference, out: Path) -> dict[str, object]:
    """What is heard of a stream in a machine's noise, which runs for a while before."""
    quiet_s = BURSTS_QUIET_S if kind == "bursts" else QUIET_S
    record = _without_noise(seed, fault)
    rms = np.sqrt(np.mean(record.values**2, axis=1, keepdims=True))
    values = np.pad(record.values, ((0, 0), (round(quiet_s * RATE_Hz), 0)))
    rng = np.random.default_rng([23, seed, 1])
    values = values + 10 ** (-noise_db / 20) * rms * noise(kind, values.shape, RATE_Hz, rng)
    truth = record.truth.assign(**{name: record.truth[name] + quiet_s for name in ("t_s", "centre_s")})
    record = replace(record, values=values, truth=truth)
    return heard(_told(fault, out), NOISY, record if fault.record is None else fault.record(record), quiet_s)


@cache
def _without_noise(seed: int, fault: Difference) -> Stream:
    rng = np.random.default_rng([23, seed])
    plate = true_plate("1") if fault.plate is None else fault.plate()
    return stream(plate, replace(NOISY, gangue=rng.uniform(0.2, 0.8)), histories("tried"), rng)


def _told(difference: Difference, out: Path) -> PlateModel:
    """The plate that `listen` is given."""
    if difference.untapped:
        return PlateModel.from_scene(SCENE, HIGHEST_Hz, frequency_sd=0.03, damping_sd=0.5)
    return tapped("1", out)


def listening_noise_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Of each noise, level and fault, and of all noises and faults together."""
    whole = rows.assign(noise="all", fault=rows["fault"].where(rows["fault"] == "none", "any"))
    return pd.concat([grouped(part, ["noise", "noise_db", "fault"], told_of) for part in (whole, rows)])


def listening_limits_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    return grouped(rows, ["plate"], told_of)


def grouped(rows: pd.DataFrame, by: list[str], told: Callable[[pd.DataFrame], dict[str, object]]) -> pd.DataFrame:
    """What is told of each group, behind what tells it from the others. Rows that were refused have a reason."""
    groups = rows.assign(refused=rows["refused"].fillna("")).groupby(by, sort=False)
    return pd.DataFrame([dict(zip(by, key, strict=True)) | told(own) for key, own in groups])


def told_of(rows: pd.DataFrame) -> dict[str, object]:
    """A line of a table: rows are streams."""
    answered = rows[rows["refused"] == ""]
    warned = answered["warned"].astype(str) == "True"  # strings and NaN, where streams were refused at once
    told: dict[str, object] = {"streams": len(rows), "refused": len(rows) - len(answered), "warned": int(warned.sum())}
    if "number_error" not in answered or answered.empty:
        return told
    for name in ("number", "mass"):
        size = answered[f"{name}_error"].abs()
        told |= {f"{name}_mean": round(size.mean(), 2), f"{name}_worst": round(size.max(), 2),
                 f"{name}_95": round(float(np.quantile(size, 0.95)), 2),
                 f"{name}_wrong": int((size > SILENTLY_WRONG).sum()),
                 f"{name}_silently_wrong": int(((size > SILENTLY_WRONG) & ~warned).sum()),
                 f"{name}_inside": int((answered[f"{name}_inside"] == True).sum()),  # noqa: E712, of strings and NaN
                 f"{name}_parts_inside": f"{answered[f'{name}_parts_inside'].sum():g}/{answered['parts'].sum():g}",
                 f"{name}_parts_exact": int(answered[f"{name}_parts_exact"].sum())}
    for name in ("stones", "found", "wrong", "none"):
        told[name] = int(answered[name].sum())
    told["s_per_s"] = round(float((answered["hear_s"] / answered["length_s"]).mean()), 2)
    told["unexplained"] = f"{rows['unexplained'].min():.3f} to {rows['unexplained'].max():.3f}"
    return told
