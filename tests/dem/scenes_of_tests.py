"""Scenes that tests share, and closed forms for them."""

from pathlib import Path

import numpy as np

from common.scene.scene import Scene, changed_scene, read_scene
from common.tables import check
from dem.stones.arrangement import stones_of

SCENES = Path(__file__).resolve().parents[2] / "scenes"


def hertz(material):
    """Closed form of the impact of scenes/hertz_*.toml: stiffness N/m^1.5, depth, force, time."""
    scene = read_scene(SCENES / f"hertz_{material}.toml")
    stone, plate, radius = scene.materials[material], scene.plate, scene.stones.radius_m
    modulus = 1 / ((1 - stone.poisson_ratio**2) / stone.youngs_modulus_Pa
                   + (1 - plate.poisson_ratio**2) / plate.youngs_modulus_Pa)
    stiffness = 4 / 3 * np.sqrt(radius) * modulus
    mass = stone.density_kg_m3 * 4 / 3 * np.pi * radius**3
    depth = (5 * mass * scene.stones.speed_m_s**2 / (4 * stiffness)) ** 0.4
    return {"stiffness": stiffness, "mass_kg": mass, "depth_m": depth, "force_N": stiffness * depth**1.5,
            "modulus_Pa": modulus}


def changed(name, changes):
    """The scene of scenes/NAME.toml with dotted keys changed."""
    return changed_scene(SCENES / f"{name}.toml", changes)


def one_by_one(scene, **columns):
    """The scene with the stones of its volley given one by one, and so many of them with columns of their own."""
    volley, own = stones_of(scene, "scene"), [dict(zip(columns, values)) for values in zip(*columns.values())]
    each = [{"material": stone.material, "radius_m": stone.radius_m, "place_m": [stone.place_m[0], stone.place_m[1]],
             "velocity_m_s": scene.stones.speed_m_s} | values for stone, values in zip(volley, own, strict=True)]
    data = scene.model_dump(mode="json", exclude_none=True)
    data["stones"] = {key: data["stones"][key] for key in ("gap_m", "seed", "agglomerate") if key in data["stones"]} | {
        "each": each}
    return check(Scene, data, "scene")
