"""Universal files (UFF) by pyuff (extra `records`): time and frequency responses, datasets 58.

A frequency response (FRF) of an analyser becomes the impulse response that it is of.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from analysis.signals.records import Channels, Record, RecordError, sample_rate_Hz
from common.channels import plain_unit
from common.input_error import optional_library

TIME, FREQUENCY = 1, 4  # func_type of a time response and of a frequency response in dataset 58
OF_A_TABLE = ("frequency", "real", "imaginary")
PER_IMPULSE = "/N/s"  # ends the unit of a response to 1 N s
LEAD_s = 0.01
SI, SI_BY_QUANTITY = 1, {8: "m", 9: "N", 11: "m/s", 12: "m/s^2", 13: "N", 15: "Pa"}  # in datasets 164 and 58


def read_uff(path: Path) -> Channels:
    """The time responses, and as impulse responses the frequency responses, of datasets 58 of a UFF file, ASCII or
    binary, by their first identification lines, or numbers from 0 where these are not all different. Raises
    RecordError."""
    pyuff = optional_library("pyuff", f"{path}: reading UFF", "pyuff", RecordError)
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
    units = SI_BY_QUANTITY if any(s.get("units_code") == SI for s in sets) else {}
    return {label: partial(_record, one, f"{path}: {label}", units) for label, one in
            zip(labels, responses, strict=True)}


def _record(response: dict[str, Any], name: str, units: Mapping[int, str]) -> Record:
    unit = _unit(response, "ordinate", units) or "1"
    of_time = response["func_type"] == TIME
    if not response.get("abscissa_spacing") or np.iscomplexobj(response["data"]) == of_time:
        raise RecordError(f"{name}: needs even samples, real ones over time and complex ones over frequency")
    if of_time:
        begin_s = float(response.get("abscissa_min") or 0.0)
        return Record(response["data"], 1.0 / response["abscissa_inc"], unit, name, begin_s)
    unit = "/".join(filter(None, (unit, _unit(response, "orddenom", units))))
    return impulse_response(np.asarray(response["x"], float), response["data"], unit, name)


def _unit(response: dict[str, Any], of: str, units: Mapping[int, str]) -> str:
    """By its label or, where that is left out, by the quantity."""
    text = plain_unit(str(response.get(f"{of}_axis_units_lab", "")))
    return units.get(response.get(f"{of}_spec_data_type", 0), "") if text.upper() in ("", "NONE") else text


def impulse_response(frequency_Hz: np.ndarray, response: np.ndarray, unit: str, name: str) -> Record:
    """The response to a force of 1 N s in one sample, in `unit` over s, of a complex response (n,) in `unit`, such as
    m/s^2/N, to a force of each frequency (n,).

    Its rate is twice the highest frequency. Raises RecordError where the frequencies do not rise evenly from 0.

    >>> impulse_response(np.arange(5) * 10.0, np.ones(5), "m/s^2/N", "FRF").values.round(9).tolist()
    [80.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    """
    interval_Hz = 1.0 / sample_rate_Hz(frequency_Hz, f"{name}: frequencies")
    if abs(frequency_Hz[0]) > 1e-3 * interval_Hz:
        raise RecordError(f"{name}: a frequency response from {frequency_Hz[0]:g} Hz on; needs one from 0 Hz on")
    if not np.isfinite(response).all():
        raise RecordError(f"{name}: every value of a frequency response must be finite")
    samples = 2 * (len(response) - 1)
    rate_Hz = samples * interval_Hz
    return Record(rate_Hz * np.fft.irfft(response, samples), rate_Hz, f"{unit}/s", name)


def as_tap(responses: Mapping[str, Record]) -> dict[str, Record]:
    """Responses to 1 N s as a tap records them: LEAD_s later, beside the force, `force_N`. Of others, what is given."""
    if not all(record.unit.endswith(PER_IMPULSE) for record in responses.values()):
        return dict(responses)
    first = next(iter(responses.values()))
    lead = round(LEAD_s * first.rate_Hz)
    force_N = np.zeros(first.values.size)
    force_N[lead] = first.rate_Hz
    later = {name: replace(record, values=np.roll(record.values, lead), unit=record.unit.removesuffix(PER_IMPULSE))
             for name, record in responses.items()}
    return later | {"force_N": Record(force_N, first.rate_Hz, "N", first.name)}
