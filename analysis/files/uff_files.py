"""Universal files (UFF), ASCII or binary, by pyuff (extra `records`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from analysis.signals.records import Record, RecordError, chosen

TIME_DOMAIN = 1  # func_type of a time response in UFF dataset 58


def read_uff(path: str | Path, dataset: str | None = None) -> Record:
    """Return one time response (dataset 58) of a UFF file, ASCII or binary.

    The dataset is its number from 0 among the time responses, or its first identification line; it is needed where
    there are several. Raises RecordError if the file cannot be read, the dataset is left open or the package pyuff is
    missing.
    """
    try:
        import pyuff
    except ImportError:
        raise RecordError(f"{path}: reading UFF needs the package pyuff (pip install pyuff)") from None

    path = Path(path)
    try:
        sets = pyuff.UFF(str(path)).read_sets()
    except Exception as error:  # noqa: BLE001  pyuff raises bare Exception for a broken file
        raise RecordError(f"{path}: not a readable UFF file ({' '.join(str(error).split())})") from None
    sets = sets if isinstance(sets, list) else [sets]
    responses = [s for s in sets if s.get("type") == 58 and s.get("func_type") == TIME_DOMAIN]
    if not responses:
        raise RecordError(f"{path}: no time response; needs a dataset 58 with function type 1")
    labels = [str(s.get("id1", "")).strip() for s in responses]
    if dataset in labels and labels.count(dataset) == 1:
        number = labels.index(dataset)
    else:
        number = chosen(path, dataset, [str(i) for i in range(len(responses))])
    response = responses[number]
    if np.iscomplexobj(response["data"]) or not response.get("abscissa_spacing"):
        raise RecordError(f"{path}: dataset {number} is complex or unevenly spaced; needs real, even samples")
    unit = str(response.get("ordinate_axis_units_lab", "")).strip()
    unit = "1" if unit.upper() in ("", "NONE") else unit
    return Record(response["data"], 1.0 / response["abscissa_inc"], unit, f"{path}: {labels[number] or number}",
                  float(response.get("abscissa_min", 0.0)))  # fmt: skip
