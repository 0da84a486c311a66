"""Two equal unbreakable stones that meet head on, beside Hertz' elastic spheres: stones touch stones by sub-spheres.

Peak force and contact time over those of Hertz, and rebound over approach speed.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from common import hertz
from common.scene.scene import Scene, changed_scene
from dem.coupling.launch import ENGINE
from dem.deck.render import write_deck
from dem.record.energy_balance import StoneLedger, read_ledger
from dem.run.prepare import prepare
from dem.stones.assembly import Assembly
from lab.rock.stone import PAIRS, RIGID, SCENES
from lab.study import Row

GAP = 1e-3  # of the radius, between the stones at the start


def meet(subspheres: int, seed: int, speed_m_s: float) -> dict[str, float]:
    """One pair: packing `seed` below and the next above it, far from the plate, each at half the speed."""
    scene = changed_scene(SCENES / "single.toml", {
        "time.gravity_m_s2": 0.0, "time.duration_s": 8e-4, "time.sample_interval_s": 3e-5, "output": None,
        "time.free_flight_tolerance": 0.0, "stones.speed_m_s": speed_m_s / 2, "stones.count": 2,
        "stones.gangue_order": [1, 2], "stones.seed": seed,
        "stones.positions": [{"x_m": -0.1, "y_m": 0.0}, {"x_m": 0.1, "y_m": 0.0}],
        "stones.agglomerate": {"subspheres": subspheres, "unbreakable": True, "contact": "sub_spheres"},
        "plate": RIGID,
        **{f"contacts.{pair}": {"restitution": 1.0, "friction": 0.0} for pair in PAIRS}})
    directory = Path(tempfile.mkdtemp())
    try:
        prepared = prepare(scene, "two_stones", directory)
        write_deck(directory / "deck", prepared.scene, _stacked(prepared.assembly), prepared.step, prepared.modes)
        _run_towards_each_other(directory / "deck", prepared.assembly.sizes[0], speed_m_s)
        rows = read_ledger(directory / "deck" / "ledger.bin", 2)
    finally:
        shutil.rmtree(directory)
    return _shares_of_hertz(rows, prepared.step.dt_s, scene, prepared.assembly, speed_m_s)


def _stacked(assembly: Assembly) -> Assembly:
    """The second stone right above the first, and both far above the plate."""
    radius_m = assembly.stones[0].radius_m
    center, second = assembly.center_m.copy(), assembly.agglomerate == 1
    center[:, 0] += np.where(second, -0.1, 0.1)
    center[:, 2] += np.where(second, (2 + GAP) * radius_m, 0) + radius_m
    return replace(assembly, center_m=center)


def _run_towards_each_other(deck: Path, subspheres: int, speed_m_s: float) -> None:
    text = (deck / "deck.liggghts").read_text()
    start = next(line for line in text.splitlines() if line.startswith("velocity"))
    half = speed_m_s / 2
    towards = (f"group lower id <= {subspheres}\ngroup upper id > {subspheres}\n"
               f"velocity lower set 0 0 {half} units box\nvelocity upper set 0 0 {-half} units box")
    (deck / "deck.liggghts").write_text(text.replace(start, towards))
    done = subprocess.run([str(ENGINE), "-in", "deck.liggghts"], cwd=deck, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stdout[-500:] + done.stderr[-500:])


def _shares_of_hertz(rows: StoneLedger, dt_s: float, scene: Scene, assembly: Assembly,
                     speed_m_s: float) -> dict[str, float]:
    """Two equal spheres: half the mass, half the radius, twice the compliance of one."""
    coal, momentum = scene.materials["coal"], rows.column["momentum_z_kg_m_s"][:, 1]
    stiffness = hertz.stiffness_N_m32(hertz.contact_modulus_Pa(coal, coal), assembly.stones[0].radius_m / 2)
    depth = hertz.largest_approach_m(stiffness, assembly.mass_kg.sum() / 4, speed_m_s)
    time = rows.step * dt_s
    force = np.diff(momentum) / np.diff(time)
    pressing = np.flatnonzero(force > 1e-3 * force.max())
    return {"force": force.max() / (stiffness * depth**1.5),
            "time": (time[pressing[-1] + 1] - time[pressing[0]]) / hertz.contact_time_s(depth, speed_m_s),
            "rebound": momentum[-1] / -momentum[0]}


def two_stones(out: Path, packings: int = 4, counts: tuple[int, ...] = (200, 500, 1000), speed: float = 3.0) -> Iterator[Row]:
    """Pairs of packings."""
    for count in counts:
        for seed in range(1, 2 * packings, 2):
            yield Row({"subspheres": count, "seed": seed}, partial(meet, count, seed, speed))


def two_stones_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Mean and standard deviation over the pairs."""
    groups = rows.groupby("subspheres")[["force", "time", "rebound"]]
    return groups.mean().join(groups.std(), rsuffix="_sd").assign(pairs=groups.size()).reset_index()
