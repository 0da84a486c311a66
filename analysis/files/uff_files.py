"""Universal files (UFF) by pyuff (extra `records`): time and frequency responses, datasets 58."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from analysis.signals.frequency_responses import impulse_response
from analysis.signals.records import Channels, Record, RecordError

TIME, FREQUENCY = 1, 4  # func_type of a time response and of a frequency response in dataset 58


def read_uff(path: Path) -> Channels:
    """The time responses, and as impulse responses the frequency responses, of datasets 58 of a UFF file, ASCII or
    binary, by their first identification lines, or numbers from 0 where these are not all different. Raises
    RecordError."""
    try:
        import pyuff
    except ImportError:
        raise RecordError(f"{path}: reading UFF needs the package pyuff (pip install pyuff)") from None

    try:
        sets = pyuff.UFF(str(path)).read_sets()
    except Exception as error:  # noqa: BLE001  pyuff raises bare Exception for a broken file
        raise RecordError(f"{path}: not a readable UFF file ({' '.join(str(error).split())})") from None
    sets = sets if isinstance(sets, list) else [sets]
    responses = [s for s in sets if s.get("type") == 58 and s.get("func_type") in (TIME, FREQUENCY)]
    if not responses:
        raise RecordError(f"{path}: no time or frequency response; needs a dataset 58 with function type 1 or 4")
    labels = [str(s.get("id1", "")).strip() for s in responses]
    if len(set(labels)) < len(labels) or "" in labels:
        labels = [str(k) for k in range(len(labels))]
    return {label: partial(_record, one, f"{path}: {label}") for label, one in zip(labels, responses, strict=True)}


def _record(response: dict[str, Any], name: str) -> Record:
    unit = _unit(response, "ordinate") or "1"
    of_time = response["func_type"] == TIME
    if not response.get("abscissa_spacing") or np.iscomplexobj(response["data"]) == of_time:
        raise RecordError(f"{name}: needs even samples, real ones over time and complex ones over frequency")
    if of_time:
        begin_s = float(response.get("abscissa_min") or 0.0)
        return Record(response["data"], 1.0 / response["abscissa_inc"], unit, name, begin_s)
    unit = "/".join(filter(None, (unit, _unit(response, "orddenom"))))
    return impulse_response(np.asarray(response["x"], float), response["data"], unit, name)


def _unit(response: dict[str, Any], of: str) -> str:
    text = str(response.get(f"{of}_axis_units_lab", "")).strip()
    return "" if text.upper() == "NONE" else text
