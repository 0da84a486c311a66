"""What the soft contact of stones with stones does to the plate: `python -m benchmarks.stone_pairs`.

Streams of unbreakable coal stones of 200 sub-spheres fall on the plate of scenes/stream.toml, once as they are and once
with 5.8 times the modulus of rock, at which two stones that meet head on have 0.96 of Hertz' peak force
(`benchmarks.two_stones --stiffer`). The plate's smooth contact and the bonds keep theirs. Writes stone_pairs.csv, a row a
stream.
"""

from __future__ import annotations

import argparse
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd

import dem.deck.render
from benchmarks.stone import SCENES
from common.scene import Scene, changed_scene
from dem.run.run import run_scene

STIFFER = 5.8
RATES_1_s = (50.0, 200.0, 400.0)
BEGIN_s, LATER_s = 0.02, 0.1
FOUND = ["impulse_N_s", "rms_a_m_s2", "peak_a_m_s2", "peak_force_N", "first_force_rms_N", "arrived"]


def stiffer_rock(render: Any, factor: float) -> Any:
    """A `render` whose rock is `factor` times as stiff where LIGGGHTS' own contacts read it."""
    def changed(*given: Any) -> str:
        def raised(line: re.Match) -> str:
            *rocks, plate = line[2].split()
            return " ".join([line[1], *(repr(factor * float(modulus)) for modulus in rocks), plate])
        text, count = re.subn(r"^(fix youngs +all property/global youngsModulus peratomtype)(.*)$", raised, render(*given),
                              flags=re.MULTILINE)
        if count != 1:
            raise RuntimeError("the deck has no line with the moduli")
        return text
    return changed


def stream(rate_1_s: float, stones: int, seed: int) -> Scene:
    """Coal stones of scenes/stream.toml until 0.1 s after the last came."""
    return changed_scene(SCENES / "stream.toml", {
        "time.duration_s": BEGIN_s + stones / rate_1_s + LATER_s, "stones.seed": seed, "stones.gangue_ratio": 0.0,
        "stones.agglomerate.unbreakable": True, "stones.stream.rate_1_s": rate_1_s, "stones.stream.begin_s": BEGIN_s,
        "stones.stream.duration_s": stones / rate_1_s, "stones.stream.least_fragment": None,
        "plate.max_frequency_Hz": 8000.0, "output": None})


def fall(rate_1_s: float, stones: int, seed: int, factor: float) -> dict[str, float]:
    """One stream; its row of the table."""
    directory = Path(tempfile.mkdtemp())
    try:
        with patch.object(dem.deck.render, "render", stiffer_rock(dem.deck.render.render, factor)):
            summary = run_scene(stream(rate_1_s, stones, seed), "stream.toml", directory / "run")
        fast = pd.read_parquet(directory / "run" / "fast.parquet", columns=["t_s", "force_N", "a_m_s2"])
        table = pd.read_parquet(directory / "run" / "stones.parquet")
    finally:
        shutil.rmtree(directory)
    first = table["first_contact_s"].min()
    beginning = fast[(fast["t_s"] >= first) & (fast["t_s"] < first + 10 / rate_1_s)]  # of about ten stones
    return {"rate_1_s": rate_1_s, "seed": seed, "stiffer": factor, "stones": len(table),
            "impulse_N_s": summary["impulse_N_s"], "rms_a_m_s2": float(np.sqrt((fast["a_m_s2"] ** 2).mean())),
            "peak_a_m_s2": float(fast["a_m_s2"].abs().max()), "peak_force_N": summary["peak_force_N"],
            "first_force_rms_N": float(np.sqrt((beginning["force_N"] ** 2).mean())),
            "arrived": int(table["first_contact_s"].notna().sum()), "closure": summary["energy"]["closure"]}


def report(rows: list[dict]) -> pd.DataFrame:
    """Of each rate and quantity: mean of the ratio stiffer over as it is with its standard error, and the standard
    deviation of the quantity over the seeds, as a share."""
    found = []
    for rate, table in pd.DataFrame(rows).groupby("rate_1_s"):
        soft, stiff = (table[table["stiffer"] == factor].set_index("seed")[FOUND] for factor in sorted(table["stiffer"].unique()))
        ratio = stiff / soft
        found.append(pd.DataFrame({"rate_1_s": rate, "ratio": ratio.mean(), "error": ratio.sem(),
                                   "spread": soft.std() / soft.mean()}))
    return pd.concat(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rates", type=float, nargs="+", default=list(RATES_1_s))
    parser.add_argument("--stones", type=int, default=30)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--out", type=Path, default=Path("runs/contact"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    rows: list[dict] = []
    for seed in range(1, args.seeds + 1):
        rows += [fall(rate, args.stones, seed, factor) for rate in args.rates for factor in (1.0, STIFFER)]
        pd.DataFrame(rows).to_csv(args.out / "stone_pairs.csv", index=False)
    print(report(rows).to_string(float_format=lambda x: f"{x:.3f}"))


if __name__ == "__main__":
    main()
