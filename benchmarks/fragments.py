"""What becomes of a stone against the speed of its impact on a rigid plate: `python -m benchmarks.fragments`.

Rocks are those of scenes/materials. Writes fragments.csv, a row a run, and fragment_masses.csv, a row a fragment, into
runs/calibration, and docs/pictures/fragments.png.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.stone import Stone, strike
from common.tables import read_toml

ROCKS = {"coal": "coal", "hard_coal": "coal", "gangue": "gangue"}  # of scenes/materials, with the material they stand for
SPEEDS_m_s = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
FIRST_SEED = 40011
DURATION_s = 9e-4
LEAST_SUBSPHERES = 3       # of a fragment that the exponent counts: below, it is the resolution that shows
LARGEST_SHARE = 0.1        # of the stone's mass, likewise: above, there are too few


def impact(rock: str, speed_m_s: float, subspheres: int, seed: int) -> dict[str, Any]:
    """The summary of one run."""
    material = ROCKS[rock]
    bond = read_toml(Path("scenes/materials") / f"{rock}.toml")["bond"]
    return strike(material, {"stones.agglomerate.subspheres": subspheres, "stones.seed": seed,
                             "stones.speed_m_s": speed_m_s,
                             **{f"materials.{material}.bond.{key}": value for key, value in bond.items()}}, DURATION_s)


def mass_exponent(shares: np.ndarray, subspheres: int) -> float:
    """Of a number of fragments n(m) ~ m^-tau, by maximum likelihood between both bounds (Newman 2005, Contemp. Phys.
    46:323, with an upper bound)."""
    low, high = LEAST_SUBSPHERES / subspheres, LARGEST_SHARE
    inside = shares[(shares >= low) & (shares <= high)]
    if len(inside) < 20:
        return np.nan
    taus = np.linspace(1.001, 4.0, 600)
    norm = (low ** (1 - taus) - high ** (1 - taus)) / (taus - 1)
    return float(taus[np.argmax(-taus * np.log(inside).mean() - np.log(norm))])


def study(speeds: list[float], subspheres: int, packings: int) -> tuple[pd.DataFrame, dict[tuple[str, float], Stone],
                                                                       pd.DataFrame]:
    """A row a run; of each rock and speed the last stone; a row a fragment."""
    rows, stones, masses = [], {}, []
    for rock in ROCKS:
        for speed in speeds:
            runs = [impact(rock, speed, subspheres, FIRST_SEED + 10 * k) for k in range(packings)]
            stones[rock, speed] = runs[-1]["stone"]
            masses += [pd.DataFrame({"rock": rock, "speed_m_s": speed, "packing": k, "share": run["fragments"]})
                       for k, run in enumerate(runs)]
            tau = mass_exponent(np.concatenate([run["fragments"] for run in runs]), subspheres)
            rows += [{"rock": rock, "speed_m_s": speed, "packing": k, "broken_bonds": run["n_bonds_broken"],
                      "broken_area_cm2": 1e4 * run["broken_area_m2"], "largest_fragment": run["largest_fragment"],
                      "fragments": len(run["fragments"]), "hoop": run["hoop"], "mass_exponent": tau,
                      "released_mJ": 1e3 * run["energy"]["released_by_breakage_J"],
                      "closure": run["energy"]["closure"]} for k, run in enumerate(runs)]
            print(pd.DataFrame(rows[-packings:]).mean(numeric_only=True).to_frame(rock).T.to_string(
                header=len(rows) == packings, float_format=lambda x: f"{x:.3g}"), flush=True)
    return pd.DataFrame(rows), stones, pd.concat(masses)


def draw(table: pd.DataFrame, stones: dict[tuple[str, float], Stone], masses: pd.DataFrame, file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 3, figsize=(12, 7.2), layout="constrained")
    for rock in ROCKS:
        mean = table[table["rock"] == rock].groupby("speed_m_s")[["broken_area_cm2", "largest_fragment"]].mean()
        axes[0, 0].plot(mean.index, mean["largest_fragment"], "o-", ms=4, label=rock)
        axes[0, 1].plot(mean.index, mean["broken_area_cm2"], "o-", ms=4)
        passing(axes[0, 2], masses[masses["rock"] == rock])
    axes[0, 0].set(xlabel="speed, m/s", ylabel="largest fragment over the stone", ylim=(0, 1.05))
    axes[0, 1].set(xlabel="speed, m/s", ylabel="broken area, cm2", yscale="symlog")
    axes[0, 2].set(xscale="log", yscale="log", xlabel="size of fragment over that of the stone",
                   ylabel="share of mass in smaller fragments", title="slopes 0.7 and 1 in grey", ylim=(3e-3, 1.2))
    axes[0, 0].legend()
    size = np.array([0.1, 1.0])
    for slope in (0.7, 1.0):
        axes[0, 2].plot(size, size**slope, color="0.7", lw=1)
    for ax, rock in zip(axes[1], ROCKS):
        below(ax, stones, table, rock)
    figure.savefig(file, dpi=80)


def passing(ax: Any, masses: pd.DataFrame) -> None:
    """The cumulative curve at the largest speed."""
    mass = np.sort(masses.loc[masses["speed_m_s"] == masses["speed_m_s"].max(), "share"])
    ax.step(np.cbrt(mass), np.cumsum(mass) / mass.sum(), where="post")


def below(ax: Any, stones: dict[tuple[str, float], Stone], table: pd.DataFrame, rock: str) -> None:
    """The unbroken stone from above, the slice about its middle, a colour a fragment, at the least speed that leaves no
    fragment of nine tenths."""
    mean = table[table["rock"] == rock].groupby("speed_m_s")["largest_fragment"].mean()
    broken = mean.index[mean < 0.9]
    speed = broken[0] if len(broken) else mean.index[-1]
    stone = stones[rock, speed]
    slice_ = np.abs(stone.center_m[:, 2]) < 5e-3
    label = stone.fragment_of_sphere()
    order = np.argsort(np.argsort(-np.bincount(label, stone.volume)))[label]
    radius = 0.5 * np.cbrt(stone.volume)
    ax.scatter(*(1e3 * stone.center_m[slice_, :2].T), c=order[slice_] % 20, s=(3.2e3 * radius[slice_]) ** 2, cmap="tab20",
               vmin=0, vmax=19, edgecolors="none")
    ax.set(aspect="equal", title=f"{rock}, {speed:g} m/s: slice across the impact", xlabel="mm", ylabel="mm")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--subspheres", type=int, default=1000)
    parser.add_argument("--packings", type=int, default=3)
    parser.add_argument("--speeds", type=float, nargs="+", default=list(SPEEDS_m_s))
    parser.add_argument("--out", type=Path, default=Path("runs/calibration"))
    parser.add_argument("--picture", type=Path, default=Path("docs/pictures/fragments.png"))
    options = parser.parse_args()
    table, stones, masses = study(options.speeds, options.subspheres, options.packings)
    options.out.mkdir(parents=True, exist_ok=True)
    table.to_csv(options.out / "fragments.csv", index=False)
    masses.to_csv(options.out / "fragment_masses.csv", index=False)
    draw(table, stones, masses, options.picture)


if __name__ == "__main__":
    main()
