"""Largest stable time step of bonds over t0 = min sqrt(m r0/(E A)).

Without damping 2/omega_max from the stiffness matrix, which the engine confirms (tests/dem/test_bond_parallel.py); with
damping by trial in the engine, an unbreakable stone that trembles, to 1 %.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.sparse import diags
from scipy.sparse.linalg import eigsh

from common.scene.file import scene_tables
from common.scene.scene import Scene
from common.tables import check
from dem.coupling.launch import ENGINE
from dem.deck.render import write_deck
from dem.record.energy_balance import read_ledger
from dem.run.prepare import prepare
from dem.stones.assembly import CONTACT_RADIUS_RATIO
from dem.stones.bonds import Bonds, bond_network, stiffness_matrix
from dem.stones.packing import Packing, pack_sphere
from lab.rock.fcc import fcc_sphere
from lab.rock.stone import RIGID, SCENES, SEEDS
from lab.study import Row

DAMPING = (0.0, 0.05, 0.1, 0.2)
COUNT = 500
STEPS = 4000


def highest_frequency_rad_s(bonds: Bonds, modulus_Pa: float, stiffness_ratio: float, mass_kg: np.ndarray,
                            radius_m: np.ndarray, volumetric_ratio: float = 0.0) -> float:
    """Of the network, sub-spheres with mass and radius (n,) and spin inertia 0.4 m R^2.

    The leapfrog scheme is stable below a time step of 2 over this frequency, where nothing damps.
    """
    inertia = np.column_stack([np.repeat(mass_kg[:, None], 3, axis=1),
                               np.repeat(0.4 * (mass_kg * radius_m**2)[:, None], 3, axis=1)]).ravel()
    scale = diags(1 / np.sqrt(inertia))
    matrix = stiffness_matrix(len(mass_kg), bonds, modulus_Pa, stiffness_ratio, volumetric_ratio)
    largest = eigsh(scale @ matrix @ scale, k=1, which="LA", tol=1e-6, return_eigenvectors=False,
                    v0=np.random.default_rng(1).normal(size=matrix.shape[0]))
    return float(np.sqrt(largest[0]))


def undamped_limit(packing: Packing, stiffness_ratio: float) -> float:
    """2/omega_max over t0; neither depends on modulus or density."""
    bonds = bond_network(packing)
    mass = packing.radius_m**3
    frequency = highest_frequency_rad_s(bonds, 1.0, stiffness_ratio, mass, CONTACT_RADIUS_RATIO * packing.radius_m)
    lighter = np.minimum(mass[bonds.first], mass[bonds.second])
    return 2 / frequency / np.sqrt(lighter * bonds.length_m / bonds.area_m2).min()


def tremble(count: int) -> str:
    """Deck lines with small random velocities and spins, which excite every mode."""
    v = np.random.default_rng(1).normal(size=(count, 6)) * ([1e-4] * 3 + [0.1] * 3)
    return "".join("set atom {} vx {!r} vy {!r} vz {!r} omegax {!r} omegay {!r} omegaz {!r}\n".format(k + 1, *row)
                   for k, row in enumerate(v.tolist()))


def is_stable(directory: Path, dt_s: float) -> bool:
    """Kinetic energy does not grow from the first quarter of the run on, and nothing is lost."""
    deck = directory / "deck.liggghts"
    text = re.sub(r"(?m)^timestep .*$", f"timestep {dt_s!r}", deck.read_text())
    text = re.sub(r"(?m)^run .*$", f"run {STEPS}", re.sub(r"ledger (.*) every \d+", rf"ledger \1 every {STEPS // 4}", text))
    text = re.sub(r"(?m)^fix monitor .*\n", "", text)  # which takes the stone to fall at the scene's speed
    deck.write_text(re.sub(r"(?m)^velocity .*\n", tremble(COUNT), text))
    for name in ("ledger.bin", "forces.bin", "events.csv"):
        (directory / name).unlink(missing_ok=True)
    done = subprocess.run([str(ENGINE), "-in", deck.name], cwd=directory, capture_output=True,
                          stdin=subprocess.DEVNULL, check=False)
    if done.returncode:
        return False
    kinetic = read_ledger(directory / "ledger.bin", 1).column["kinetic_J"][:, 0]
    return bool(kinetic[-1] < 2 * kinetic[0] and kinetic[0] < 1e-6)


def engine_limit(damping_ratio: float, seed: int) -> float:
    """The largest step over t0 that is_stable, by bisection."""
    data = scene_tables(SCENES / "single.toml")
    data["plate"] = RIGID
    del data["output"]
    data["stones"] |= {"agglomerate": {"subspheres": COUNT, "contact": "sub_spheres", "unbreakable": True,
                                       "damping_ratio": damping_ratio}, "gap_m": 0.05, "seed": seed}
    data["time"] |= {"gravity_m_s2": 0.0, "free_flight_tolerance": 0.0}
    model = prepare(check(Scene, data, "single.toml"), "single.toml", None)
    assert model.step.bond_time_s is not None  # the stone is bonded
    with tempfile.TemporaryDirectory() as work:
        directory = Path(work) / "deck"
        write_deck(directory, model.scene, model.assembly, model.step, None)
        low, high = 0.05, 0.8
        while high / low > 1.01:
            middle = float(np.sqrt(low * high))
            low, high = (middle, high) if is_stable(directory, middle * model.step.bond_time_s) else (low, middle)
    return low


def bond_limit(out: Path) -> Iterator[Row]:
    """Of the fcc agglomerate and of random packings, with the stiffness ratios of the benchmark and of coal."""
    coal = scene_tables(SCENES / "single.toml")["materials"]["coal"]["bond"]["stiffness_ratio"]

    def row(packing: str, seed: int, ratio: float, damping: float, trial: bool) -> Row:
        def limit() -> dict[str, float]:
            stone = fcc_sphere(0.025) if packing == "fcc" else pack_sphere(0.025, COUNT, seed)
            return {"step_over_t0": engine_limit(damping, seed) if trial else undamped_limit(stone, ratio)}
        return Row({"packing": packing, "stiffness_ratio": ratio, "method": "engine" if trial else "stiffness matrix",
                    "damping_ratio": damping, "seed": seed}, limit)

    for ratio in (2.17, coal):
        yield row("fcc", 0, ratio, 0.0, False)
        yield from (row("random", seed, ratio, 0.0, False) for seed in SEEDS)
    for damping in DAMPING:
        yield from (row("random", seed, coal, damping, True) for seed in SEEDS)


def bond_limit_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    keys = ["packing", "stiffness_ratio", "method", "damping_ratio"]
    found = rows.groupby(keys, sort=False)["step_over_t0"].agg(["min", "mean", "max", "count"])
    return found.reset_index()
