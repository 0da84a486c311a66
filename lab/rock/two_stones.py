"""Two unbreakable stones that meet head on, beside Hertz' elastic spheres: stones touch each other as smooth spheres.

A case is two materials, two radii in mm, a speed in m/s and a number of sub-spheres, as coal_coal_25_25_2_500. Both stones
are turned at random. Peak force and contact time over those of Hertz, rebound over approach speed, and the speed sideways
after the impact over that before, without friction and with a restitution of 1.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from common import hertz
from common.scene.scene import Scene, changed_scene
from dem.coupling.launch import ENGINE
from dem.deck.render import write_deck
from dem.run.energy_balance import StoneLedger, read_ledger
from dem.run.prepare import PreparedRun, prepare
from dem.stones.assembly import Assembly
from lab.rock import faces
from lab.rock.dump import read_dump
from lab.rock.stone import PAIRS, RIGID, SCENES
from lab.study import Row

GAP = 1e-3       # of the radii, between the stones at the start
SAMPLES = 200    # of the contact time


@dataclass(frozen=True)
class Meeting:
    """One row of the table."""

    materials: tuple[str, str]
    radii_m: tuple[float, float]
    speed_m_s: float
    subspheres: int

    @classmethod
    def of(cls, name: str) -> Meeting:
        first, second, r1, r2, speed, subspheres = name.split("_")
        return cls((first, second), (float(r1) / 1e3, float(r2) / 1e3), float(speed), int(subspheres))

    def hertz(self, scene: Scene, masses_kg: np.ndarray) -> tuple[float, float]:
        """Peak force, N, and contact time, s, of the elastic spheres."""
        first, second = (scene.materials[name] for name in self.materials)
        r1, r2 = self.radii_m
        stiffness = hertz.stiffness_N_m32(hertz.contact_modulus_Pa(first, second), r1 * r2 / (r1 + r2))
        depth = hertz.largest_approach_m(stiffness, masses_kg.prod() / masses_kg.sum(), self.speed_m_s)
        return stiffness * depth**1.5, hertz.contact_time_s(depth, self.speed_m_s)


def scene_of(meeting: Meeting, seed: int, **changes: object) -> Scene:
    """Two stones side by side, each turned at random, for as long as their contact lasts and more."""
    volume = 4 / 3 * np.pi * np.array(meeting.radii_m) ** 3
    turned = Rotation.random(2, random_state=seed).as_quat()[:, [3, 0, 1, 2]].tolist()
    each = [{"material": name, "radius_m": radius, "place_m": [0.2 * k - 0.1, 0.0], "velocity_m_s": meeting.speed_m_s,
             "attitude": turned[k]}
            for k, (name, radius) in enumerate(zip(meeting.materials, meeting.radii_m))]
    contact = {f"contacts.{pair}": {"restitution": 1.0, "friction": 0.0} for pair in PAIRS}
    everything = {
        "time.gravity_m_s2": 0.0, "time.duration_s": 1e-3, "time.view_interval_s": None, "time.free_flight_tolerance": 0.0,
        **{f"stones.{key}": None for key in ("count", "gangue_order", "gangue_ratio", "positions_m", "radius_m", "speed_m_s")},
        "stones.each": each, "stones.seed": 2 * seed, "stones.agglomerate.subspheres": meeting.subspheres,
        "stones.agglomerate.unbreakable": True, "plate": RIGID, **contact}
    scene = changed_scene(SCENES / "single.toml", everything)
    time_s = meeting.hertz(scene, np.array([scene.materials[m].density_kg_m3 for m in meeting.materials]) * volume)[1]
    lasts_s = 1.6 * time_s + GAP * sum(meeting.radii_m) / meeting.speed_m_s
    return changed_scene(SCENES / "single.toml", everything | {
        "time.duration_s": lasts_s, "time.sample_interval_s": time_s / SAMPLES} | changes)


def meet(meeting: Meeting, seed: int, aside: float = 0.0, **changes: object) -> dict[str, float]:
    """One pair, `aside` (of the sum of the radii) beside each other's line; the second comes down on the first."""
    scene = scene_of(meeting, seed, **changes)
    directory = Path(tempfile.mkdtemp())
    try:
        prepared = write_meeting(directory, scene, meeting.speed_m_s, sum(meeting.radii_m), aside)
        run_engine(directory / "deck")
        rows, velocity = read_ledger(directory / "deck" / "ledger.bin", 2), velocities(directory / "deck", prepared)
    finally:
        shutil.rmtree(directory)
    return _shares_of_hertz(meeting, scene, prepared, rows, velocity)


def write_meeting(directory: Path, scene: Scene, speed_m_s: float, reach_m: float, aside: float) -> PreparedRun:
    """The deck in `directory`/deck, of stones that touch with their centres `reach_m` apart. Its view.dump has the stones
    at the start and the end."""
    prepared = prepare(scene, "two_stones", directory)
    prepared.assembly = _stacked(prepared.assembly, (1 + GAP) * reach_m, aside)
    deck = directory / "deck"
    write_deck(deck, prepared.scene, prepared.assembly, prepared.step, prepared.modes)
    text, count = (deck / "deck.liggghts").read_text(), prepared.assembly.sizes[0]
    start = next(line for line in text.splitlines() if line.startswith("velocity"))
    down = (f"group lower id <= {count}\ngroup upper id > {count}\n"
            f"velocity lower set 0 0 0 units box\nvelocity upper set 0 0 {-speed_m_s} units box\n"
            f"dump view all custom {prepared.step.steps} view.dump id x y z vx vy vz mass omegax omegay omegaz\n"
            f'dump_modify view format "%d{10 * " %.17g"}"')
    energy = 0.5 * prepared.assembly.mass_kg[count:].sum() * speed_m_s**2
    (deck / "deck.liggghts").write_text(re.sub(r"impact_J \S+", f"impact_J {float(energy)!r}", text).replace(start, down))
    return prepared


def run_engine(deck: Path) -> None:
    """Run a deck. Raises RuntimeError with what the engine said where it fails."""
    done = subprocess.run([str(ENGINE), "-in", "deck.liggghts"], cwd=deck, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stdout[-500:] + done.stderr[-500:])


def velocities(deck: Path, prepared: PreparedRun) -> np.ndarray:
    """(2, 3) of the stones at the end, m/s."""
    last, count = list(read_dump(deck / "view.dump"))[-1][1], prepared.assembly.sizes[0]
    return np.array([np.average(rows[:, 4:7], axis=0, weights=rows[:, 7]) for rows in (last[:count], last[count:])])


def _stacked(assembly: Assembly, reach: float, aside: float) -> Assembly:
    """The second stone above the first, and both far above the plate."""
    second, center = assembly.agglomerate == 1, assembly.center_m.copy()
    for k in range(2):
        center[assembly.agglomerate == k, 0] += 0.1 - 0.2 * k
    middle = [np.average(center[assembly.agglomerate == k], axis=0,
                         weights=assembly.mass_kg[assembly.agglomerate == k])[2] for k in range(2)]
    center[:, 2] += np.where(second, middle[0] - middle[1] + reach * np.sqrt(1 - aside**2), 0) + reach / 2
    center[second, 0] += aside * reach
    return replace(assembly, center_m=center)


def _shares_of_hertz(meeting: Meeting, scene: Scene, prepared: PreparedRun, rows: StoneLedger,
                     velocity: np.ndarray) -> dict[str, float]:
    assembly = prepared.assembly
    momentum, time = rows.column["momentum_z_kg_m_s"][:, 1], rows.step * prepared.step.dt_s
    force = np.diff(momentum) / np.diff(time)
    pressing = np.flatnonzero(force > 1e-3 * force.max())
    peak, lasts = meeting.hertz(scene, np.bincount(assembly.agglomerate, assembly.mass_kg))
    apart = velocity[1] - velocity[0]
    return {"force": force.max() / peak, "time": (time[pressing[-1] + 1] - time[pressing[0]]) / lasts,
            "rebound": apart[2] / meeting.speed_m_s, "sideways": float(np.hypot(*apart[:2])) / meeting.speed_m_s}


CASES = (*(f"coal_coal_25_25_2_{count}" for count in (200, 500, 1000)), "coal_coal_25_25_0.5_500", "coal_coal_25_25_6_500",
         "gangue_gangue_25_25_2_500", "coal_gangue_25_25_2_500", "coal_coal_25_12.5_2_500", "coal_gangue_50_12.5_2_500")


def two_stones(out: Path, packings: int = 24, cases: tuple[str, ...] = CASES) -> Iterator[Row]:
    """Pairs of packings and attitudes."""
    for name in cases:
        for seed in range(7001, 7001 + packings):
            yield Row({"case": name, "seed": seed}, partial(meet, Meeting.of(name), seed))


def two_stones_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Mean and standard deviation over the pairs, and the worst of what should be 1 or 0."""
    groups = rows.groupby("case", sort=False)
    table = pd.DataFrame([dict(zip(("first", "second", "r1_mm", "r2_mm", "speed_m_s", "subspheres"), str(name).split("_")))
                          for name in groups.groups])
    for key in ("force", "time"):
        table[key], table[f"{key}_sd"] = groups[key].mean().to_numpy(), groups[key].std().to_numpy()
    return table.assign(rebound=groups["rebound"].min().to_numpy(), sideways=groups["sideways"].max().to_numpy(),
                        pairs=groups.size().to_numpy())


def two_cubes(out: Path, packings: int = 4, counts: tuple[int, ...] = (200, 800)) -> Iterator[Row]:
    """Cubes that meet face on face, at twice the speed of one that meets its mirror image, the rigid plate: the elastic
    solid, and packings."""
    yield Row({"of": "elastic solid", "subspheres": 0, "seed": 0}, partial(faces.elastic_hit, "face"))
    for count in counts:
        for seed in range(7001, 7001 + 2 * packings, 2):
            yield Row({"of": "sub_spheres", "subspheres": count, "seed": seed}, partial(meet_cubes, count, seed))


def meet_cubes(subspheres: int, seed: int) -> dict[str, float]:
    """The second cube comes down on the first."""
    with tempfile.TemporaryDirectory() as work:
        mesh, speed = Path(work) / "solid.stl", 2 * faces.SPEED_m_s
        faces.write_mesh("cube", mesh)
        scene = faces.scene_of("face", "faces", subspheres, seed, mesh, (-0.1, 0.1))
        time = scene.time.model_copy(update={"sample_interval_s": faces.ROW_s, "free_flight_tolerance": 0.0})
        scene = scene.model_copy(update={"time": time})
        prepared = write_meeting(Path(work), scene, speed, faces.SIDE_m, 0.0)
        run_engine(Path(work) / "deck")
        rows = read_ledger(Path(work) / "deck" / "ledger.bin", 2)
    time_s, mass_kg = rows.step * prepared.step.dt_s, prepared.assembly.mass_kg[prepared.assembly.agglomerate == 1].sum()
    force_N = np.diff(rows.column["momentum_z_kg_m_s"][:, 1]) / np.diff(time_s)
    force_N[force_N < 1e-3 * force_N.max()] = 0.0
    return faces.figures(time_s[1:], force_N, mass_kg * speed, 2 * faces.HITS["face"].followed_s)


def two_cubes_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Over the solid's."""
    solid = rows.loc[rows["of"] == "elastic solid", ["peak_N", "lasts_us"]].iloc[0]
    table = rows.groupby(["of", "subspheres"], sort=False)["peak_N"].agg(["size", "mean", "std"]).reset_index()
    table = table.rename(columns={"size": "pairs", "mean": "peak_N", "std": "peak_N_sd"})
    return table.assign(force=table["peak_N"] / solid["peak_N"])
