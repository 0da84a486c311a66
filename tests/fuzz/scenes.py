"""Valid scenes of every way of saying what falls, small enough that thousands of decks can be written."""

from pathlib import Path

from common.scene.file import scene_tables
from common.tables import read_toml

SCENES = Path(__file__).resolve().parents[2] / "scenes"
CUBE = "\n".join(["solid cube", *(  # twelve triangles, of which each side has two
    f"facet normal 0 0 0\nouter loop\n{corners}\nendloop\nendfacet" for corners in (
        "\n".join(f"vertex {k & 1} {k >> 1 & 1} {k >> 2 & 1}" for k in face) for face in (
            (0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
            (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5)))), "endsolid cube"])


def small_scene(name, plate):
    """Two stones of eight sub-spheres, or two spheres, on a rigid or a coarse flexible plate."""
    scene = scene_tables(SCENES / "single.toml")
    scene["time"] |= {"duration_s": 3e-4}
    scene["stones"] |= {"count": 2, "positions_m": [[0.1, 0.0], [-0.1, 0.0]],
                        "gangue_order": [1, 2], "gangue_ratio": 0.5}
    scene["contacts"] = {key: {"restitution": 0.5, "friction": 0.4} for key in (
        "coal_plate", "gangue_plate", "coal_coal", "coal_gangue", "gangue_gangue")}
    if name == "bonded":
        scene["stones"]["agglomerate"] |= {"subspheres": 8, "contact": "sub_spheres"}
    else:
        del scene["stones"]["agglomerate"]
    if plate == "rigid":
        scene["plate"] = read_toml(SCENES / "hertz_coal.toml")["plate"]
    else:
        scene["plate"] |= {"max_frequency_Hz": 1500.0, "theory": "kirchhoff"}
    scene["time"]["view_interval_s"] = 1.5e-4
    return scene


def falling(stones, name="bonded", plate="rigid", **tables):
    """The same with other stones on a tilted plate, and with shapes."""
    scene = small_scene(name, plate)
    made = {key: scene["stones"][key] for key in ("gap_m", "seed", "agglomerate") if key in scene["stones"]}
    scene["stones"] = made | stones
    scene["plate"] |= {"tilt_deg": 20.0, "yield_stress_Pa": 3e8}
    scene["materials"]["coal"] |= {"contact_strength_Pa": 1e8}
    return scene | tables


EACH = [{"material": "coal", "radius_m": 0.025, "place_m": [0.1, 0.0], "velocity_m_s": [0.5, 0.0, -2.0],
         "spin_rad_s": [0.0, 20.0, 0.0]},
        {"material": "gangue", "radius_m": 0.02, "place_m": [-0.1, 0.05], "velocity_m_s": 3.0, "arrival_s": 2e-4,
         "attitude": [1.0, 0.0, 0.0, 0.0]}]
DRAWN = {"size_m": [0.03, 0.05], "speed_m_s": [2.0, 4.0],
         "footprint_m": [[-0.2, 0.2], [-0.2, 0.2]], "spin_rad_s": 2.0}
STREAM = {"size_m": {"rosin_rammler_m": 0.04, "exponent": 2.0, "within": [0.02, 0.06]}, "drop_height_m": 0.45,
          "rate_1_s": 40.0, "arrival_s": [0.0, 0.1], "spin_rad_s": [0.0, 5.0]}
SHAPES = {"block": {"extent_ratios": [0.8, 0.7], "corners": 12}, "cube": "cube.stl"}
BASED = {"base": "hertz_coal.toml", "without": ["stones.gangue_order"], "name": "based", "assumptions": ["time.duration_s"],
         "time": {"duration_s": 3e-4, "time_step_s": 1e-7, "co_step": 5, "view_interval_s": 1.5e-4}, "materials": {"coal": "coal", "gangue": "gangue"},
         "stones": {"count": 3, "positions_m": 0.1, "gangue_ratio": 0.0,
                    "agglomerate": {"subspheres": 8, "contact": "sub_spheres", "unbreakable": True}},
         "scatter": {"seed": 3, "radius_factor": {"lognormal_cv": 0.1}, "density_factor": 1.1, "youngs_modulus_factor": [0.9, 1.1],
                     "strength_factor": {"lognormal_cv": 0.2}, "restitution": [0.6, 0.9], "speed_factor": {"lognormal_cv": 0.05},
                     "place_m": 0.02, "arrival_s": [0.0, 1e-3]},
         "contacts": {"coal_coal": {"restitution": 0.5, "friction": 0.6}, "coal_gangue": {"restitution": 0.5, "friction": 0.6},
                      "gangue_gangue": {"restitution": 0.5, "friction": 0.6}},
         "ranks": 2}
EDGES = {key: value for key, value in small_scene("sphere", "flexible")["plate"].items() if key not in ("rods", "theory")} | {
    "edges": "clamped", "mesh_size_m": 0.05}

VOLLEYS = {f"{name}-{plate}": small_scene(name, plate) for name in ("bonded", "sphere") for plate in ("rigid", "flexible")}
ALL = VOLLEYS | {
    "each": falling({"each": EACH}),
    "each-sphere-flexible": falling({"each": EACH}, "sphere", "flexible"),
    "edges": small_scene("sphere", "flexible") | {"plate": EDGES},
    "drawn": falling({"count": 4, "drawn": DRAWN | {"arrival_s": 0.0}, "gangue_ratio": 0.5}),
    "stream": falling({"drawn": STREAM, "gangue_ratio": 0.5}),
    "shapes": falling({"count": 2, "drawn": DRAWN | {"size_m": 0.04}, "gangue_ratio": 0.5}, shapes=SHAPES),
    "base": BASED,
}  # fmt: skip
ALL["shapes"]["stones"]["agglomerate"] |= {"subspheres": 60}  # fewer cannot have the inertia of their shape
# A stone that stands for a smooth sphere needs its compliance, of at least some hundred sub-spheres; fuzzed less often.
SMOOTH = falling({"each": EACH[1:]}, "bonded", "rigid")
SMOOTH["stones"]["agglomerate"] |= {"subspheres": 100, "contact": "smooth"}
