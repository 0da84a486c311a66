"""Plates that are not the one a model was made of, to test it against: another theory, a solid, scattered modes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from common.scene.plate import FlexiblePlate, read_plate
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel

SOLID = Path(__file__).with_name("data") / "solid_plate.npz"  # lab/plate/solid_plate.py
WAVES = 3  # half waves of the error of a shape along either side
DAMPING_SCATTER = 10.0  # of damping ratios, relative to that of frequencies: 10 to 30 % for 1 to 3 %


def other_theory(plate: PlateModel, scene: str | Path | FlexiblePlate) -> PlateModel:
    """The plate of a scene by Kirchhoff's theory, as the sensors of `plate` would see it."""
    table = scene if isinstance(scene, FlexiblePlate) else read_plate(scene)
    if not isinstance(table, FlexiblePlate):
        raise RecognitionError("plate.thickness_m = None; needs that of a plate that bends")
    other = "kirchhoff" if table.theory != "kirchhoff" else "mindlin"
    return PlateModel.from_scene(table.model_copy(update={"theory": other}), plate.max_frequency_Hz)


def solid_plate(plate: PlateModel, damping_ratio: float = 0.01, file: Path = SOLID,
                highest_Hz: float = 8000.0) -> PlateModel:
    """The paper's plate as a solid (CalculiX, up to 8 kHz), with the sensors of `plate`. It has no rod forces. `file`
    may be another of lab/plate/solid_plate.py, with modes up to highest_Hz."""
    with np.load(file) as data:
        frequency, mirror = data["frequency_Hz"], data["mirror"]
        half_m, grid = data["lines_m"], data["quarter_shape"].astype(float)
    for axis in (0, 1):
        other = np.flip(grid, axis) * mirror[:, axis]
        grid = np.concatenate([np.delete(other, -1, axis), grid], axis)
    lines = np.concatenate([-half_m[:0:-1], half_m])
    m = frequency.size
    solid = PlateModel(frequency, np.full(m, damping_ratio), plate.sensor_names, plate.sensor_m,
                       np.zeros((len(plate.sensor_m), m)), np.zeros((0, m)), lines, lines, grid, np.zeros(m),
                       np.zeros(m), np.zeros(m), highest_Hz)
    return replace(solid, sensor_shape=solid.shape(*plate.sensor_m.T))


def scattered(plate: PlateModel, scatter: float, rng: np.random.Generator) -> PlateModel:
    """A plate whose frequencies are off by `scatter` (standard deviation), its damping ratios by ten times that, and
    whose shapes each have an error of their own, smooth over the plate, of `scatter` times the shape's rms."""
    m = plate.frequency_Hz.size
    frequency = plate.frequency_Hz * (1 + scatter * rng.standard_normal(m))
    damping = plate.damping_ratio * np.exp(DAMPING_SCATTER * scatter * rng.standard_normal(m))
    waves = rng.standard_normal((WAVES, WAVES, m))
    error = np.einsum("ip,jq,pqm->ijm", _cosines(plate.lines_x_m), _cosines(plate.lines_y_m), waves)
    error *= scatter * plate.rms_shape / np.sqrt(np.mean(error**2, axis=(0, 1)))
    other = replace(plate, grid_shape=plate.grid_shape + error)
    order = np.argsort(frequency)
    other = replace(other, sensor_shape=other.shape(*plate.sensor_m.T))
    rods = plate.rod_force_N_m * (1 + scatter * rng.standard_normal(plate.rod_force_N_m.shape))
    return replace(other, frequency_Hz=frequency[order], damping_ratio=damping[order],
                   sensor_shape=other.sensor_shape[:, order], grid_shape=other.grid_shape[..., order],
                   rod_force_N_m=rods[:, order])


def _cosines(lines_m: Floats) -> Floats:
    """(n, WAVES): half waves along a side."""
    x = (lines_m - lines_m[0]) / (lines_m[-1] - lines_m[0])
    return np.asarray(np.cos(np.pi * x[:, None] * np.arange(WAVES)), float)
