"""Cost and memory against the number of sub-spheres: `python -m benchmarks.growth`, into runs/bench/growth.csv.

One unbreakable stone in free flight, vibrating after its impact on the rigid plate; LIGGGHTS' own time for the steps,
the least of the rounds, on a machine that has nothing else to do. Beside it the law a N + b B that fits best, N
sub-spheres and B bonds: a smaller stone has more surface and fewer bonds a sub-sphere.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import nnls

from benchmarks.stone import SCENES
from common.scene import Scene
from common.scene_file import scene_tables
from common.tables import check
from dem.coupling.launch import ENGINE
from dem.deck.render import write_deck
from dem.run.prepare import PreparedRun, prepare

COUNTS = (200, 500, 1000, 2000, 5000, 10000, 20000)
PARTICLE_STEPS = 2_000_000
ROUNDS = 15


def engine_run(directory: Path, steps: int) -> tuple[float, float]:
    """LIGGGHTS' own time for `steps` steps of the deck in `directory` in s, and the engine's peak memory in MB."""
    deck = directory / "deck.liggghts"
    deck.write_text(re.sub(r"(?m)^run .*$", f"run {steps}", deck.read_text()))
    for name in ("ledger.bin", "forces.bin", "events.csv"):
        (directory / name).unlink(missing_ok=True)
    with open(directory / "engine.out", "wb") as out:
        process = subprocess.Popen([str(ENGINE), "-in", deck.name], cwd=directory, stdout=out, stdin=subprocess.DEVNULL)
    # Asked while it runs: what the kernel counts at the end includes the Python process that it was forked from.
    peak_kB = 0
    while process.poll() is None:
        found = re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{process.pid}/status").read_text())
        peak_kB = max(peak_kB, int(found[1]) if found else 0)
        time.sleep(0.02)
    if process.returncode:
        raise RuntimeError(f"the engine failed in {directory}")
    loop = re.findall(r"Loop time of (\S+) on", (directory / "engine.out").read_text(errors="replace"))
    return float(loop[-1]), peak_kB / 1024


def linear_law_ns(bonds_per_subsphere: pd.Series, cost_ns: pd.Series) -> np.ndarray:
    """a + b B/N, neither negative, with the least relative errors."""
    terms = np.column_stack([np.ones(len(cost_ns)), bonds_per_subsphere])
    return terms @ nnls(terms / cost_ns.to_numpy()[:, None], np.ones(len(cost_ns)))[0]


def write_case(directory: Path, data: dict, count: int) -> PreparedRun:
    """The deck of one stone of `count` sub-spheres in `directory`."""
    data["stones"]["agglomerate"] = {"subspheres": count, "unbreakable": True}
    model = prepare(check(Scene, data, "single.toml"), "single.toml", None)
    write_deck(directory, model.scene, model.assembly, model.step, None)
    return model


def measure(directory: Path, count: int) -> tuple[float, float]:
    """ns a particle-step, peak memory in MB."""
    steps = PARTICLE_STEPS // count
    loop_s, memory_MB = engine_run(directory, steps)
    return 1e9 * loop_s / steps / count, memory_MB


def main() -> None:
    data = scene_tables(SCENES / "single.toml")
    data["plate"] = scene_tables(SCENES / "hertz_coal.toml")["plate"]
    del data["output"]
    data["time"]["free_flight_tolerance"] = 0.0  # the stone is to be computed while it flies
    with tempfile.TemporaryDirectory() as scratch:
        models = {count: write_case(Path(scratch) / str(count), data, count) for count in COUNTS}
        # In turn, so that whatever else the machine does in between meets every size.
        used = [{count: measure(Path(scratch) / str(count), count) for count in COUNTS} for _ in range(ROUNDS)]
    rows = []
    for count in COUNTS:
        cost = min(of[count][0] for of in used)
        rows.append({"subspheres": count, "bonds": models[count].assembly.n_bonds, "ns_per_particle_step": cost,
                     "memory_MB": used[0][count][1]})
    table = pd.DataFrame(rows)
    table["law_ns"] = linear_law_ns(table["bonds"] / table["subspheres"], table["ns_per_particle_step"])
    table["off_law"] = table["ns_per_particle_step"] / table["law_ns"] - 1
    Path("runs/bench").mkdir(parents=True, exist_ok=True)
    table.to_csv("runs/bench/growth.csv", index=False)
    print(table.to_string(index=False, float_format=lambda x: f"{x:.4g}"))


if __name__ == "__main__":
    main()
