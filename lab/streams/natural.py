"""A hundred stones that vary as those of scenes/natural.toml do (volleys of scenes/dataset.toml, one stone after another,
as superposed.py makes them of forces that no law has seen), on a tapped plate whose frequencies, damping and shapes are 1,
10 and 1 % off, 20 dB of noise: what `listen` makes of them by stones that one knows, which are those that were heard of the
next streams; and the oracle (baselines.py) by the stones of all others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from dem.batch.dataset import plan_dataset
from dem.stones.arrangement import stones_of
from lab.known_truth.simulated import SILENCE_S, stone_rows, stream_of
from lab.recognition.baselines import Oracle
from lab.recognition.superposed import STEP_s, force_of
from lab.streams.known_streams import ALL, MATCH_s, REACH_m, SIZES_m, SPEEDS_m_s, tapped, true_plate, true_ratio
from lab.study import Row
from recognition.innovations.bank import TIME
from recognition.innovations.prior import StonePrior
from recognition.stone_forces.forces import History, load_forces
from recognition.stream.listen import Heard
from recognition.stream.recognise import LEAST_DOUBT, QUIET_S, Hearing, RATE_Hz, hear
from recognition.stream.stones import Known, learnt_table, ratio_of

PLAN, STONES, RATE_1_s, FORCE_s = Path("scenes/dataset.toml"), 100, 50.0, 3e-3
HELD_OUT = ("held_out", "one_fall", "any_fall")
STREAMS, NEXT = 17, 4  # which have 176 volleys; streams of which known stones are
DROPPED, ALIKE = "dropped", "alike"  # coal first is alike
KNOWN = ((0, 0, "none"), (15, 0, ALIKE), (50, 0, ALIKE), *((n, n, how) for how in (DROPPED, ALIKE) for n in (10, 30, 100)))


@cache
def stones(streams: int) -> list[History]:
    """Those of ten volleys a stream, with their forces."""
    volleys = [one.scene for one in plan_dataset(PLAN, 10 * streams) if one.directory.parts[0] == "natural"]
    return [History(force_of(replace(stone, arrival_s=0.0), round(FORCE_s / STEP_s), HELD_OUT), STEP_s,
                    stone.substance.kind == "gangue", stone.radius_m, stone.density_kg_m3, stone.speed_m_s)
            for scene in volleys for stone in stones_of(scene, str(PLAN))]


@dataclass(frozen=True)
class Listened:
    """What was heard of a stream, and its stones in order of arrival."""

    hearing: Hearing
    truth: pd.DataFrame

    def of(self, gangue: int) -> list[Heard]:
        """The stones of a material that were heard."""
        at_s = np.array([h.stone[TIME] for h in self.hearing.heard]) / RATE_Hz
        off_s = abs(at_s - self.truth.loc[self.truth["gangue"] == gangue, "centre_s"].to_numpy()[:, None])
        return [self.hearing.heard[k] for k, least in zip(off_s.argmin(axis=1), off_s.min(axis=1), strict=True)
                if least < MATCH_s]


def natural_streams(out: Path, streams: int = STREAMS) -> Iterator[Row]:
    prior = StonePrior(load_forces(), SIZES_m, SPEEDS_m_s)

    @cache
    def listened(seed: int) -> Listened:
        rng, every = np.random.default_rng([31, seed]), stones(streams)
        which = rng.permutation(range(STONES * seed, STONES * (seed + 1)))
        arrival_s = SILENCE_S + np.cumsum(rng.exponential(1 / RATE_1_s, STONES))
        truth = stone_rows(every, which, arrival_s, rng.uniform(-REACH_m, REACH_m, (STONES, 2)))
        record = stream_of(true_plate("1"), ALL, every, truth, RATE_Hz, 20.0, rng)
        return Listened(hear(tapped("1", out), ALL, prior, record.values, QUIET_S), truth)

    def answered(coal: int, gangue: int, known: str, seed: int) -> dict[str, object]:
        following = [listened((seed + 1 + k) % streams) for k in range(NEXT)] if coal else []
        others = [([h for one in following for h in one.of(m)][:count], m, known == ALIKE)
                  for m, count in enumerate((coal, gangue))]
        own = listened(seed)
        drawn, _, _ = learnt_table(own.hearing.heard, own.hearing.prior, prior, Known(others=others), RATE_Hz, LEAST_DOUBT)
        row: dict[str, object] = {}
        for name, by_mass in (("number", False), ("mass", True)):
            low, ratio, high = ratio_of(drawn, by_mass)
            right = true_ratio(own.truth, by_mass)
            row |= {f"{name}_error": 100 * (ratio - right), f"{name}_width": 100 * (high - low),
                    f"{name}_inside": low <= right <= high}
        return row | {"oracle_error": 100 * (oracle(seed) - true_ratio(own.truth, False))}

    @cache
    def oracle(seed: int) -> float:
        table = pd.DataFrame({"kind": ["gangue" if one.gangue else "coal" for one in stones(streams)],
                              "impulse_N_s": [one.moments()[0] for one in stones(streams)],
                              "peak_force_N": [one.force_N.max() for one in stones(streams)]})
        own = table.index // STONES == seed
        return Oracle().fit([table[~own]], np.empty(0)).answer([table[own]])[0].ratio

    for (coal, gangue, known), seed in product(KNOWN, range(streams)):
        yield Row({"known": known, "coal": coal, "gangue": gangue, "seed": seed}, partial(answered, coal, gangue, known, seed))


def natural_streams_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Errors in points; number_sd: standard deviation of the mean."""
    found = []
    for (known, coal, gangue), of in rows.groupby(["known", "coal", "gangue"], sort=False):
        told: dict[str, object] = {"known": known, "coal": coal, "gangue": gangue, "streams": len(of)}
        for name in ("number", "mass", "oracle"):
            size = of[f"{name}_error"].abs()
            told |= {f"{name}_mean": size.mean(), f"{name}_sd": size.sem(), f"{name}_worst": size.max()}
        found.append(told | {f"{name}_inside": int(of[f"{name}_inside"].astype(str).eq("True").sum()) for name in ("number", "mass")}
                     | {"number_width": of["number_width"].mean()})
    return pd.DataFrame(found)
