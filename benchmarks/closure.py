"""Energy ledger of stones that break on a rigid plate: `python -m benchmarks.closure [--out runs/closure]`.

202 stones of scenes/single.toml, 500 sub-spheres, friction as there, at restitutions of 0.9 and 1. Writes closure.csv, a
row a stone; what misses 1e-3 of the impact is run again with a quarter and a sixteenth of the time step.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from benchmarks.stone import strike

STONES = {"coal": ((3.5, 4.5, 5.5, 6.5, 8.0), 16), "gangue": ((8.0, 10.0, 12.0), 7)}  # speeds in m/s, packings of each
RESTITUTIONS = (0.9, 1.0)
FIRST_SEED = 50011
DURATION_s = 9e-4
GOAL = 1e-3
SHORTER = (4, 16)


def closure(material: str, speed_m_s: float, restitution: float, seed: int, shorter: int = 1,
            step_s: float = 0.0) -> dict:
    """One stone; `step_s` is the default time step where `shorter` is not 1."""
    friction = 0.45 if material == "gangue" else 0.4
    changes = {"stones.seed": seed, "stones.speed_m_s": speed_m_s,
               f"contacts.{material}_plate": {"restitution": restitution, "friction": friction}}
    if shorter > 1:
        changes["time.time_step_s"] = step_s / shorter
    found = strike(material, changes, DURATION_s)
    energy = found["energy"]
    return {"material": material, "speed_m_s": speed_m_s, "restitution": restitution, "seed": seed, "shorter": shorter,
            "step_s": found["dt_s"], "broken_bonds": found["n_bonds_broken"], "closure": energy["closure"],
            "unexplained": energy["contacts_unexplained_J"] / energy["impact_J"]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("runs/closure"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for material, (speeds, packings) in STONES.items():
        for k in range(packings):
            rows += [closure(material, speed, restitution, FIRST_SEED + 10 * k)
                     for speed in speeds for restitution in RESTITUTIONS]
            pd.DataFrame(rows).to_csv(args.out / "closure.csv", index=False)
    table = pd.DataFrame(rows)
    again = [closure(row["material"], row["speed_m_s"], row["restitution"], row["seed"], shorter, row["step_s"])
             for row in rows if abs(row["closure"]) > GOAL for shorter in SHORTER]
    pd.concat([table, pd.DataFrame(again)]).to_csv(args.out / "closure.csv", index=False)
    size = table.assign(size=table["closure"].abs()).groupby(["material", "speed_m_s", "restitution"])["size"]
    print(size.agg(["count", "median", "max"]).to_string(float_format=lambda x: f"{x:.2g}"))
    print(table["closure"].abs().describe().to_string(), "\nbroken:", (table["broken_bonds"] > 0).sum())
    print(pd.DataFrame(again).to_string())


if __name__ == "__main__":
    main()
