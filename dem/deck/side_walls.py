"""The walls on the edges of the plate: what the deck says of them, and the forces on them that the engine wrote
(dem/engine/wall/fix_wall_side.h)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from common.files.parquet import Columns
from common.scene.scene import Scene
from dem.deck.time_step import TimeStep

AXES = "xyz"


def deck_walls(scene: Scene) -> list[dict[str, Any]]:
    """Name, file of forces and box of each wall."""
    return [{"name": f"wall_{edge}", "file": _file(edge), "box_m": box}
            for edge, box in scene.plate.wall_boxes_m.items()]


def wall_files(scene: Scene) -> list[str]:
    """Files in the deck's directory with the forces on the walls."""
    return [wall["file"] for wall in deck_walls(scene)]


def read_walls(scene: Scene, deck: Path, step: TimeStep) -> Columns | None:
    """The mean forces on the walls at each row of the fast stream at which something pushed on one: t_s, at the end of
    the row, wall, force_x_N, force_y_N, force_z_N in the frame of the plate. None without walls."""
    walls = list(scene.plate.wall_height_m)
    if not walls:
        return None
    row = np.dtype([("step", "<i8"), ("force", "<f8", (3,))])
    of_walls = [np.fromfile(deck / _file(edge), row) for edge in walls]
    rows, edges = np.concatenate(of_walls), np.repeat(walls, [len(one) for one in of_walls])
    t_s = rows["step"] * step.dt_s
    order = np.argsort(t_s, kind="stable")
    return {"t_s": t_s[order], "wall": edges[order],
            **{f"force_{axis}_N": rows["force"][order, k] for k, axis in enumerate(AXES)}}


def wall_impulse_N_s(scene: Scene, walls: Columns, step: TimeStep) -> dict[str, list[float]]:
    """Impulse (x, y, z) on each wall, from what `read_walls` gave."""
    row_s = step.fast_steps * step.dt_s
    forces = [f"force_{axis}_N" for axis in AXES]
    return {edge: [float(walls[name][walls["wall"] == edge].sum() * row_s) for name in forces]
            for edge in scene.plate.wall_height_m}


def _file(edge: str) -> str:
    return f"wall_{edge}.bin"
