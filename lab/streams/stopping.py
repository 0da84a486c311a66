"""When `listen --stop-above 40 --false-alarms-per-hour 1` stops drawings whose share of gangue rises from 0 to 60 % in 60 s at
20 stones a second; how often it does so by mistake in HOURS at 20 % between them, and how soon at 40 % after them.

Stones are those of stone_kinds.py. A seed has known stones of its own, and DRAWINGS, by the first of which the law is
learnt; what is foreseen is that at the end. A perfect ear knows the kind of each stone, and has the same test.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from lab.streams.stone_kinds import ERROR, Kind, Reference, kinds, stones
from lab.study import Row
from recognition.estimation.arrays import Floats
from recognition.innovations.prior import StonePrior
from recognition.stone_forces.forces import load_forces
from recognition.stream.decision import CALM, Judge, Stop, mean_stones
from recognition.stream.recognise import LEAST_DOUBT
from recognition.stream.stone_law import UNKNOWN, Told

STOP, RATE_1_s, HIGHEST = Stop(0.4, 1.0), 20.0, 0.6
RISE, FALL, ABOVE, DRAWINGS = 1200, 1200, 6000, 10  # stones of a drawing, at 20 % until the sum has fallen, and at 40 %
HOURS, SEEDS = 0.1, 1
KINDS = ("stiffness 20 %", "any speed", "15 to 35 mm, 2 to 4 m/s")
REFERENCES = {"100 coal first": Reference(100), "100 + 100 dropped": Reference(100, 100, dropped=True)}


def stopping(out: Path, seeds: int = SEEDS, hours: float = HOURS) -> Iterator[Row]:
    """Drawings of each kind and reference."""
    for seed, name, reference in product(range(seeds), KINDS, REFERENCES):
        yield Row({"kind": name, "reference": reference, "seed": seed}, partial(drawn, name, reference, seed, hours))


def drawn(name: str, reference: str, seed: int, hours: float) -> dict[str, object]:
    """The alarms of all drawings, those of a perfect ear, how many come between and after them, and what was foreseen."""
    kind, of = next(k for k in kinds() if k.name == name), REFERENCES[reference]
    calm = np.full(FALL + round(3600 * hours * RATE_1_s / DRAWINGS), CALM * STOP.above)
    each = np.r_[np.linspace(0, HIGHEST, RISE), calm]
    share = np.r_[np.tile(each, DRAWINGS), np.full(ABOVE, STOP.above)]
    told, gangue = _told(kind, of, share, np.random.default_rng([31, seed]))
    prior = StonePrior(load_forces(), kind.told_m or kind.radius_m, kind.told_m_s or kind.speed_m_s)
    known = np.flatnonzero(told.known != UNKNOWN)
    judge, alarm = Judge(told.only(known), prior, STOP, LEAST_DOUBT), np.zeros(0, dtype=bool)
    for part in np.array_split(np.arange(len(known), len(told.x)), DRAWINGS):  # all at once need gigabytes
        alarm = np.concatenate([alarm, *(one.alarm for one in judge.judge(told.only(part), part / RATE_1_s))])
    assert judge.learnt is not None and judge.learnt.foreseen is not None
    foreseen = judge.learnt.foreseen
    heard, perfect = (a[:-ABOVE].reshape(DRAWINGS, len(each)) for a in (alarm, perfect_alarms(gangue)))
    return {"unsafe": foreseen.unsafe, "foreseen_delay_s": foreseen.delay / RATE_1_s,
            "foreseen_alarms_1_h": foreseen.false_alarms_1_h,
            "alarms_1_h": heard[:, RISE + FALL:].sum() / hours, "perfect_alarms_1_h": perfect[:, RISE + FALL:].sum() / hours,
            "delay_s": ABOVE / RATE_1_s / alarms if (alarms := alarm[-ABOVE:].sum()) else np.inf,
            **{f"{name}_{k}_s": alarm.argmax() / RATE_1_s if alarm.any() else np.inf
               for name, alarms in (("alarm", heard), ("perfect", perfect)) for k, alarm in enumerate(alarms[:, :RISE])}}


def perfect_alarms(gangue: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Of the test that knows each stone's kind, by the least threshold with no more false alarms than asked."""
    gain, calm = STOP.gain(np.array([0.0, 1.0])), np.array([1 - CALM * STOP.above, CALM * STOP.above])
    seldom = 3600 * RATE_1_s / STOP.false_alarms_1_h
    threshold = next(h for h in np.arange(0.05, 20.0, 0.05) if mean_stones(gain, calm, h) >= seldom)
    alarm, total = np.zeros(len(gangue), dtype=bool), 0.0
    for k, by in enumerate(gain[gangue.astype(int)]):
        total = max(0.0, total + by)
        alarm[k], total = total > threshold, 0.0 if total > threshold else total
    return alarm


def _told(kind: Kind, of: Reference, share: Floats, rng: np.random.Generator) -> tuple[Told, NDArray[np.bool_]]:
    """Known stones and unknown ones, and which of these are gangue."""
    known = np.arange(of.coal + of.gangue) >= of.coal
    gangue = rng.random(len(share)) < share
    x = stones(kind, np.r_[known, gangue], rng)[0]
    return Told(x, np.tile(np.diag((kind.error * ERROR) ** 2), (len(x), 1, 1)),
                np.r_[known.astype(int), np.full(len(share), UNKNOWN)], (np.arange(len(x)) < len(known)) & of.dropped), gangue


def stopping_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Of each kind and reference, the alarms of all drawings; medians of what is foreseen and of delays at 40 %."""
    found = []
    for (kind, reference), own in rows.groupby(["kind", "reference"], sort=False):
        alarm_s, perfect_s = (own.filter(regex=rf"^{name}_\d+_s$").to_numpy() for name in ("alarm", "perfect"))
        found.append({"kind": kind, "reference": reference, "drawings": alarm_s.size, "references": len(own),
                      "unsafe": int(own["unsafe"].sum()), "alarm_s": np.median(alarm_s),
                      "early_s": np.quantile(alarm_s, 0.1, method="lower"),
                      "late_s": np.quantile(alarm_s, 0.9, method="higher"), "perfect_s": np.median(perfect_s),
                      "delay_s": own["delay_s"].median(), "foreseen_delay_s": own["foreseen_delay_s"].median(),
                      "false_alarms_1_h": own["alarms_1_h"].mean(), "most_1_h": own["alarms_1_h"].max(),
                      "perfect_alarms_1_h": own["perfect_alarms_1_h"].mean(),
                      "foreseen_alarms_1_h": own["foreseen_alarms_1_h"].mean()})
    return pd.DataFrame(found)
