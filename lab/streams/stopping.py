"""When `listen --stop-above 40 --false-alarms-per-hour 1` stops a drawing whose share of gangue rises from 0 to 60 % in 60 s at
20 stones a second, and how often in HOURS at a constant 20 % it does so.

Stones are those of stone_kinds.py; what is foreseen is that at the end.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from lab.streams.stone_kinds import ERROR, Kind, Reference, kinds, stones
from lab.study import Row
from recognition.estimation.arrays import Floats
from recognition.innovations.prior import StonePrior
from recognition.stone_forces.forces import load_forces
from recognition.stream.decision import CALM, Stop, follow
from recognition.stream.recognise import LEAST_DOUBT
from recognition.stream.stone_law import UNKNOWN, Told

STOP, RATE_1_s, RISE_s, HIGHEST = Stop(0.4, 1.0), 20.0, 60.0, 0.6
HOURS, SEEDS = 0.5, 1
KINDS = ("stiffness 20 %", "any speed", "15 to 35 mm, 2 to 4 m/s")
REFERENCES = {"100 coal first": Reference(100), "100 + 100 dropped": Reference(100, 100, dropped=True)}


def stopping(out: Path, seeds: int = SEEDS, hours: float = HOURS) -> Iterator[Row]:
    """Drawings that rise, and one that does not."""
    rising = np.linspace(0, HIGHEST, round(RATE_1_s * RISE_s))
    calm = np.full(round(3600 * hours * RATE_1_s), CALM * STOP.above)
    for seed, name, reference in product(range(seeds), KINDS, REFERENCES):
        yield Row({"kind": name, "reference": reference, "share": "rises", "seed": seed},
                  partial(drawn, name, reference, rising, seed))
    for name, reference in product(KINDS, REFERENCES):
        yield Row({"kind": name, "reference": reference, "share": "calm", "seed": 0},
                  partial(drawn, name, reference, calm, 0))


def drawn(name: str, reference: str, share: Floats, seed: int) -> dict[str, object]:
    """The first alarm, how many there are in an hour, and what was foreseen."""
    kind, of = next(k for k in kinds() if k.name == name), REFERENCES[reference]
    told = _told(kind, of, share, np.random.default_rng([31, seed]))
    found = follow(told, np.arange(len(told.x)) / RATE_1_s,
                   StonePrior(load_forces(), kind.told_m or kind.radius_m, kind.told_m_s or kind.speed_m_s), STOP, LEAST_DOUBT)
    at = np.flatnonzero(found.alarm)
    return {"alarm_s": at[0] / RATE_1_s if len(at) else np.inf, "alarms_1_h": 3600 * RATE_1_s * len(at) / len(share),
            "unsafe": found.foreseen.unsafe, "foreseen_delay_s": found.foreseen.delay / RATE_1_s,
            "foreseen_alarms_1_h": found.foreseen.false_alarms_1_h}


def _told(kind: Kind, of: Reference, share: Floats, rng: np.random.Generator) -> Told:
    known = np.arange(of.coal + of.gangue) >= of.coal
    gangue = np.r_[known, rng.random(len(share)) < share]
    x = stones(kind, gangue, rng)[0]
    return Told(x, np.tile(np.diag((kind.error * ERROR) ** 2), (len(x), 1, 1)),
                np.r_[known.astype(int), np.full(len(share), UNKNOWN)], (np.arange(len(x)) < len(known)) & of.dropped)


def stopping_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Of each kind and reference."""
    found = []
    for (kind, reference), own in rows.groupby(["kind", "reference"], sort=False):
        rises, calm = own[own["share"] == "rises"], own[own["share"] == "calm"]
        found.append({"kind": kind, "reference": reference, "drawings": len(rises), "unsafe": int(rises["unsafe"].sum()),
                      "alarm_s": rises["alarm_s"].median(), "earliest_s": rises["alarm_s"].min(),
                      "latest_s": rises["alarm_s"].max(), "foreseen_delay_s": rises["foreseen_delay_s"].median(),
                      "false_alarms_1_h": calm["alarms_1_h"].mean(),
                      "foreseen_alarms_1_h": calm["foreseen_alarms_1_h"].mean()})
    return pd.DataFrame(found)
