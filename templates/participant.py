"""A plate behind the engine (docs/coupling.md): undamped modes.

    python participant.py DECK CO_STEP_s FREQUENCY_Hz ...     and then, in DECK: liggghts-bonded -in deck.liggghts
"""

import os
import struct
import sys

import numpy as np

deck, co_step_s, omega = sys.argv[1], float(sys.argv[2]), 2 * np.pi * np.array(sys.argv[3:], float)
for name in ("to_plate", "from_plate"):
    os.mkfifo(f"{deck}/{name}")
(q, rate, force), past, ahead = np.zeros((3, len(omega))), 0, 0


def after(h, f):
    """Amplitude and rate a time h later, under a constant force."""
    c, s, rest = np.cos(omega * h), np.sin(omega * h), f / omega**2
    return rest + (q - rest) * c + rate / omega * s, rate * c - (q - rest) * omega * s


with open(f"{deck}/to_plate", "rb") as engine, open(f"{deck}/from_plate", "wb", buffering=0) as answer:
    step = 0
    while step != -1:
        step, now, following = struct.unpack("<qqq", engine.read(24))
        new = np.frombuffer(engine.read(8 * len(omega)))
        aim = np.zeros((2, len(omega)))
        if step >= 0:  # else the end, or a checkpoint, which this plate does not keep
            trend = 2 / (past + now) if 0 < now == ahead else 0.0
            slope = trend * (new - force)
            q, rate = after(now * co_step_s, new)
            force, past, ahead = new, now, following
            aim = np.array(after(ahead * co_step_s, force + slope * (now + ahead) / 2))
        answer.write(struct.pack("<qd", step, 1.0) + aim.tobytes())  # reach_m: any stone below 1 m may be touched
