"""Cost and memory against the number of sub-spheres: `python -m benchmarks.growth`, into runs/bench/growth.csv.

One unbreakable stone in free flight, vibrating after its impact on the rigid plate; processor time of the engine less
that of its set-up, the least of the rounds. Beside it the law a N + b B that fits best, N sub-spheres and B bonds: a
smaller stone has more surface and fewer bonds a sub-sphere.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import nnls

from benchmarks.stone import SCENES
from dem.deck import write_deck
from dem.engine import ENGINE
from dem.run import Stages, prepare
from dem.scene import Scene
from plate_fem.tables import check, read_toml

COUNTS = (200, 500, 1000, 2000, 5000, 10000, 20000)
PARTICLE_STEPS = 4_000_000
ROUNDS = 3


def engine_usage(directory: Path, steps: int) -> tuple[float, float]:
    """Processor time in s and peak memory in MB of the deck in `directory` with `steps` steps."""
    deck = directory / "deck.liggghts"
    deck.write_text(re.sub(r"(?m)^run .*$", f"run {steps}", deck.read_text()))
    for name in ("ledger.bin", "forces.bin", "events.csv"):
        (directory / name).unlink(missing_ok=True)
    process = subprocess.Popen([str(ENGINE), "-in", deck.name], cwd=directory, stdout=subprocess.DEVNULL,
                               stdin=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise RuntimeError(f"the engine failed in {directory}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def linear_law_ns(bonds_per_subsphere: pd.Series, cost_ns: pd.Series) -> np.ndarray:
    """a + b B/N, neither negative, with the least relative errors."""
    terms = np.column_stack([np.ones(len(cost_ns)), bonds_per_subsphere])
    return terms @ nnls(terms / cost_ns.to_numpy()[:, None], np.ones(len(cost_ns)))[0]


def main() -> None:
    data = read_toml(SCENES / "single.toml")
    data["plate"] = read_toml(SCENES / "hertz_coal.toml")["plate"]
    del data["output"]
    data["time"]["idle_tolerance"] = 0.0  # the stone is to be computed while it flies
    rows = []
    for count in COUNTS:
        data["stones"]["agglomerate"] = {"subspheres": count, "unbreakable": True}
        model = prepare(check(Scene, data, "single.toml"), "single.toml", None, Stages())
        directory = Path(tempfile.mkdtemp())
        write_deck(directory / "deck", model.scene, model.assembly, model.step, None)
        steps = PARTICLE_STEPS // count
        used = [[engine_usage(directory / "deck", n) for n in (0, steps)] for _ in range(ROUNDS)]
        shutil.rmtree(directory)
        cost = min(run[0] - empty[0] for empty, run in used)
        rows.append({"subspheres": count, "bonds": model.assembly.n_bonds,
                     "ns_per_particle_step": 1e9 * cost / steps / count, "memory_MB": used[0][1][1]})
    table = pd.DataFrame(rows)
    table["law_ns"] = linear_law_ns(table["bonds"] / table["subspheres"], table["ns_per_particle_step"])
    table["off_law"] = table["ns_per_particle_step"] / table["law_ns"] - 1
    Path("runs/bench").mkdir(parents=True, exist_ok=True)
    table.to_csv("runs/bench/growth.csv", index=False)
    print(table.to_string(index=False, float_format=lambda x: f"{x:.4g}"))


if __name__ == "__main__":
    main()
