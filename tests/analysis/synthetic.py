"""Synthetic run directories: ten Hertz-like pulses on a plate of three damped modes.

They keep the contract of a run directory without any simulation, so that analysis
and recognition can be tested where there is no LIGGGHTS.
"""

import json
import math

import numpy as np
import pandas as pd
from scipy.signal import lsim

FAST_DT_S = 1e-5
DT_S = 1.5e-4
PEAK_N = {"coal": 2812.0, "gangue": 5045.0}
BROKEN_BONDS = {"coal": 90, "gangue": 12}
# mass kg, frequency Hz, damping ratio, share of the centre of mass
MODES = ((25.0, 280.0, 0.01, 1.0), (25.0, 900.0, 0.01, 0.3), (25.0, 2200.0, 0.01, 0.1))

SCENE = {
    "name": "paper",
    "stones": {
        "count": 10,
        "radius_m": 0.025,
        "positions_m": [[0.1 * math.cos(k * math.pi / 5), 0.1 * math.sin(k * math.pi / 5)] for k in range(10)],
        "speed_m_s": 3.0,
        "gangue_order": [2, 10, 5, 7, 3, 9, 4, 8, 1, 6],
    },
    "materials": {
        "coal": {"density_kg_m3": 1380.0, "youngs_modulus_Pa": 5.12e9, "poisson_ratio": 0.3},
        "gangue": {"density_kg_m3": 2400.0, "youngs_modulus_Pa": 9.966e9, "poisson_ratio": 0.28},
    },
    "contacts": {"coal_plate": {"restitution": 0.5}, "gangue_plate": {"restitution": 0.5}},
    "plate": {
        "size_m": [0.5, 0.5],
        "thickness_m": 0.02,
        "density_kg_m3": 7830.0,
        "youngs_modulus_Pa": 2.07e11,
        "poisson_ratio": 0.3,
        "rods": [
            {"place_m": [x, y], "diameter_m": 0.02, "length_m": 0.1,
             "youngs_modulus_Pa": 2.07e11, "density_kg_m3": 7830.0}
            for x in (0.2, -0.2) for y in (0.2, -0.2)
        ],
    },
}  # fmt: skip


def materials(gangue_ratio, count=10):
    gangue = set(SCENE["stones"]["gangue_order"][: round(gangue_ratio * count)])
    return ["gangue" if place in gangue else "coal" for place in range(1, count + 1)]


def _forces(names, rng, scatter):
    t_s = np.arange(4001) * FAST_DT_S
    forces = np.zeros((len(names), t_s.size))
    for row, name in zip(forces, names, strict=True):
        peak = PEAK_N[name] * (1 + scatter * rng.standard_normal())
        again_s = (0.012 if name == "gangue" else 0.010) + 2e-3 * rng.random()
        for start_s, share in ((1e-4, 1.0), (again_s, 0.15)):
            phase = (t_s - start_s) / 2.4e-4
            inside = (phase > 0) & (phase < 1)
            row[inside] += share * peak * np.sin(np.pi * phase[inside]) ** 1.5
    return t_s, forces


def signals(gangue_ratio, seed=1, scatter=0.0):
    """Table of the fast stream, 4001 rows."""
    rng = np.random.default_rng(seed)
    names = materials(gangue_ratio)
    t_s, forces = _forces(names, rng, scatter)
    total_N = forces.sum(axis=0)
    u, v, a, kinetic, internal = (np.zeros(t_s.size) for _ in range(5))
    for mass, frequency, damping, share in MODES:
        omega = 2 * np.pi * frequency
        system = (
            [[0, 1], [-(omega**2), -2 * damping * omega]],
            [[0], [1 / mass]],
            np.eye(2),
            np.zeros((2, 1)),
        )
        q, rate = lsim(system, -total_N, t_s)[1].T
        u += share * q
        v += share * rate
        a += share * (-total_N / mass - 2 * damping * omega * rate - omega**2 * q)
        kinetic += 0.5 * mass * rate**2
        internal += 0.5 * mass * omega**2 * q**2
    table = {"t_s": t_s, "u_m": u, "v_m_s": v, "a_m_s2": a, "kinetic_J": kinetic, "internal_J": internal}
    table |= {"total_J": kinetic + internal, "force_N": total_N}
    table |= {f"force_{i:02d}_N": row for i, row in enumerate(forces, 1)}
    table |= {f"acc_{name}_m_s2": gain * a for name, gain in (("A", 1.1), ("B", 0.9), ("C", 1.0), ("D", 0.8))}
    table |= {f"rod_{i}_N": 0.25 * total_N + 1e6 * u for i in range(1, 5)}
    return pd.DataFrame(table)


def lattice():
    """A small "stone": sub-spheres on a cubic lattice of 10 mm, bonded to their nearest neighbours."""
    steps = np.arange(-2, 3)
    grid = 0.01 * np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    centre = grid[np.linalg.norm(grid, axis=1) <= 0.025]
    apart = np.linalg.norm(centre[:, None] - centre[None, :], axis=2)
    first, second = np.nonzero(np.triu(np.abs(apart - 0.01) < 1e-6))
    return centre, first, second


def write_deck(directory, count):
    centre, first, second = lattice()
    angle = 2 * np.pi * np.arange(count) / count
    places = np.column_stack([0.1 * np.cos(angle), 0.1 * np.sin(angle), np.full(count, 0.025)])
    atoms = (places[:, None] + centre[None, :]).reshape(-1, 3)
    bonds = [np.column_stack([first, second]) + 1 + k * len(centre) for k in range(count)]
    directory.mkdir()
    head = f"synthetic\n\n{len(atoms)} atoms\n2 atom types\n\nAtoms\n\n"
    rows = [f"{i} 1 0.00975 1500 {x:.9g} {y:.9g} {z:.9g}\n" for i, (x, y, z) in enumerate(atoms, 1)]
    (directory / "atoms.data").write_text(head + "".join(rows))
    np.savetxt(directory / "agglomerates.txt", np.full(count, len(centre)), fmt="%d")
    np.savetxt(directory / "bonds.txt", np.vstack(bonds), fmt="%d")


def breakage(names, rng):
    """The lowest bonds of each stone break, one after another, from 0.15 ms on."""
    centre, first, second = lattice()
    lowest = np.argsort(centre[first, 2] + centre[second, 2], kind="stable")
    rows = []
    for number, name in enumerate(names, 1):
        for k in range(BROKEN_BONDS[name]):
            bond = lowest[k]
            x, y, z = 0.5 * (centre[first[bond]] + centre[second[bond]])
            mode = "tension" if rng.random() < 0.7 else "shear"
            when = 1.5e-4 + 1e-6 * k if k % 10 else 0.015 + 1e-6 * k  # every tenth in the second collision
            rows.append((when, bond + 1 + (number - 1) * len(first), number, x, y, z, mode, 2e6, 1e-4, 3e-6))
    names = ["t_s", "bond", "agglomerate", "x_m", "y_m", "z_m", "mode", "stress_Pa", "energy_J", "area_m2"]
    return pd.DataFrame(rows, columns=names).sort_values("t_s", ignore_index=True)


def write_run(directory, gangue_ratio, seed=1, scatter=0.0):
    directory.mkdir(parents=True)
    names = materials(gangue_ratio)
    fast = signals(gangue_ratio, seed, scatter)
    slow = fast.iloc[::15].reset_index(drop=True)
    broken = breakage(names, np.random.default_rng(seed))
    info = {
        "status": "finished",
        "scene": SCENE,
        "assumptions": ["plate.thickness_m: the paper's Figure 11 is not at hand"],
        "gangue_ratio": gangue_ratio,
        "materials": names,
        "n_particles": 10 * len(lattice()[0]),
        "n_bonds": 10 * len(lattice()[1]),
        "n_bonds_broken": len(broken),
        "n_bonds_broken_by_agglomerate": [BROKEN_BONDS[name] for name in names],
        "peak_force_N": float(fast["force_N"].max()),
        "energy": {"plate": float(slow["total_J"].iloc[-1])},
        "wall_time_s": {"dem": 60.0, "plate": 5.0},
        "versions": {"liggghts": "3.8.0"},
        "seeds": {"packing": 10007},
    }
    write_deck(directory / "deck", len(names))
    (directory / "run.json").write_text(json.dumps(info))
    slow.to_parquet(directory / "signals.parquet")
    fast.to_parquet(directory / "fast.parquet")
    broken.to_parquet(directory / "breakage.parquet")
    return directory


def write_sweep(directory, ratios=None, seed=1, scatter=0.0):
    for ratio in np.arange(11) / 10 if ratios is None else ratios:
        write_run(
            directory / f"ratio_{round(100 * ratio):03d}", float(ratio), seed + round(100 * ratio), scatter
        )
    return directory
