"""What a run keeps of its plate's motion: modes and modal amplitudes at its samples, from which follows every place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile

import numpy as np

from common.files.whole import written_whole
from common.tables import InputError
from plate_fem.modes import PlateModes
from plate_fem.motion import ModalMotion

FILE = "modes.npz"
LEFT_OUT = ("surface_stress", "lateral")  # large, and no part of the motion upwards
KINDS = {"u_m": "displacement", "v_m_s": "velocity", "a_m_s2": "acceleration"}


@dataclass(frozen=True)
class RecordedMotion:
    """amplitude, rate, force (k, n) of n modes at times t_s (k,): modal amplitude, its rate and the modal force."""

    modes: PlateModes
    t_s: np.ndarray
    amplitude: np.ndarray
    rate: np.ndarray
    force: np.ndarray

    def write(self, file: Path) -> None:
        """Write with single precision, packed a little, as quickly as it can be."""
        of_modes = {f"modes_{one.name}": getattr(self.modes, one.name) for one in fields(PlateModes)
                    if one.name not in LEFT_OUT}
        kept: dict[str, Any] = {"t_s": self.t_s, "amplitude": self.amplitude, "rate": self.rate, "force": self.force}
        kept = {name: np.asarray(value, _smaller(value)) for name, value in {**kept, **of_modes}.items()}
        with written_whole(file) as beside, ZipFile(beside, "w", ZIP_DEFLATED, compresslevel=1) as packed:
            for name, value in kept.items():
                with packed.open(f"{name}.npy", "w", force_zip64=True) as stream:
                    np.lib.format.write_array(stream, value)

    @classmethod
    def read(cls, directory: str | Path) -> RecordedMotion:
        """Of a run directory. Raises InputError."""
        file = Path(directory) / FILE
        try:
            with np.load(file, allow_pickle=False) as kept:
                values = {name: kept[name] for name in kept.files}
            of_modes: dict[str, Any] = {name.removeprefix("modes_"): values.pop(name)[()] for name in tuple(values)
                                        if name.startswith("modes_")}
            return cls(PlateModes(surface_stress=np.empty(0), **of_modes), **values)
        except FileNotFoundError:
            raise InputError(f"{file}: no such file; needs the directory of a run with a flexible plate") from None
        except (OSError, ValueError, KeyError, TypeError, BadZipFile) as error:
            raise InputError(f"{file}: not what a run writes ({' '.join(str(error).split())})") from None

    def at(self, points_m: Sequence[Sequence[float]]) -> dict[str, np.ndarray]:
        """Vertical displacement u_m, velocity v_m_s and acceleration a_m_s2 (k, points), upwards, at points (x, y) of
        the plate. Raises InputError for another point."""
        for x_m, y_m in points_m:
            for name, value, lines in (("x", x_m, self.modes.lines_x_m), ("y", y_m, self.modes.lines_y_m)):
                if not lines[0] - 1e-9 <= value <= lines[-1] + 1e-9:
                    raise InputError(f"{name} = {value:g}: must lie on the plate, from {lines[0]:g} to {lines[-1]:g} m")
        shape = self.modes.shape_at(np.asarray(points_m, float)).T
        amplitude, rate, force = (np.asarray(one, float) for one in (self.amplitude, self.rate, self.force))
        acceleration = ModalMotion(self.modes, 1.0).acceleration_at(amplitude, rate, force)
        return dict(zip(KINDS, (amplitude @ shape, rate @ shape, acceleration @ shape), strict=True))


def _smaller(value: Any) -> Any:
    """Single precision for all numbers but the lines of the mesh."""
    return np.float32 if isinstance(value, np.ndarray) and value.ndim > 1 else None
