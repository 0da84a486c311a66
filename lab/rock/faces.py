"""How hard stones that are no spheres hit a rigid plate, against an elastic solid of finite elements and closed forms.

Unbreakable coal at 0.5 m/s: a cube of 40 mm that lands on a face, turned by small angles about one axis of it or two, on
an edge and on a corner, and a disc of 50 x 25 mm that lands flat. Peak forces are means over 5 us; a contact lasts while
its force is above a twentieth of the peak. A cube that lands aslant is followed over the first 200 us.

Closed forms of the face: a pressure wave in the solid, F = rho c_p A v; an elastic bar, F = rho c A v for 2 L/c, c =
sqrt(E/rho); and a rigid punch on a half-space, k = 2 E* a, F = v sqrt(m k), with a of the circle of the face's area.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import meshio
import numpy as np
import pandas as pd
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from common.hertz import contact_modulus_Pa
from common.scene.scene import Scene, changed_scene
from dem.run.run import run_scene
from lab.rock.elastic_solid import Rock, block, disc, hit as solid_hit
from lab.rock.stone import RIGID, SCENES
from lab.study import Row

SPEED_m_s, SIDE_m, DISC_m, HIGH_m = 0.5, 0.04, 0.05, 0.025
ELEMENTS = 20       # of the solid along its longest edge
ROW_s, MEAN_s = 1e-6, 5e-6
APPROACH_s = 6e-4   # at most, from the start to the first touch
SIDES = 64          # of the disc's mesh


@dataclass(frozen=True)
class Hit:
    """A solid, which way is up in it when it lands, and how long it is followed from its first touch on."""

    solid: str
    up: tuple[float, float, float]
    followed_s: float = 2e-4


HITS = {"face": Hit("cube", (0, 0, 1)), "disc": Hit("disc", (0, 0, 1)),
        "2 mrad": Hit("cube", (0.002, 0, 1)), "4 mrad": Hit("cube", (0.004, 0, 1)),
        "10 mrad": Hit("cube", (0.01, 0, 1)), "100 mrad": Hit("cube", (0.1, 0, 1)),
        "2 mrad, both": Hit("cube", (0.0015, 0.0015, 1)), "4 mrad, both": Hit("cube", (0.003, 0.003, 1)),
        "14 mrad, both": Hit("cube", (0.01, 0.01, 1)), "edge": Hit("cube", (1, 0, 1), 6e-4),
        "corner": Hit("cube", (1, 1, 1), 6e-4)}


def write_mesh(solid: str, file: Path) -> None:
    """The surface of the cube or the disc."""
    if solid == "cube":
        points = SIDE_m * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    else:
        turn = 2 * np.pi * np.arange(SIDES) / SIDES
        ring = DISC_m / 2 * np.column_stack([np.cos(turn), np.sin(turn)])
        points = np.vstack([np.column_stack([ring, np.full(SIDES, z)]) for z in (0.0, HIGH_m)])
    meshio.write_points_cells(file, points, [("triangle", ConvexHull(points).simplices)])


def scene_of(how: str, contact: str, subspheres: int, seed: int, mesh: Path, places_m: tuple[float, ...] = (0.0,)) -> Scene:
    """One unbreakable stone at each place without gravity or friction, restitution 1."""
    hit = HITS[how]
    volume = SIDE_m**3 if hit.solid == "cube" else np.pi / 4 * DISC_m**2 * HIGH_m
    up = np.array(hit.up) / np.linalg.norm(hit.up)
    turn = Rotation.align_vectors([[0, 0, 1]], [up])[0]
    one = {"material": "coal", "radius_m": (volume * 3 / 4 / np.pi) ** (1 / 3), "shape": "solid",
           "velocity_m_s": SPEED_m_s, "attitude": np.roll(turn.as_quat(), 1).tolist()}
    elastic = {"restitution": 1.0, "friction": 0.0}
    return changed_scene(SCENES / "single.toml", {
        **{f"stones.{key}": None for key in ("count", "radius_m", "positions_m", "speed_m_s", "gangue_order",
                                             "gangue_ratio")},
        "stones.each": [one | {"place_m": [x, 0.0]} for x in places_m], "stones.seed": seed, "shapes.solid": str(mesh), "assumptions": None, "time.view_interval_s": None,
        "stones.agglomerate": {"subspheres": subspheres, "unbreakable": True, "contact": contact},
        "time.gravity_m_s2": 0.0, "time.duration_s": hit.followed_s + APPROACH_s, "time.sample_interval_s": 30 * ROW_s,
        "plate": RIGID,
        "contacts": dict.fromkeys(("coal_plate", "coal_coal"), elastic)})


def figures(time_s: np.ndarray, force_N: np.ndarray, momentum: float, followed_s: float) -> dict[str, float]:
    """Peak, duration and impulse of a hit from its first touch on; `momentum` is that of the stone, N s."""
    step = time_s[1] - time_s[0]
    first = np.flatnonzero(force_N > 0)[0]
    force = force_N[first:first + round(followed_s / step)]
    width = max(1, round(MEAN_s / step))
    peak = float(np.convolve(force, np.ones(width) / width).max())
    return {"peak_N": peak, "lasts_us": float(1e6 * step * (force > 0.05 * peak).sum()),
            "impulse": float(force.sum() * step / momentum)}


def stone_hit(how: str, contact: str, subspheres: int, seed: int) -> dict[str, float]:
    """Of one packing, with the closure of its ledger."""
    with tempfile.TemporaryDirectory() as work:
        mesh = Path(work) / "solid.stl"
        write_mesh(HITS[how].solid, mesh)
        summary = run_scene(scene_of(how, contact, subspheres, seed, mesh), how, Path(work) / "run")
        fast = pd.read_parquet(Path(work) / "run" / "fast.parquet", columns=["t_s", "force_N"])
    momentum = 2 * summary["energy"]["impact_J"] / SPEED_m_s
    return figures(fast["t_s"].to_numpy(), fast["force_N"].to_numpy(), momentum, HITS[how].followed_s) | {
        "closure": summary["energy"]["closure"]}


def elastic_hit(how: str) -> dict[str, float]:
    """Of the elastic solid."""
    hit, coal = HITS[how], material()
    edge = (SIDE_m if hit.solid == "cube" else DISC_m) / ELEMENTS
    cells = block((ELEMENTS,) * 3) if hit.solid == "cube" else disc(ELEMENTS, round(HIGH_m / edge))
    up = np.array(hit.up) / np.linalg.norm(hit.up)
    time, force = solid_hit(coal, edge, cells, up, SPEED_m_s, hit.followed_s + 5e-5)
    return figures(time, force, coal.density_kg_m3 * cells.sum() * edge**3 * SPEED_m_s, hit.followed_s)


def material() -> Rock:
    """Coal of scenes/single.toml."""
    coal = changed_scene(SCENES / "single.toml", {}).materials["coal"]
    return Rock(coal.youngs_modulus_Pa, coal.poisson_ratio, coal.density_kg_m3)


def closed_forms() -> dict[str, tuple[float, float]]:
    """Peak force in N, and duration in us where there is one, of the cube's face."""
    coal, area = material(), SIDE_m**2
    bar_m_s = float(np.sqrt(coal.youngs_modulus_Pa / coal.density_kg_m3))
    scene = changed_scene(SCENES / "hertz_coal.toml", {})
    modulus = contact_modulus_Pa(scene.materials["coal"], scene.plate)
    impulse = coal.density_kg_m3 * area * SPEED_m_s
    punch_N = SPEED_m_s * np.sqrt(coal.density_kg_m3 * SIDE_m**3 * 2 * modulus * np.sqrt(area / np.pi))
    return {"pressure wave": (impulse * coal.pressure_wave_m_s, np.nan),
            "elastic bar": (impulse * bar_m_s, 2e6 * SIDE_m / bar_m_s), "rigid punch": (float(punch_N), np.nan)}


def faces(out: Path, packings: int = 4, counts: tuple[int, ...] = (200, 800)) -> Iterator[Row]:
    """Closed forms of the face; then of each hit the elastic solid, and stones with each contact."""
    for name, (peak_N, lasts_us) in closed_forms().items():
        yield Row({"hit": "face", "of": name, "subspheres": 0, "seed": 0},
                  partial(dict, peak_N=peak_N, lasts_us=lasts_us))
    for how in HITS:
        yield Row({"hit": how, "of": "elastic solid", "subspheres": 0, "seed": 0}, partial(elastic_hit, how))
        for contact in ("faces", "sub_spheres"):
            for count in counts:
                for seed in range(1, packings + 1):
                    yield Row({"hit": how, "of": contact, "subspheres": count, "seed": seed},
                              partial(stone_hit, how, contact, count, seed))


def faces_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
    """Mean and standard deviation over the packings, and the largest closure."""
    groups = rows.assign(closure=rows["closure"].abs()).groupby(["hit", "of", "subspheres"], sort=False)
    figures = groups[["peak_N", "lasts_us", "impulse"]]
    return figures.mean().join(figures.std(), rsuffix="_sd").assign(closure=groups["closure"].max()).reset_index()
