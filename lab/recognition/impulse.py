"""The stones' impulse from the momentum of the plate and the forces of its rods.

After the impact the plate's momentum M v and the momentum that its rods have carried away add up to the impulse J_s of
the stones, and stay so:

    integral of the rods' forces + M v = -J_s

v is the velocity of the centre of mass, upwards; positive forces of the rods (tension) pull the plate down; J_s points
downwards. M, the mass that moves with v, is minus the slope of the integral against v in the record itself, so that no
property of the plate is needed. J_s does not depend on where the stones fall, on the plate's modes or on their damping.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.integrate import cumulative_trapezoid

from common.channels import RODS
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError

#: J_s is the mean over this time. Before it, stones still touch the plate; after it, the integral has gathered more
#: noise.
AVERAGED_S = (0.75e-3, 3e-3)


def signals_of(signals: pd.DataFrame, names: list[str]) -> Floats:
    """Columns of a record (columns, samples). RecognitionError for a missing one, and for a value that is not finite."""
    if missing := [name for name in names if name not in signals.columns]:
        raise RecognitionError(f"no column {missing[0]!r} in the record")
    values = signals[names].to_numpy(dtype=float).T
    if not np.isfinite(values).all():
        raise RecognitionError(f"columns {', '.join(names)} of the record have a value that is not finite")
    return values


def impulse_N_s(signals: pd.DataFrame) -> float:
    """Of a record with columns t_s, v_m_s and rod_*. RecognitionError for missing ones, or a record that is too short
    or at rest."""
    rods_N = signals_of(signals, [name for name in map(str, signals.columns) if name.startswith(RODS)] or [f"{RODS}*"])
    (v_m_s,) = signals_of(signals, ["v_m_s"])
    t_s = signals["t_s"].to_numpy(dtype=float) - float(signals["t_s"].iloc[0])
    start, end = np.searchsorted(t_s, AVERAGED_S)
    if len(t_s) < max(end, start + 2):
        raise RecognitionError(f"the record is shorter than {AVERAGED_S[1]:g} s")
    carried_N_s, v = np.asarray(cumulative_trapezoid(rods_N.sum(axis=0), t_s, initial=0))[start:], v_m_s[start:]
    swing = v - v.mean()
    if swing @ swing <= 0:
        raise RecognitionError("the record is at rest")
    mass_kg = -(swing @ carried_N_s) / (swing @ swing)
    return float(-(carried_N_s + mass_kg * v)[:end - start].mean())
