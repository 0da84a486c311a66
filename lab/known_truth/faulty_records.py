"""Records of stones with a fault in one of their channels, to see what a check of channels finds."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from lab.known_truth.force_pulses import hertz_pulse, records
from recognition.estimation.arrays import Floats
from recognition.plate.plate_model import PlateModel

STEEL = SimpleNamespace(density_kg_m3=7830.0, youngs_modulus_Pa=2.07e11, poisson_ratio=0.3)
COAL = SimpleNamespace(density_kg_m3=1380.0, youngs_modulus_Pa=5.12e9, poisson_ratio=0.3)
GANGUE = SimpleNamespace(density_kg_m3=2400.0, youngs_modulus_Pa=9.966e9, poisson_ratio=0.28)
DURATION_s, FIRST_s, SPREAD_s, FINER = 0.06, 6e-3, 1e-3, 6
MOST_STONES, RADII_m, SPEEDS_m_s, REACH = 12, (0.015, 0.035), (2.0, 4.0), 0.85  # REACH: share of the plate that is hit


def volley(plate: PlateModel, rate_Hz: float, rng: np.random.Generator, noise_db: float = 20.0) -> Floats:
    """Accelerations (s, t) of up to MOST_STONES stones anywhere, within a millisecond, then free ringing."""
    forces, places, limits = [], [], REACH * np.array([plate.lines_x_m[-1], plate.lines_y_m[-1]])
    for _ in range(rng.integers(1, MOST_STONES + 1)):
        stone = GANGUE if rng.random() < 0.5 else COAL
        forces.append(hertz_pulse(stone, STEEL, rng.uniform(*RADII_m), rng.uniform(*SPEEDS_m_s), FINER * rate_Hz,
                                  FIRST_s + rng.uniform(0, SPREAD_s), DURATION_s, rng.uniform(1.0, 1.5)))
        places.append(rng.uniform(-limits, limits))
    clean = records(plate, np.array(forces), np.array(places), rate_Hz, FINER)
    rms = np.sqrt(np.mean(clean[:, round(FIRST_s * rate_Hz):] ** 2, axis=1, keepdims=True))
    return np.asarray(clean + rms * 10 ** (-noise_db / 20) * rng.standard_normal(clean.shape), float)


def with_fault(record: Floats, fault: str, rate_Hz: float, rng: np.random.Generator) -> Floats:
    """The record (s, t) with a fault in a channel that is drawn, by a name of FAULTS."""
    out, i = record.copy(), int(rng.integers(len(record)))
    peak, t_s = abs(record[i]).max(), np.arange(record.shape[1]) / rate_Hz
    if fault == "offset":
        out[i] += 0.05 * peak
    elif fault == "hum":
        for order, share in ((1, 0.05), (2, 0.01), (3, 0.02)):
            phase = 2 * np.pi * (order * rng.choice([50.0, 60.0]) * t_s + rng.random())
            out[i] += share * peak * np.sin(phase)
    elif fault == "clipped":
        out[i] = np.clip(out[i], -0.4 * peak, 0.4 * peak)
    elif fault == "dead":
        out[i] = 1e-3 * peak * rng.standard_normal(out.shape[1])
    elif fault == "noise only":
        out[i] = record[i].std() * rng.standard_normal(out.shape[1])
    elif fault == "swapped":
        k = (i + int(rng.integers(1, len(record)))) % len(record)
        out[[i, k]] = out[[k, i]]
    elif fault == "gain":
        out[i] *= rng.choice([0.75, 1.33])
    elif fault == "wrong sign":
        out[i] *= -1
    return out


FAULTS = ("none", "offset", "hum", "clipped", "dead", "noise only", "swapped", "gain", "wrong sign")
#: What a report must hold of each: of what was told, or of why the record is refused.
SAYS = {"offset": "offset", "hum": "hum", "clipped": "clipped", "dead": "dead", "noise only": "", "swapped": "swapped",
        "gain": "gain", "wrong sign": ""}
REFUSED = ("clipped", "dead", "noise only", "swapped", "wrong sign")
