"""The contact of stones with the plate by their flat faces (docs/contact.md): stiffness of the columns behind them,
and the file that the engine reads them from.

A column of height h behind an area A of a face has the stiffness E A/h of a bar. The plate's half-space gives way under
the whole face, of radius a, as under a flat punch, by F/(2 E_p* a). Under an even pressure an area A has the share
A/(pi a^2) of F, so that its part of the plate has the stiffness 2 E_p* A/(pi a).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from common.scene.scene import Scene
from dem.stones.assembly import Assembly
from dem.stones.faces import FaceColumns
from dem.stones.substance import material_of

NUMBERS = 7  # of a column in a file


def column_stiffness_N_m(columns: FaceColumns, stone_modulus_Pa: float, plate_modulus_Pa: float) -> np.ndarray:
    """(k,) of columns in series with their share of the plate; E of the stone, E/(1 - nu^2) of the plate."""
    stone = columns.height_m / stone_modulus_Pa
    plate = np.pi * columns.face_radius_m / (2 * plate_modulus_Pa)
    return np.asarray(columns.area_m2 / (stone + plate))


def stone_columns_N_m(scene: Scene, assembly: Assembly, stone: int) -> np.ndarray:
    """(k,) stiffness of the columns of one stone; none where it has no faces."""
    columns = assembly.faces[stone] if assembly.faces else None
    if columns is None:
        return np.zeros(0)
    plate_modulus = scene.plate.youngs_modulus_Pa / (1 - scene.plate.poisson_ratio**2)
    modulus = material_of(scene, assembly.stones[stone].substance).youngs_modulus_Pa
    return column_stiffness_N_m(columns, modulus, plate_modulus)


def stiffest_face_N_m(scene: Scene, assembly: Assembly) -> float:
    """All columns of one face together, the stiffest of all stones; 0 where there are no faces."""
    stiffest = 0.0
    for k, columns in enumerate(assembly.faces):
        if columns is not None and len(columns.sub_sphere):
            _, face = np.unique(np.round(columns.normal, 6), axis=0, return_inverse=True)
            stiffest = max(stiffest, float(np.bincount(face.ravel(), stone_columns_N_m(scene, assembly, k)).max()))
    return stiffest


def face_rows(scene: Scene, assembly: Assembly, stone: int, first: int) -> np.ndarray:
    """(k, 7) rows of dem/engine/contact/face_columns.h; `first`: number, from 0, of the stone's first sub-sphere."""
    columns = assembly.faces[stone]
    if columns is None:
        return np.zeros((0, NUMBERS))
    return np.column_stack([first + columns.sub_sphere + 1, columns.normal, columns.height_m,
                            stone_columns_N_m(scene, assembly, stone), columns.area_m2])


def write_faces(file: Path, scene: Scene, assembly: Assembly) -> None:
    """Write the file that dem/engine/contact/face_columns.h describes."""
    start = np.cumsum([0, *assembly.sizes])
    outside = max(float((c.height_m - assembly.radius_m[start[k] + c.sub_sphere]).max(initial=0.0))
                  for k, c in enumerate(assembly.faces) if c is not None)
    with open(file, "w") as out:
        out.write(f"{outside!r}\n")
        if assembly.is_stream:  # each stone brings its own
            out.write("stream\n")
            return
        for k in range(len(assembly.faces)):
            np.savetxt(out, face_rows(scene, assembly, k, start[k]), fmt=["%d"] + ["%.17g"] * (NUMBERS - 1))
