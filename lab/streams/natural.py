"""A hundred stones that vary as those of scenes/natural.toml do (volleys of scenes/dataset.toml, one stone after another,
as superposed.py makes them of forces that no law has seen), on a tapped plate whose frequencies, damping and shapes are 1,
10 and 1 % off, 20 dB of noise: what `listen` makes of them, and the oracle (baselines.py) by the stones of other streams."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from dem.batch.dataset import plan_dataset
from dem.stones.arrangement import stones_of
from lab.known_truth.simulated import SILENCE_S, Stream, stone_rows, stream_of
from lab.recognition.baselines import Oracle
from lab.recognition.superposed import STEP_s, force_of
from lab.streams.known_streams import ALL, REACH_m, SIZES_m, SPEEDS_m_s, tapped, true_plate, true_ratio
from lab.study import Row
from recognition.innovations.prior import StonePrior
from recognition.stone_forces.forces import History, load_forces
from recognition.stream.recognise import RATE_Hz, recognise_stream
from recognition.stream.stones import Known, ratio_of

PLAN, STONES, COAL, RATE_1_s, FORCE_s = Path("scenes/dataset.toml"), 100, 15, 50.0, 3e-3
HELD_OUT = ("held_out", "one_fall", "any_fall")


@cache
def stones(streams: int) -> list[History]:
    """Those of ten volleys a stream, with their forces."""
    volleys = [one.scene for one in plan_dataset(PLAN, 10 * streams) if one.directory.parts[0] == "natural"]
    return [History(force_of(replace(stone, arrival_s=0.0), round(FORCE_s / STEP_s), HELD_OUT), STEP_s,
                    stone.substance.kind == "gangue", stone.radius_m, stone.density_kg_m3, stone.speed_m_s)
            for scene in volleys for stone in stones_of(scene, str(PLAN))]


def stream(every: list[History], seed: int) -> Stream:
    """COAL stones of coal from other streams, then STONES."""
    rng, own = np.random.default_rng([31, seed]), range(STONES * seed, STONES * (seed + 1))
    others = [k for k, one in enumerate(every) if k not in own and not one.gangue]
    which = np.concatenate([rng.choice(others, COAL, replace=False), rng.permutation(own)])
    arrival_s = SILENCE_S + np.cumsum(rng.exponential(1 / RATE_1_s, which.size))
    truth = stone_rows(every, which, arrival_s, rng.uniform(-REACH_m, REACH_m, (which.size, 2)))
    return stream_of(true_plate("1"), ALL, every, truth, RATE_Hz, 20.0, rng)


def natural_streams(out: Path, streams: int = 8) -> Iterator[Row]:
    def heard(seed: int, coal_first: int) -> dict[str, object]:
        record, prior = stream(stones(streams), seed), StonePrior(load_forces(), SIZES_m, SPEEDS_m_s)
        found = recognise_stream(tapped("1", out), ALL, prior, record.values, known=Known(coal_first=coal_first))
        drawn = found.stones[found.stones["t_s"] > record.truth["t_s"].iloc[COAL] - 1e-4]
        row: dict[str, object] = {"refused": found.refused}
        for name, by_mass in (("number", False), ("mass", True)):
            low, ratio, high = ratio_of(drawn, by_mass)
            right = true_ratio(record.truth.iloc[COAL:], by_mass)
            row |= {f"{name}_error": 100 * (ratio - right), f"{name}_width": 100 * (high - low),
                    f"{name}_inside": low <= right <= high}
        return row | {"oracle_error": 100 * (oracle(seed) - true_ratio(record.truth.iloc[COAL:], False))}

    @cache
    def oracle(seed: int) -> float:
        table = pd.DataFrame({"kind": ["gangue" if one.gangue else "coal" for one in stones(streams)],
                              "impulse_N_s": [one.moments()[0] for one in stones(streams)],
                              "peak_force_N": [one.force_N.max() for one in stones(streams)]})
        own = table.index // STONES == seed
        return Oracle().fit([table[~own]], np.empty(0)).answer([table[own]])[0].ratio

    for seed in range(streams):
        for coal_first in (0, COAL):
            yield Row({"coal_first": coal_first, "seed": seed}, partial(heard, seed, coal_first))


def natural_streams_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Errors in points."""
    found = []
    for coal_first, of in rows.groupby("coal_first"):
        told: dict[str, object] = {"coal_first": coal_first, "streams": len(of), "refused": int((of["refused"].fillna("") != "").sum())}
        for name in ("number", "mass", "oracle"):
            size = of[f"{name}_error"].abs()
            told |= {f"{name}_mean": size.mean(), f"{name}_worst": size.max()}
        found.append(told | {f"{name}_inside": int(of[f"{name}_inside"].astype(str).eq("True").sum()) for name in ("number", "mass")}
                     | {"number_width": of["number_width"].mean()})
    return pd.DataFrame(found)
