"""Is the mass of large fragments Weibull's? `python -m benchmarks.fragment_sizes`, after benchmarks.fragments.

Fragments above a share of the stone's mass, of all packings of a rock and speed together: a two-parameter Weibull
distribution cut off below that share and a power law between it and 1, both by maximum likelihood. Prints the Weibull
shape, the probability of a larger Kolmogorov distance (by drawing from the fit), and the gain in log likelihood.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import minimize

DRAWS = 100


def log_likelihood(shape: float, scale: float, x: np.ndarray, least: float) -> float:
    return float(np.sum(np.log(shape / scale) + (shape - 1) * np.log(x / scale) - (x / scale) ** shape
                        + (least / scale) ** shape))


def fit(x: np.ndarray, least: float) -> tuple[float, float]:
    """Shape and scale."""
    def cost(logarithms: np.ndarray) -> float:
        shape, scale = np.exp(logarithms)
        return -log_likelihood(float(shape), float(scale), x, least)
    fits = [minimize(cost, np.log([start, x.mean()]), method="Nelder-Mead") for start in (0.5, 1.0, 2.0)]
    shape, scale = np.exp(min(fits, key=lambda found: found.fun).x)
    return float(shape), float(scale)


def distance(x: np.ndarray, shape: float, scale: float, least: float) -> float:
    """Kolmogorov's, of the sample from the fit."""
    below = 1 - np.exp((least / scale) ** shape - (np.sort(x) / scale) ** shape)
    n = len(x)
    return float(max((np.arange(1, n + 1) / n - below).max(), (below - np.arange(n) / n).max()))


def power_law(x: np.ndarray, least: float) -> float:
    """Largest log likelihood of x^-tau between `least` and 1."""
    tau = np.linspace(0.005, 5.0, 1000)
    tau = tau[np.abs(tau - 1) > 1e-6]
    return float((-tau * np.log(x).sum() - len(x) * np.log((1 - least ** (1 - tau)) / (1 - tau))).max())


def judged(x: np.ndarray, least: float) -> dict[str, float]:
    shape, scale = fit(x, least)
    found, draw, larger = distance(x, shape, scale, least), np.random.default_rng(0), 0
    for _ in range(DRAWS):
        drawn = scale * ((least / scale) ** shape - np.log(1 - draw.random(len(x)))) ** (1 / shape)
        larger += distance(drawn, *fit(drawn, least), least) >= found
    return {"fragments": len(x), "shape": shape, "scale": scale, "probability": larger / DRAWS,
            "gain": log_likelihood(shape, scale, x, least) - power_law(x, least)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, nargs="?", default=Path("runs/calibration/fragment_masses.csv"))
    parser.add_argument("--least", type=float, default=0.05, help="share of the stone's mass")
    args = parser.parse_args()
    masses = pd.read_csv(args.file)
    large = masses[masses["share"] >= args.least].groupby(["rock", "speed_m_s"], sort=False)["share"]
    rows = [{"rock": rock, "speed_m_s": speed, **judged(x.to_numpy(), args.least)}
            for (rock, speed), x in large if len(x) > 15]
    print(pd.DataFrame(rows).to_string(index=False, float_format=lambda x: f"{x:.2f}"))


if __name__ == "__main__":
    main()
