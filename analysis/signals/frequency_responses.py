"""Frequency responses (FRFs) of an analyser, as the impulse responses that they are of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from analysis.signals.records import Record, RecordError, sample_rate_Hz

OF_A_TABLE = ("frequency", "real", "imaginary")
PER_IMPULSE = "/N/s"  # ends the unit of a response to 1 N s
LEAD_s = 0.01


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
