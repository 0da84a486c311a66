"""Small decks for tests of the engine alone: sub-spheres, bonds, and whatever lines the test needs."""

import os
import subprocess
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dem.coupling.launch import ENGINE
from dem.run.energy_balance import read_ledger
from lab.rock.dump import read_dump

DENSITY = 2000.0
FREE_FLIGHT = "free_flight"  # style of the fix for bodies in free flight


@dataclass
class Body:
    """n sub-spheres with m bonds: `center_m` (n, 3), `radius_m` (n,), `pair` (m, 2) 0-based, `bond_radius_m` (m,)."""

    center_m: np.ndarray
    radius_m: np.ndarray
    pair: np.ndarray
    bond_radius_m: np.ndarray

    @property
    def mass_kg(self):
        return DENSITY * 4 / 3 * np.pi * self.radius_m**3


def chain(n, spacing=2e-3, radius=0.9e-3):
    """A straight row of n sub-spheres along x."""
    center = np.column_stack([spacing * np.arange(n), np.zeros(n), np.zeros(n)])
    pair = np.column_stack([np.arange(n - 1), np.arange(1, n)])
    return Body(center, np.full(n, radius), pair, np.full(n - 1, spacing / 2))


def write_files(directory, body):
    n = len(body.radius_m)
    low, high = body.center_m.min(0) - 0.02, body.center_m.max(0) + 0.02
    box = "".join(f"{a} {b} {c}lo {c}hi\n" for a, b, c in zip(low, high, "xyz"))
    rows = "".join(f"{k + 1} 1 {2 * body.radius_m[k]:.17g} {DENSITY} " + " ".join(f"{x:.17g}" for x in c) + "\n"
                   for k, c in enumerate(body.center_m))
    (directory / "atoms.data").write_text(f"test\n\n{n} atoms\n2 atom types\n\n{box}\nAtoms\n\n{rows}")
    (directory / "agglomerates.txt").write_text(f"{n}\n")
    vector = body.center_m[body.pair[:, 1]] - body.center_m[body.pair[:, 0]]
    (directory / "bonds.txt").write_text("".join(
        f"{i + 1} {j + 1} 1 " + " ".join(f"{x:.17g}" for x in (*v, r, 1.0)) + "\n"
        for (i, j), v, r in zip(body.pair, vector, body.bond_radius_m)))


def fcc_ball(layers, radius=1e-3):
    """Touching spheres of an fcc lattice inside a ball of `layers` radii."""
    span = np.arange(-layers, layers + 1)
    grid = np.array(np.meshgrid(span, span, span)).reshape(3, -1).T
    center = grid[grid.sum(axis=1) % 2 == 0] * radius * np.sqrt(2)
    center = center[np.linalg.norm(center, axis=1) <= layers * radius]
    pair = cKDTree(center).query_pairs(2.001 * radius, output_type="ndarray")
    pair = np.sort(pair, axis=1)
    pair = pair[np.lexsort(pair.T[::-1])]
    return Body(center, np.full(len(center), 0.97 * radius), pair, np.full(len(pair), radius))


HEAD = """atom_style granular
atom_modify map array sort 0 0
boundary m m m
newton off
communicate single vel yes
units si
hard_particles yes
"""
MATERIAL = """neighbor 0.0002 bin
neigh_modify delay 0
fix youngs all property/global youngsModulus peratomtype 5e9 2e11
fix poisson all property/global poissonsRatio peratomtype 0.25 0.3
fix restitution all property/global coefficientRestitution peratomtypepair 2 0.9 0.9 0.9 0.9
fix friction all property/global coefficientFriction peratomtypepair 2 0.5 0.5 0.5 0.5
pair_style gran model hertz tangential history
pair_coeff * *
"""


def bond_line(modulus=5e9, ratio=2.0, tension=1e30, shear=1e30, tan_friction=0.0, damping_time=0.0, kernel="auto",
              dilatation=(), fracture=0.0):
    of_volume = "".join(f" {number}" for number in ("dilatation", *dilatation)) if dilatation else ""
    of_crack = f" fracture {fracture}" if fracture else ""
    return (f"fix bonds all bond/parallel bonds bonds.txt agglomerates agglomerates.txt events events.csv "
            f"damping_time {damping_time} kernel {kernel} material {modulus} {ratio} {tension} {shear} {tan_friction}{of_volume}{of_crack}\n")


def deck(dt, steps, every, lines="", bonds=None, velocity=""):
    return (HEAD + "read_data atoms.data\n" + MATERIAL + f"timestep {float(dt)!r}\n"
            f"fix ledger all ledger agglomerates agglomerates.txt every {every} file ledger.bin\n"
            "group unheld type > 0\n"
            "fix motion unheld nve/sphere\n" + (bonds or "") + lines + velocity +
            f"dump view all custom {every} view.dump id {DUMPED}\n"
            f'dump_modify view format "%d{DUMP_NUMBERS}" first yes\n'
            f"run {steps}\n")


def run_engine(directory, text, ranks=1):
    """Run a deck; returns what it printed. Fails the test if the engine fails."""
    (directory / "deck.liggghts").write_text(text)
    command = [str(ENGINE), "-in", "deck.liggghts"]
    if ranks > 1:
        command = ["mpirun", "--oversubscribe", "-np", str(ranks), *command]
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True, errors="replace",
                          stdin=subprocess.DEVNULL, timeout=300, check=False,
                          env=os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"})
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


@dataclass
class Frames:
    """`step` (k,) and, each (k, n, 3): position, velocity, spin, force, torque. `mass` (k, n)."""

    step: np.ndarray
    x: np.ndarray
    v: np.ndarray
    omega: np.ndarray
    force: np.ndarray
    torque: np.ndarray
    mass: np.ndarray
    radius: np.ndarray


DUMP_NUMBERS = 17 * " %.17g"
DUMPED = "x y z vx vy vz omegax omegay omegaz fx fy fz tqx tqy tqz mass radius"


def frames(directory):
    read = list(read_dump(directory / "view.dump"))
    data = np.array([f[:, 1:] for _, f in read])
    vectors = [data[:, :, 3 * k:3 * k + 3] for k in range(5)]
    return Frames(np.array([s for s, _ in read]), *vectors, data[:, :, 15], data[:, :, 16])


def ledger(directory):
    return read_ledger(directory / "ledger.bin", 1)
