"""Each breaking criterion on the same stone: `python -m benchmarks.criteria`, into runs/bench/criteria.csv."""

from pathlib import Path

import pandas as pd

from benchmarks.stone import strike

NEVER_Pa = 1e30
CASES = {
    "tension and shear, Mohr-Coulomb": {},
    "tension and shear, constant": {"friction_angle_deg": 0.0},
    "tension alone": {"shear_strength_Pa": NEVER_Pa},
    "shear alone, Mohr-Coulomb": {"tensile_strength_Pa": NEVER_Pa},
    "shear alone, constant": {"tensile_strength_Pa": NEVER_Pa, "friction_angle_deg": 0.0},
    "none": {"tensile_strength_Pa": NEVER_Pa, "shear_strength_Pa": NEVER_Pa},
}


def main() -> None:
    rows = []
    for name, change in CASES.items():
        summary = strike("coal", {f"materials.coal.bond.{key}": value for key, value in change.items()})
        rows.append({"criterion": name, "broken_bonds": summary["n_bonds_broken"],
                     "broken_area_cm2": 1e4 * summary["broken_area_m2"], "peak_force_N": summary["peak_force_N"],
                     "rebound_m_s": summary["rebound_speed_m_s"][0], "closure": summary["energy"]["closure"]})
    table = pd.DataFrame(rows)
    Path("runs/bench").mkdir(parents=True, exist_ok=True)
    table.to_csv("runs/bench/criteria.csv", index=False)
    print(table.to_string(index=False, float_format=lambda x: f"{x:.4g}"))


if __name__ == "__main__":
    main()
