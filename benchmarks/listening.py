"""Streams of known truth, what `listen` makes of them, and a picture of the ratio over time.

    python -m benchmarks.listening [--forces runs/stone_forces] [--out runs/listening] [--seeds 2]

Streams are superpositions (recognition/stream/simulated.py) of the force histories that benchmarks/stone_forces.py left in
--forces. The law is fitted to one half of them, the streams are made of the other. Noise of 20 dB, 20 kHz, places unknown,
every frequency of the plate off by 1 % (normal). errors.csv has a row for each stream, ratio.png the ratio of one stream
whose mixing ratio rises from 20 to 80 %.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.stone_forces import histories_in
from recognition.plate.plate_model import PlateModel
from recognition.stream.forces import StoneForces
from recognition.stream.prior import StonePrior
from recognition.stream.recognise import RATE_Hz, recognise_stream
from recognition.stream.signatures import Channels
from recognition.stream.simulated import draw_stones, scattered, stream_of
from recognition.stream.stones import ratio_of, sliding_ratio

REACH_m, PAPER_m, SIZES_m, SPEEDS_m_s = 0.2, 0.025, (0.015, 0.035), (2.0, 4.0)
ALL = Channels((0, 1, 2, 3))
#: Name, stones a second, stones, channels, all sizes?
CASES = [("20 a second", 20, 100, ALL, False), ("100 a second", 100, 100, ALL, False),
         ("200 a second", 200, 100, ALL, False), ("400 stones", 100, 400, ALL, False),
         ("all sizes", 100, 100, ALL, True)]


def halves(histories):
    """The law's and the streams', in turns of eight, which hold coal and gangue of all kinds."""
    return [[h for k, h in enumerate(histories) if k // 8 % 2 == half] for half in (0, 1)]


def one(plate, forces, histories, case, seed):
    _, rate_1_s, count, channels, all_sizes = case
    rng = np.random.default_rng([rate_1_s, count, seed])
    pool = [h for h in histories if all_sizes or h.radius_m == PAPER_m]
    truth = draw_stones(pool, count, rate_1_s, REACH_m, 0.5, rng)
    stream = stream_of(plate, channels, pool, truth, RATE_Hz, 20.0, rng)
    prior = StonePrior(forces, SIZES_m if all_sizes else (PAPER_m, PAPER_m), SPEEDS_m_s)
    began = time.process_time()
    found = recognise_stream(scattered(plate, 0.01, rng), channels, prior, stream.values)
    row = {"stones": count, "heard": len(found.stones), "cpu_s": time.process_time() - began,
           "length_s": stream.values.shape[1] / RATE_Hz, "refused": found.refused}
    gangue, mass = truth["gangue"].to_numpy(), truth["mass_kg"].to_numpy()
    for name, weight in (("number", np.ones(count)), ("mass", mass)):
        right = float(weight @ gangue / weight.sum())
        low, middle, high = ratio_of(found.stones, name == "mass")
        row |= {f"{name}_error": 100 * (middle - right), f"{name}_inside": low <= right <= high}
    return row


def picture(plate, forces, histories, out):
    from matplotlib.figure import Figure

    rng = np.random.default_rng(1)
    pool = [h for h in histories if h.radius_m == PAPER_m]
    parts = [draw_stones(pool, 100, 100.0, REACH_m, ratio, rng) for ratio in (0.2, 0.8)]
    parts[1][["t_s", "centre_s"]] += parts[0]["t_s"].iloc[-1]
    truth = pd.concat(parts, ignore_index=True)
    stream = stream_of(plate, ALL, pool, truth, RATE_Hz, 20.0, rng)
    prior = StonePrior(forces, (PAPER_m, PAPER_m), SPEEDS_m_s)
    found = recognise_stream(scattered(plate, 0.01, rng), ALL, prior, stream.values)
    end_s = stream.values.shape[1] / RATE_Hz
    heard = sliding_ratio(found.stones, 0.3, 0.02, end_s)
    right = sliding_ratio(truth.assign(gangue=truth["gangue"].astype(float), mass_coal_kg=truth["mass_kg"],
                                       mass_gangue_kg=truth["mass_kg"], mass_coal_sd_kg=0.0, mass_gangue_sd_kg=0.0),
                          0.3, 0.02, end_s)
    figure = Figure(figsize=(7, 3.2), layout="constrained")
    axes = figure.add_subplot(xlabel="time in s", ylabel="gangue in %", ylim=(0, 100))
    axes.fill_between(heard["t_s"], 100 * heard["low"], 100 * heard["high"], alpha=0.3, label="90 % interval")
    axes.plot(heard["t_s"], 100 * heard["ratio"], label="recognised")
    axes.plot(right["t_s"], 100 * right["ratio"], "k--", label="truth")
    axes.legend(title="stones of the last 0.3 s")
    figure.savefig(out / "ratio.png", dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--forces", type=Path, default=Path("runs/stone_forces"))
    parser.add_argument("--out", type=Path, default=Path("runs/listening"))
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--picture", action="store_true", help="only the picture")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    learnt, tested = halves(histories_in(options.forces))
    plate, forces = PlateModel.from_scene("scenes/single.toml", 20000.0), StoneForces.fit(learnt)
    picture(plate, forces, tested, options.out)
    if options.picture:
        return
    rows = []
    for case in CASES:
        for seed in range(options.seeds):
            rows.append({"case": case[0], "seed": seed, **one(plate, forces, tested, case, seed)})
            print(rows[-1], flush=True)
            pd.DataFrame(rows).to_csv(options.out / "errors.csv", index=False)


if __name__ == "__main__":
    main()
