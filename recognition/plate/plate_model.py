"""A plate as its sensors know it: its modes, what each sensor sees of them, and how sure all that is; and the exact
motion of modes under forces that are constant over each sample interval.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from scipy.interpolate import NdBSpline, make_interp_spline
from scipy.signal import lfilter

from common.by_value import ByValue
from common.files.cache import user_cache
from common.files.whole import read_sealed_json, write_sealed_json
from common.input_error import raised_as
from common.scene.plate import FlexiblePlate, read_plate
from common.tables import refused_in
from plate_fem.elements.mesh import bending_wavenumber, choose_theory
from plate_fem.modes import plate_modes
from recognition.estimation.arrays import Booleans, Floats, finite
from recognition.estimation.errors import RecognitionError

LINES_PER_WAVELENGTH = 20  # of the grid of shapes; its cubic splines then err by at most 1e-3 of the largest shape
FORMAT = "plate model 2"
SLOPES = ((1, 0), (0, 1))  # of `PlateModel.shape`: by x and by y
WITHOUT_SIGN = ("frequency_Hz", "damping_ratio", "frequency_sd", "damping_sd", "shape_sd")


@dataclass(frozen=True, eq=False)
class PlateModel(ByValue):
    """m modes of a plate, mass-normalised, in ascending frequency, as s accelerometers and r rods see them.

    frequency_Hz, damping_ratio (m,); a rigid-body mode has frequency zero.
    sensor_names (s,); sensor_m (s, 2): where they are; sensor_shape (s, m), kg^-1/2: acceleration at a sensor per modal
    acceleration. rod_force_N_m (r, m): force of a rod (tension positive) per modal amplitude, N/(kg^1/2 m).
    lines_x_m (nx,), lines_y_m (ny,), grid_shape (nx, ny, m): shapes on a regular grid over the plate.
    frequency_sd, damping_sd, shape_sd (m,): standard deviations of each mode, relative to its frequency, to its damping
    ratio and to the rms of its shape over the plate. Zero: taken to be exact.
    max_frequency_Hz: no mode up to here is missing. residual_modes: the last so many stand for those above.
    Raises RecognitionError for arrays that do not fit each other, are not finite or have the wrong sign.

    >>> plate = PlateModel.from_scene("scenes/small.toml", max_frequency_Hz=500.0)
    >>> plate.response([[100.0, 100.0]], [[0.1, 0.0]], sample_rate_Hz=20_000.0).shape  # of four sensors, m/s^2
    (4, 2)
    """

    frequency_Hz: Floats
    damping_ratio: Floats
    sensor_names: tuple[str, ...]
    sensor_m: Floats
    sensor_shape: Floats
    rod_force_N_m: Floats
    lines_x_m: Floats
    lines_y_m: Floats
    grid_shape: Floats
    frequency_sd: Floats
    damping_sd: Floats
    shape_sd: Floats
    max_frequency_Hz: float
    residual_modes: int = 0

    def __post_init__(self) -> None:
        if not np.isfinite(self.max_frequency_Hz) or self.frequency_Hz.ndim != 1 or self.frequency_Hz.size == 0:
            raise RecognitionError("needs the frequency of at least one mode, and the highest")
        m, s = len(self.frequency_Hz), len(self.sensor_names)
        if not 0 <= self.residual_modes < m:
            raise RecognitionError(f"residual_modes = {self.residual_modes}; must be 0 to {m - 1}")
        expected: dict[str, tuple[int, ...]] = {name: (m,) for name in WITHOUT_SIGN}
        expected |= {"sensor_m": (s, 2), "sensor_shape": (s, m), "rod_force_N_m": (len(self.rod_force_N_m), m),
                     "grid_shape": (len(self.lines_x_m), len(self.lines_y_m), m)}
        for name, shape in expected.items():
            values = getattr(self, name)
            if values.shape != shape:
                raise RecognitionError(f"{name} has shape {values.shape}; needs {shape}")
            if not np.isfinite(values).all() or name in WITHOUT_SIGN and (values < 0).any():
                raise RecognitionError(f"{name} must be finite" + ", and not negative" * (name in WITHOUT_SIGN))
        if (self.damping_ratio >= 1).any():
            raise RecognitionError("damping_ratio must be below 1")
        for name in ("lines_x_m", "lines_y_m"):
            lines = getattr(self, name)
            if lines.ndim != 1 or lines.size < 4 or not (np.isfinite(lines).all() and (np.diff(lines) > 0).all()):
                raise RecognitionError(f"{name} must be at least 4 rising numbers")

    @classmethod
    def from_scene(cls, scene: str | Path | FlexiblePlate, max_frequency_Hz: float, *, frequency_sd: float = 0.0,
                   damping_sd: float = 0.0, shape_sd: float = 0.0) -> Self:
        """The plate of a scene file, or a `[plate]` table, by finite elements.

        The standard deviations hold for every mode; with zero the plate is believed to be as the scene says.
        Raises InputError for a scene that cannot be read or has no modes, RecognitionError for a plate without sensors.
        """
        plate = scene if isinstance(scene, FlexiblePlate) else read_plate(scene)
        if not isinstance(plate, FlexiblePlate):
            raise RecognitionError(f"{scene}: plate.thickness_m = None; needs that of a plate that bends")
        if not (sensors := plate.accelerometers):
            raise RecognitionError("plate.sensors has no accelerometer; needs at least one")
        plate = plate.model_copy(update={"max_frequency_Hz": float(max_frequency_Hz)})
        with refused_in("scene" if isinstance(scene, FlexiblePlate) else scene, "plate"):
            modes = plate_modes(plate, user_cache())
        m = len(modes.frequency_Hz)
        wavenumber = bending_wavenumber(plate, max_frequency_Hz, choose_theory(plate))
        lines_x, lines_y = (_lines(side, wavenumber) for side in plate.size_m)
        sensor_m = np.array([[sensor.x_m, sensor.y_m] for sensor in sensors])
        x_m, y_m = np.meshgrid(lines_x, lines_y, indexing="ij")
        grid = modes.shape_at(np.column_stack([x_m.ravel(), y_m.ravel()])).reshape(*x_m.shape, m)
        return cls(modes.frequency_Hz, modes.damping_ratio, tuple(sensor.name for sensor in sensors), sensor_m,
                   modes.shape_at(sensor_m), modes.rod_force, lines_x, lines_y, grid, np.full(m, frequency_sd),
                   np.full(m, damping_sd), np.full(m, shape_sd), float(max_frequency_Hz))

    def shape(self, x_m: Floats, y_m: Floats, slope: tuple[int, int] = (0, 0)) -> Floats:
        """Shapes (n, m) at points x_m, y_m (n,), by cubic splines between the grid lines; with `slope`, their
        derivatives of these orders by x and y, per metre. RecognitionError for a point that is not on the plate."""
        x, y = np.atleast_1d(np.asarray(x_m, float)), np.atleast_1d(np.asarray(y_m, float))
        for name, values, lines in (("x_m", x, self.lines_x_m), ("y_m", y, self.lines_y_m)):
            off = ~((values >= lines[0] - 1e-9) & (values <= lines[-1] + 1e-9))
            if off.any():
                raise RecognitionError(f"{name} = {values[off][0]:g}; must lie on the plate, between {lines[0]:g} and "
                                       f"{lines[-1]:g}")
        return np.asarray(self._spline(np.column_stack([x, y]), nu=slope), float)

    def below(self, limit_Hz: float) -> Self:
        """The plate with its modes below a frequency alone."""
        return self._only(self.frequency_Hz < limit_Hz)

    def without_residual_modes(self) -> Self:
        """For what has the modes that these stand for."""
        return self._only(np.arange(len(self.frequency_Hz)) < len(self.frequency_Hz) - self.residual_modes)

    def _only(self, kept: Booleans) -> Self:
        residual = int(np.count_nonzero(kept[len(kept) - self.residual_modes:]))
        names = (*WITHOUT_SIGN, "sensor_shape", "rod_force_N_m", "grid_shape")
        return replace(self, residual_modes=residual, **{name: getattr(self, name)[..., kept] for name in names})

    def with_residual_modes(self, wide: Self) -> Self:
        """The plate with a residual mode for each accelerometer: what the modes that `wide` has beyond as many as this
        plate give there. Far below their frequencies they push together about it, and hardly elsewhere."""
        above = slice(len(self.frequency_Hz), None)
        squared, at = (2 * np.pi * wide.frequency_Hz[above]) ** 2, wide.sensor_shape[:, above]
        if not squared.size:
            return self
        x_m, y_m = np.meshgrid(self.lines_x_m, self.lines_y_m, indexing="ij")
        shapes = wide.shape(x_m.ravel(), y_m.ravel())[:, above].reshape(*x_m.shape, -1)
        one = (at**2 / squared).sum() / (at**2 / squared**2).sum()  # w^2, right to the fourth power of a frequency
        own = np.sqrt((one * at**2 / squared).sum(axis=1)).clip(min=np.finfo(float).tiny)
        added: dict[str, Any] = {
            "frequency_Hz": np.full(len(own), np.sqrt(one) / (2 * np.pi)), "sensor_shape": np.diag(own),
            "rod_force_N_m": np.zeros((len(self.rod_force_N_m), len(own))),
            "grid_shape": shapes @ (one * at / squared).T / own}
        added |= {name: np.full(len(own), np.median(getattr(self, name)))
                  for name in ("damping_ratio", "frequency_sd", "damping_sd", "shape_sd")}
        for name, value in added.items():
            added[name] = np.concatenate([getattr(self, name), value], axis=-1)
        return replace(self, residual_modes=len(own), **added)

    @cached_property
    def splines(self) -> tuple[Any, Any]:
        """For either axis, the function of the weights (n, lines) of its grid lines at coordinates (n,)."""
        x, y = (make_interp_spline(lines, np.eye(len(lines)), k=3) for lines in (self.lines_x_m, self.lines_y_m))
        return x, y

    @cached_property
    def _spline(self) -> NdBSpline:
        along_y = make_interp_spline(self.lines_y_m, self.grid_shape, k=3, axis=1)
        along_x = make_interp_spline(self.lines_x_m, np.moveaxis(along_y.c, 0, 1), k=3)
        return NdBSpline((along_x.t, along_y.t), along_x.c, 3)

    @property
    def rms_shape(self) -> Floats:
        """(m,): rms of each shape over the grid."""
        return np.asarray(np.sqrt(np.mean(self.grid_shape**2, axis=(0, 1))), float)

    def response(self, force_N: Floats, places_m: Floats, sample_rate_Hz: float) -> Floats:
        """Accelerations (s, t), m/s^2 upwards, under forces (n, t) in N downwards at places (n, 2).

        Force k lasts from k to k + 1 sample intervals, and acceleration k belongs to k intervals, where a jump counts
        half. The plate is at rest before. Exact for such forces. RecognitionError for what is not finite, or no rate.
        """
        if not 0 < sample_rate_Hz < np.inf:
            raise RecognitionError(f"sample_rate_Hz = {sample_rate_Hz:g}; must be finite and > 0")
        places, force = (np.atleast_2d(finite(*given, 1)) for given in (("places_m", places_m), ("force_N", force_N)))
        if places.shape != (len(force), 2):
            raise RecognitionError(f"{len(force)} forces for places of shape {places.shape}; needs (x, y) of each")
        modal_force = -self.shape(places[:, 0], places[:, 1]).T @ force
        return np.asarray(self.sensor_shape @ modal_steps(self, modal_force, sample_rate_Hz)[2], float)

    def save(self, file: str | Path) -> None:
        """Write a JSON file, sealed by its hash."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        lists = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}
        write_sealed_json(Path(file), {"format": FORMAT, **lists, "sensor_names": list(self.sensor_names)})

    @classmethod
    def load(cls, file: str | Path) -> Self:
        """Read what `save` wrote. RecognitionError, one line, for anything else."""
        with raised_as(RecognitionError):
            content = read_sealed_json(Path(file))
        if content is None:
            raise RecognitionError(f"{file}: no such file")
        names = {field.name for field in fields(cls)}
        if content.pop("format", None) != FORMAT or set(content) - {"sha256"} != names:
            raise RecognitionError(f"{file}: not a plate model of this version; `gangue tap` writes one")
        try:
            kept: dict[str, Any] = {"sensor_names": tuple(map(str, content["sensor_names"])),
                                    "max_frequency_Hz": float(content["max_frequency_Hz"]),
                                    "residual_modes": int(content["residual_modes"])}
            arrays = {name: np.array(content[name], float) for name in names - set(kept)}
            arrays["rod_force_N_m"] = arrays["rod_force_N_m"].reshape(-1, arrays["frequency_Hz"].size)
            return cls(**arrays | kept)
        except (TypeError, ValueError, OverflowError) as error:
            raise RecognitionError(f"{file}: no plate model: {error}") from None


def _lines(side_m: float, wavenumber_1_m: float) -> Floats:
    """Grid lines over a side, at least so many that a spline has its four."""
    cells = max(8, int(np.ceil(side_m * wavenumber_1_m / (2 * np.pi) * LINES_PER_WAVELENGTH)))
    return np.linspace(-side_m / 2, side_m / 2, cells + 1)


def modal_steps(plate: PlateModel, force: Floats, sample_rate_Hz: float) -> tuple[Floats, Floats, Floats]:
    """Amplitude, rate and acceleration (m, t) under modal forces (m, t), N kg^-1/2, from rest.

    Force k lasts from k to k + 1 sample intervals; results k belong to k intervals, where a jump counts half.
    """
    amplitude, rate = np.empty_like(force), np.empty_like(force)
    omega = 2 * np.pi * plate.frequency_Hz
    for k, (w, zeta) in enumerate(zip(omega, plate.damping_ratio, strict=True)):
        step = _rigid if w == 0 else _ringing
        amplitude[k], rate[k] = step(force[k], w, zeta, 1 / sample_rate_Hz)
    before = np.concatenate([np.zeros((len(force), 1)), force[:, :-1]], axis=1)
    decay = 2 * (plate.damping_ratio * omega)[:, None]
    return amplitude, rate, (force + before) / 2 - decay * rate - omega[:, None] ** 2 * amplitude


def _ringing(force: Floats, omega: float, zeta: float, step_s: float) -> tuple[Floats, Floats]:
    """q'' + 2 zeta omega q' + omega^2 q = f. With p = omega (-zeta + i sqrt(1 - zeta^2)), z = q' - conj(p) q obeys
    z' = p z + f, and q = Im z / Im p."""
    pole = omega * complex(-zeta, np.sqrt(1 - zeta**2))
    turn = np.exp(pole * step_s)
    z = lfilter([0, np.expm1(pole * step_s) / pole], [1, -turn], force.astype(complex))
    amplitude = z.imag / pole.imag
    return amplitude, z.real + pole.real * amplitude


def _rigid(force: Floats, _omega: float, _zeta: float, step_s: float) -> tuple[Floats, Floats]:
    before = np.concatenate([[0.0], force[:-1]]) * step_s
    rate = np.cumsum(before)
    return np.cumsum(rate - before / 2) * step_s, rate
