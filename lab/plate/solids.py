"""Plates on rods beside solids of finite elements (CalculiX, tests/plate_fem/solid.py): modes, sag, accelerations, rods.

Rods share the bricks of their disc. Both sides have their modes below `highest_Hz`, and 1 % of damping. A force of
sin^1.5 over 250 us acts at each place in turn; accelerations of the mid-plane at all places over 2 ms (norm of the
difference over the norm), and forces in the rods over 10 ms, are compared. `on_rod_percent` is of a push above a rod.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
from scipy.optimize import linear_sum_assignment

from common.files.whole import written_whole
from common.scene.plate import FlexiblePlate
from lab.study import Row
from plate_fem.modes import NOWHERE, PlateModes, plate_modes
from plate_fem.motion import ModalMotion
from plate_fem.solution.eigen import eigenmodes
from plate_fem.solution.model import PlateModel, build_model
from tests.plate_fem.solid import Found, Part, solved

OF_ROD = {"density_kg_m3": 7830.0, "youngs_modulus_Pa": 2.07e11}
STEEL = {**OF_ROD, "poisson_ratio": 0.3}
PULSE_s, INTERVAL_s, DAMPING = 250e-6, 2e-6, 0.01
FIRST = 25  # modes of the second pair of figures
COARSER = 2 / 3
ALIKE, NEAR = 0.5, 0.06  # two modes are one: squared cosine of their shapes at least, difference of frequency at most


@dataclass(frozen=True)
class Plate:
    """A plate on `rods` (x, y, diameter): on all of them, or on one and its images about two mirrors. At `places_m` are
    sensors and pushes, at the last one above the first rod."""

    side_m: tuple[float, float]
    thickness_m: float
    rods: tuple[tuple[float, float, float], ...]
    length_m: float
    highest_Hz: float
    cell_m: float
    places_m: tuple[tuple[float, float], ...]
    ribs: tuple[tuple[int, float, float, float], ...] = ()  # axis along which one runs, its place, width and height

    @property
    def symmetries(self) -> tuple[str, ...]:
        """Of the parts that are solved: the whole plate, or a quarter, "s" or "a" about x = 0 and y = 0."""
        return ("ss", "sa", "as", "aa") if len(self.rods) == 1 else ("--",)

    @property
    def images(self) -> list[tuple[int, int]]:
        return [(1, 1), (1, -1), (-1, 1), (-1, -1)][: len(self.symmetries)]

    def part(self, fine: float) -> Part:
        x_m, y_m = ((0.0 if len(self.rods) == 1 else -side / 2, side / 2) for side in self.side_m)
        return Part(x_m, y_m, self.thickness_m, self.rods, self.length_m, STEEL, self.cell_m, fine, self.ribs)

    def table(self) -> FlexiblePlate:
        rods = [{"place_m": [a * x, b * y], "diameter_m": diameter, "length_m": self.length_m, **OF_ROD}
                for x, y, diameter in self.rods for a, b in self.images]
        ribs = {along: [[at, *section] for axis, at_m, *section in self.ribs if "xy"[axis] == along
                        for at in sorted({at_m, at_m * self.images[-1][0]})] for along in "xy"}
        return FlexiblePlate.model_validate({
            "size_m": list(self.side_m), "thickness_m": self.thickness_m, "rods": rods, "ribs_m": ribs,
             "max_frequency_Hz": self.highest_Hz, "damping_ratio": DAMPING, **STEEL})


PLATES = {
    "thick": Plate((0.36, 0.28), 0.05, ((0.12, 0.08, 0.03),), 0.12, 9000.0, 0.03,
                   ((0.01, 0.02), (0.06, 0.03), (0.04, 0.11), (0.15, 0.02), (0.12, 0.08))),
    "slender": Plate((0.66, 0.12), 0.012, ((0.28, 0.035, 0.014),), 0.1, 4000.0, 0.02,
                     ((0.02, 0.01), (0.11, 0.03), (0.2, 0.015), (0.31, 0.005), (0.28, 0.035))),
    "thin": Plate((0.55, 0.42), 0.018, ((0.2, 0.15, 0.024),), 0.09, 4000.0, 0.03,
                  ((0.02, 0.03), (0.1, 0.08), (0.11, 0.17), (0.23, 0.04), (0.2, 0.15))),
    # held out
    "square": Plate((0.45, 0.45), 0.022, ((0.16, 0.13, 0.028),), 0.1, 5000.0, 0.03,
                    ((0.02, 0.03), (0.09, 0.07), (0.08, 0.18), (0.2, 0.03), (0.16, 0.13))),
    "three": Plate((0.5, 0.4), 0.02, ((-0.17, -0.11, 0.022), (0.15, -0.045, 0.028), (0.02, 0.125, 0.017)), 0.1, 4000.0,
                   0.03, ((0.03, 0.02), (-0.1, 0.06), (0.13, 0.14), (-0.2, 0.03), (-0.17, -0.11))),
    # with ribs
    "ribs": Plate((0.5, 0.5), 0.02, ((0.2, 0.2, 0.02),), 0.1, 4000.0, 0.025,
                  ((0.02, 0.03), (0.1, 0.07), (0.08, 0.15), (0.22, 0.04), (0.2, 0.2)), ((0, 0.1, 0.02, 0.04),)),
}


def solids(out: Path) -> Iterator[Row]:
    """A row a plate. The solids stand in files of their own, which later runs take."""
    for name in PLATES:
        yield Row({"plate": name}, partial(_compared, out, name))


def _solid(out: Path, plate: Plate, symmetry: str, fine: float = 1) -> Found:
    count = round(1.25 * len(_eigen(plate.table())[1]) / len(plate.symmetries)) + 4
    part = plate.part(fine)
    key = hashlib.sha256(repr((part.material, symmetry, count)).encode() + part.bricks().tobytes()).hexdigest()[:12]
    file = out / f"solid_{key}.npz"
    if not file.is_file():
        with tempfile.TemporaryDirectory() as folder:
            found = solved(Path(folder), part, symmetry, count)
        with written_whole(file) as beside, beside.open("wb") as stream:
            np.savez_compressed(stream, **{name: value for name, value in vars(found).items() if value is not None})
    with np.load(file) as kept:
        return Found(**{"sag_m": None, **{name: kept[name] for name in kept.files}})


@dataclass(frozen=True)
class Side:
    """Modes of one side: frequency (n,), motion of the mid-plane (n, k, 3) at the places, force on the feet (n, rods)."""

    frequency_Hz: np.ndarray
    motion: np.ndarray
    force_N: np.ndarray

    def answer(self, hit: int, duration_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations (t, k) upwards at all places and forces (t, rods) after a pulse of 1 N on one of them."""
        modes = SimpleNamespace(frequency_Hz=self.frequency_Hz, damping_ratio=np.full(len(self.frequency_Hz), DAMPING))
        moving = ModalMotion(cast(PlateModes, modes), INTERVAL_s)
        up, acceleration, force = self.motion[:, :, 2], [], []
        for step in range(round(duration_s / INTERVAL_s)):
            time_s = (step + 0.5) * INTERVAL_s
            push = -up[:, hit] * (np.sin(np.pi * time_s / PULSE_s) ** 1.5 if time_s < PULSE_s else 0.0)
            moving.advance(push)
            acceleration.append(moving.acceleration_at(moving.amplitude, moving.rate, push) @ up)
            force.append(moving.amplitude @ self.force_N)
        return np.array(acceleration), np.array(force)


def _of_solid(plate: Plate, found: dict[str, Found]) -> tuple[Side, np.ndarray]:
    """The whole plate's modes below its highest, and the nodes (k, 2): the part's and their images."""
    frequency, motion, force = [], [], []
    for symmetry, solid in found.items():
        kept = solid.frequency_Hz < plate.highest_Hz
        if kept.all():
            raise RuntimeError(f"too few modes of symmetry {symmetry!r}")
        moved, borne = [], []
        for signs in plate.images:  # the signs by which an image is turned
            factor = np.prod([sign if kind == "a" else 1 for kind, sign in zip(symmetry, signs, strict=True)])
            moved.append(factor * solid.motion[kept] * [*signs, 1.0])
            borne.append(factor * solid.force_N[kept])
        frequency.append(solid.frequency_Hz[kept])
        motion.append(np.concatenate(moved, axis=1))
        force.append(np.concatenate(borne, axis=1))
    node_m = next(iter(found.values())).node_m
    whole = np.concatenate([node_m * signs for signs in plate.images])
    order = np.argsort(np.concatenate(frequency))
    return Side(*(np.concatenate(one)[order] for one in (frequency, motion, force))), whole


def _eigen(plate: FlexiblePlate) -> tuple[PlateModel, np.ndarray, np.ndarray]:
    """The model, omega^2 and its vectors of the modes below `max_frequency_Hz`."""
    model = build_model(plate)
    squared, vectors = eigenmodes(model.parts, plate.max_frequency_Hz or 0.0)
    return model, squared, vectors.toarray()


def _of_plate(plate: Plate, node_m: np.ndarray) -> Side:
    model, squared, vectors = _eigen(plate.table())
    u = model.expansion @ vectors
    motion = [model.system.lateral(node_m, axis, 0.0) @ u for axis in (0, 1)] + [model.system.deflection(node_m) @ u]
    return Side(np.sqrt(squared) / (2 * np.pi), np.array(motion).transpose(2, 1, 0), (model.rod_force @ vectors).T)


def _sag_m(plate: FlexiblePlate, node_m: np.ndarray) -> np.ndarray:
    """Deflection (k,) of plate and rods under gravity; a mode's momentum is its share of the weight."""
    modes = plate_modes(plate, None, NOWHERE)
    return np.asarray(-9.81 * modes.shape_at(node_m) @ (modes.momentum / (2 * np.pi * modes.frequency_Hz) ** 2))


def paired(solid: Side, plate: Side) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the solid's modes that the plate has, and of those."""
    a, b = (side.motion.reshape(len(side.motion), -1) for side in (solid, plate))
    like = (a @ b.T) ** 2 / np.outer((a**2).sum(axis=1), (b**2).sum(axis=1))
    like *= abs(np.log(plate.frequency_Hz / solid.frequency_Hz[:, None])) < NEAR
    of_solid, of_plate = linear_sum_assignment(-like)
    kept = like[of_solid, of_plate] > ALIKE
    return of_solid[kept], of_plate[kept]


def _compared(out: Path, name: str) -> dict[str, float]:
    plate = PLATES[name]
    found = {symmetry: _solid(out, plate, symmetry) for symmetry in plate.symmetries}
    (solid, node_m), whole = _of_solid(plate, found), found[plate.symmetries[0]]
    side = _of_plate(plate, node_m)
    of_solid, of_plate = paired(solid, side)
    error = 100 * (side.frequency_Hz[of_plate] / solid.frequency_Hz[of_solid] - 1)
    first = of_solid < FIRST
    up = solid.motion[of_solid, :, 2]
    rigid = [int(((up @ field) ** 2 / (up**2).sum(axis=1)).argmax()) for field in (np.ones(len(node_m)), *node_m.T)]
    at = [int(np.hypot(*(node_m - place).T).argmin()) for place in plate.places_m]
    places = [Side(one.frequency_Hz, one.motion[:, at], one.force_N) for one in (solid, side)]
    short = [[one.answer(hit, 2e-3)[0] for hit in range(len(at))] for one in places]
    of_hit = [100 * float(np.linalg.norm(b - a) / np.linalg.norm(a)) for a, b in zip(*short, strict=True)]
    peak = [np.array([abs(one.answer(hit, 10e-3)[1]).max(axis=0) for hit in range(len(at) - 1)]) for one in places]
    sag = [_sag_m(plate.table(), node_m[at[:-1]]), np.asarray(whole.sag_m)[at[:-1]]]
    return {"modes": int((solid.frequency_Hz < plate.highest_Hz).sum()), "missing": len(solid.frequency_Hz) - len(of_solid),
            "worst_percent": max(error, key=abs), "rms_percent": float(np.sqrt(np.mean(error**2))),
            "first_worst_percent": max(error[first], key=abs), "first_rms_percent": float(np.sqrt(np.mean(error[first] ** 2))),
            "heave_percent": error[rigid[0]], "rocking_percent": max(error[rigid[1:]], key=abs),
            "sag_percent": 100 * max(sag[0] / sag[1] - 1, key=abs),
            "accelerometers_percent": float(np.sqrt(np.mean(np.square(of_hit[:-1])))), "on_rod_percent": of_hit[-1],
            "rod_peak_percent": 100 * max((peak[1] / peak[0] - 1).ravel(), key=abs),
            "settled_percent": _settled_percent(out, plate, whole)}


def _settled_percent(out: Path, plate: Plate, fine: Found) -> float:
    """By how much bricks that are wider by half move a mode of the whole plate or of its even quarter, at most."""
    moved = _solid(out, plate, plate.symmetries[0], COARSER).frequency_Hz / fine.frequency_Hz - 1
    return 100 * float(max(moved[fine.frequency_Hz < plate.highest_Hz], key=abs))
