"""How often the check of channels misses a fault or sees one that is not there, for docs/tapping.md.

    python benchmarks/channel_faults.py RECORDS [FAULT ...]

The plate is 1 % off the model and tapped at four places first; its records have 20 dB of noise.
"""

import sys

import numpy as np

from common.resources import resource
from recognition.evaluation.faulty_records import FAULTS, REFUSED, SAYS, volley, with_fault
from recognition.evaluation.other_plates import scattered
from recognition.evaluation.tap_records import hammer_taps
from recognition.plate.plate_model import PlateModel
from recognition.sensors.channel_check import check_channels
from recognition.tapping.fit import fit_plate
from recognition.tapping.learnt import learnt

SCENE, RATE_Hz, BAND_Hz = resource("scenes") / "paper.toml", 20e3, 5000.0


def main(count: int, faults: tuple[str, ...]) -> None:
    truth = scattered(PlateModel.from_scene(SCENE, 8000.0), 0.01, np.random.default_rng(1))
    rng = np.random.default_rng(2)
    taps = hammer_taps(truth, rng.uniform(-0.22, 0.22, (4, 2)), rng, place_error_m=1.5e-3)
    plate = learnt(fit_plate(PlateModel.from_scene(SCENE, 1.25 * BAND_Hz), taps)).plate
    print("fault,records,found_%,told_or_refused_wrongly_%,refused_%,misfit_median_%,expected_median_%", flush=True)
    for fault in faults:
        found, wrong, refused, misfits, expected = 0, 0, 0, [], []
        for k in range(count):
            rng = np.random.default_rng(1000 + k)
            report = check_channels(with_fault(volley(truth, RATE_Hz, rng), fault, RATE_Hz, rng), RATE_Hz, plate)
            right = report.refused if fault in REFUSED else report.told
            said = [line for line in right if SAYS.get(fault, "\0") in line]
            found += bool(said)
            wrong += fault not in REFUSED and bool(report.refused or len(report.told) > len(said))
            refused += bool(report.refused)
            if report.ringing is not None:
                misfits.append(report.ringing.misfit)
                expected.append(report.ringing.expected)
        middle = [100 * float(np.median(values)) if values else np.nan for values in (misfits, expected)]
        print(fault, count, *(f"{100 * n / count:.3g}" for n in (found, wrong, refused)), *(f"{v:.3g}" for v in middle),
              sep=",", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), tuple(sys.argv[2:]) or FAULTS)
