"""How hard a cube hits a rigid plate with a face, an edge and a corner, against what theory there is:
`python -m benchmarks.faces`.

Face: an elastic bar that hits a rigid wall, F = rho c A v for the time 2 L/c, c = sqrt(E/rho); and a rigid punch on the
plate's half-space, k = 2 E* a, F = v sqrt(m k), with a of the circle of the face's area. Corner: Hertz' sphere of the
radius of the sub-sphere at the corner with the mass of the cube. For an edge there is no closed form here.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pandas as pd
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from benchmarks.stone import SCENES
from common.hertz import contact_modulus_Pa, largest_approach_m, stiffness_N_m32
from common.scene import changed_scene
from common.scene_file import scene_tables
from dem.run.run import run_scene

SIDE_m, SPEED_m_s = 0.04, 0.5
TURNS = {"face": Rotation.identity(), "edge": Rotation.from_euler("x", 45, degrees=True),
         "corner": Rotation.align_vectors([[0, 0, -1]], [[-1, -1, -1]])[0]}


def hit(how: str, subspheres: int, work: Path) -> dict[str, Any]:
    """Peak force and duration of the hit of an unbreakable cube, and theory's."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    meshio.write_points_cells(work / "cube.stl", corners, [("triangle", ConvexHull(corners).simplices)])
    radius = SIDE_m * (3 / 4 / np.pi) ** (1 / 3)
    one = {"material": "coal", "radius_m": radius, "shape": "cube", "x_m": 0.0, "y_m": 0.0, "speed_m_s": SPEED_m_s,
           "attitude": np.roll(TURNS[how].as_quat(), 1).tolist()}
    elastic = {"restitution": 1.0, "friction": 0.0}
    scene = changed_scene(SCENES / "single.toml", {
        **{f"stones.{key}": None for key in ("count", "radius_m", "positions", "speed_m_s", "gangue_order",
                                             "gangue_ratio")},
        "stones.each": [one], "shapes.cube": {"file": str(work / "cube.stl")}, "assumptions": None, "output": None,
        "stones.agglomerate": {"subspheres": subspheres, "unbreakable": True}, "time.gravity_m_s2": 0.0,
        "time.duration_s": 6e-4, "plate": scene_tables(SCENES / "hertz_coal.toml")["plate"],
        "contacts": dict.fromkeys(("coal_plate", "coal_coal"), elastic)})
    run_scene(scene, f"{how} {subspheres}", work / f"{how}_{subspheres}")
    fast = pd.read_parquet(work / f"{how}_{subspheres}" / "fast.parquet")
    force, coal = fast["force_N"].to_numpy(), scene.materials["coal"]
    mass, area = coal.density_kg_m3 * SIDE_m**3, SIDE_m**2
    speed_of_sound = np.sqrt(coal.youngs_modulus_Pa / coal.density_kg_m3)
    modulus = contact_modulus_Pa(coal, scene.plate)
    small = SIDE_m * (0.56 / subspheres * 3 / 4 / np.pi) ** (1 / 3)  # of the mean sub-sphere, solid fraction 0.56
    stiffness = stiffness_N_m32(modulus, small)
    theory = {"face": coal.density_kg_m3 * speed_of_sound * area * SPEED_m_s, "edge": np.nan,
              "corner": stiffness * largest_approach_m(stiffness, mass, SPEED_m_s) ** 1.5}
    return {"hit": how, "subspheres": subspheres, "peak_N": force.max(), "theory_N": float(theory[how]),
            "punch_N": SPEED_m_s * np.sqrt(mass * 2 * modulus * np.sqrt(area / np.pi)) if how == "face" else np.nan,
            "duration_us": 1e6 * (force > 0.05 * force.max()).sum() * np.median(np.diff(fast["t_s"])),
            "bar_us": 2e6 * SIDE_m / speed_of_sound if how == "face" else np.nan}


def main() -> None:
    """Print a table."""
    with tempfile.TemporaryDirectory() as work:
        rows = [hit(how, count, Path(work)) for count in (200, 800) for how in TURNS]
    print(pd.DataFrame(rows).to_string(index=False, float_format="%.4g"))


if __name__ == "__main__":
    main()
