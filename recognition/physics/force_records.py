"""What a simulated run shows besides its record: the force of each stone, and what the plate's model makes of it."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.signal import fftconvolve, resample_poly

from analysis.files.readers import read_table
from analysis.signals.records import RecordError
from analysis.sweep.runs import Run
from analysis.theory.contact_states import places_of
from analysis.theory.real_plate import flexible_plate
from common.channels import force_column, rod_column, sensor_column
from common.files.cache import user_cache
from common.scene.plate import FlexiblePlate
from plate_fem.modes import PlateModes, plate_modes
from plate_fem.motion import pulse_response
from recognition.estimation.arrays import Booleans, Floats

Places = tuple[tuple[float, ...], ...]
#: Plate as JSON, where the stones fall, how far off they touch, which places have residual modes, interval and number
#: of steps.
Excitation = tuple[str, Places, Places, Places, float, int]


@dataclass(frozen=True)
class Fall:
    """place_m (stones, 2): where stones fall; arrival_s (stones,): when, after the beginning of the record."""

    place_m: Floats
    arrival_s: Floats

    @property
    def at_once(self) -> bool:
        """Do all of them touch the plate as the record begins?"""
        return not self.arrival_s.any()


@dataclass(frozen=True)
class ForceRecord:
    """Forces of the stones of one simulated run.

    fall: where and when the stones fall; touch_m (stones, 2): where they touch the plate first, which is some
    millimetres off where a stone touches with its sub-spheres; sample_s: interval between samples of the run's record;
    force_N (stones, steps): means over steps of step_s from t = 0 on; gangue (stones,): which stones are gangue;
    anti_alias: the run's record passed a low pass before it was sampled.
    """

    plate: FlexiblePlate
    fall: Fall
    touch_m: Floats
    speed_m_s: float
    sample_s: float
    step_s: float
    force_N: Floats
    gangue: Booleans
    anti_alias: bool = False

    @property
    def stride(self) -> int:
        """Steps of a sample."""
        return round(self.sample_s / self.step_s)

    @cached_property
    def modelled(self) -> Floats:
        """What the plate's model makes of these forces (channels, steps): accelerometers, then rods, by name."""
        unit = unit_force_response(*self.excitation(self.plate.damping_ratio, self.touch_m - self.fall.place_m))
        return response_to(unit, self.force_N.T).sum(axis=2)

    @property
    def sampled(self) -> Floats:
        """`modelled` as the record has it, shape (channels, samples)."""
        fine, every = self.modelled, self.stride
        return np.asarray(resample_poly(fine, 1, every, axis=1)) if self.anti_alias else fine[:, ::every]

    @cached_property
    def from_arrival_N(self) -> Floats:
        """Forces (stones, steps), each from the stone's arrival on."""
        late = np.round(self.fall.arrival_s / self.step_s).astype(int)
        return np.stack([np.concatenate([row[k:], np.zeros(k)]) for row, k in zip(self.force_N, late, strict=True)])

    def excitation(self, damping_ratio: float, moved_m: Floats | tuple[float, float]) -> Excitation:
        """Of the plate, with this damping ratio, on the stones' places, displaced by moved_m (2,) or (stones, 2)."""
        plate = self.plate.model_copy(update={"damping_ratio": float(damping_ratio)})
        places, moved = (tuple(map(tuple, m)) for m in np.broadcast_arrays(self.fall.place_m, moved_m))
        # To find residual modes takes seconds: places that one record alone has are without.
        residual = places if self.fall.at_once else ()
        return plate.model_dump_json(), places, moved, residual, self.step_s, self.force_N.shape[1]


def fall_of(run: Run) -> Fall:
    """Where and when the stones of a run fall. RecordError where it does not say."""
    place_m, stones = places_of(run), run.stones
    late = np.zeros(len(place_m)) if stones is None else stones["arrival_s"].to_numpy(dtype=float)
    return Fall(place_m, late)


def force_record_of(run: Run, duration_s: float, sample_s: float | None = None) -> ForceRecord:
    """Force record of a finished run over its first duration_s.

    sample_s: interval between samples of the record, that of `signals.parquet` if None. RecordError without a fast
    stream of that length, a flexible plate or places of the stones.
    """
    path, fall = run.path / "fast.parquet", fall_of(run)
    forces = [force_column(number) for number in range(1, len(fall.place_m) + 1)]
    table = read_table(path, ["t_s", *forces])
    t_s = table["t_s"].to_numpy(dtype=float)
    step_s = float(t_s[1] - t_s[0]) if len(t_s) > 1 else duration_s
    steps = round(duration_s / step_s)
    if len(t_s) <= steps or not np.allclose(np.diff(t_s[:steps + 1]), step_s):
        raise RecordError(f"{path}: needs {duration_s:g} s without gaps")
    stones = run.scene.stones
    if stones.speed_m_s is None:
        raise RecordError(f"{run.path}/run.json: scene.stones.speed_m_s = None; needs a number")
    return ForceRecord(flexible_plate(run), fall, _touches_of(run, fall.place_m), stones.speed_m_s,
                       sample_s or 1 / run.rate_Hz, step_s, table[forces][1:steps + 1].to_numpy(dtype=float).T,
                       np.array(run.materials) == "gangue", run.scene.time.anti_alias)


def _touches_of(run: Run, place_m: Floats) -> Floats:
    """Where the stones of a run touch the plate first (stones, 2); where one never does, its place. RecordError."""
    table = run.stones
    if table is None or not {"first_x_m", "first_y_m"} <= set(table.columns) or len(table) != len(place_m):
        raise RecordError(f"{run.path}/stones.parquet: needs first_x_m and first_y_m of {len(place_m)} stones")
    touch_m = table[["first_x_m", "first_y_m"]].to_numpy(dtype=float)
    return np.where(np.isfinite(touch_m), touch_m, place_m)


def response_to(unit_response: Floats, force_N: Floats) -> Floats:
    """Responses (channels, steps, stones) to forces (steps, stones) or, the same on every place, (steps, 1)."""
    return fftconvolve(unit_response, force_N[None], axes=1)[:, :unit_response.shape[1]]


@lru_cache(maxsize=16)
def pulse_force_response(pulse_N: tuple[float, ...], excitation: Excitation) -> Floats:
    """`unit_force_response` to a force of pulse_N in the first steps, kept for the models of all folds."""
    unit = unit_force_response(*excitation)
    force_N = np.zeros((unit.shape[1], 1))
    force_N[:len(pulse_N), 0] = pulse_N
    return response_to(unit, force_N)


@lru_cache(maxsize=64)
def unit_force_response(plate_json: str, places: Places, moved_m: Places, residual: Places, step_s: float,
                        steps: int) -> Floats:
    """Response of each channel to a force of 1 N during the first step on each place (channels, steps, stones)."""
    plate, modes, amplitude, acceleration = _pulse(plate_json, residual, step_s, steps)
    down = -np.hstack(list(modes.shapes_at(np.array(places) + np.array(moved_m))))  # a little beyond an edge, too
    sensors = sorted(plate.accelerometers, key=lambda sensor: sensor_column(sensor.name))  # as sorted columns are
    at_sensors = modes.shape_at(np.array([[s.x_m, s.y_m] for s in sensors]))
    rods = modes.rod_force[sorted(range(len(modes.rod_force)), key=lambda k: rod_column(k + 1))]
    return np.concatenate([_channels(acceleration, at_sensors, down), _channels(amplitude, rods, down)])


@lru_cache(maxsize=8)
def _pulse(plate_json: str, residual: Places, step_s: float,
           steps: int) -> tuple[FlexiblePlate, PlateModes, Floats, Floats]:
    """A plate, its modes, and their amplitudes and accelerations (steps, n) under a unit modal force in the first step,
    which are the same wherever it acts."""
    plate = FlexiblePlate.model_validate_json(plate_json)
    modes = plate_modes(plate, user_cache(), np.array(residual).reshape(-1, 2))
    amplitude, _, acceleration = pulse_response(modes, step_s, steps)
    return plate, modes, amplitude, acceleration


def _channels(motion: Floats, observed: Floats, down: Floats) -> Floats:
    """Modal motion (steps, n) under a unit modal force, observed by (channels, n), excited at (stones, n)."""
    return np.asarray(np.einsum("tn,cn,in->cti", motion, observed, down, optimize=True))
