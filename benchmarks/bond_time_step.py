"""What the time step does to an impact, beside the scatter of packings: `python -m benchmarks.bond_time_step`.

Writes runs/bench/bond_time_step.csv: step over t0, and mean and standard deviation over the seeds.
"""

from pathlib import Path

import pandas as pd

import dem.deck.time_step
from benchmarks.stone import SEEDS, strike

FRACTIONS = (0.05, 0.1, 0.2, 0.3, 0.36)


def main() -> None:
    rows = []
    default, share = dem.deck.time_step.BOND_FRACTION, dem.deck.time_step.DAMPED_SHARE
    dem.deck.time_step.DAMPED_SHARE = 9.0  # the largest step tried is beyond it
    for fraction in FRACTIONS:
        dem.deck.time_step.BOND_FRACTION = fraction
        for seed in SEEDS:
            s = strike("coal", {"stones.seed": seed})
            rows.append({"step_over_t0": s["dt_s"] / s["bond_time_s"], "aimed": fraction,
                         "broken_bonds": s["n_bonds_broken"], "broken_area_cm2": 1e4 * s["broken_area_m2"],
                         "peak_force_N": s["peak_force_N"], "rebound_m_s": s["rebound_speed_m_s"][0],
                         "closure": abs(s["energy"]["by_agglomerate"][0]["closure"])})
    dem.deck.time_step.BOND_FRACTION, dem.deck.time_step.DAMPED_SHARE = default, share
    table = pd.DataFrame(rows).groupby("aimed").agg(["mean", "std"])
    Path("runs/bench").mkdir(parents=True, exist_ok=True)
    table.to_csv("runs/bench/bond_time_step.csv")
    print(table.to_string(float_format=lambda x: f"{x:.4g}"))


if __name__ == "__main__":
    main()
