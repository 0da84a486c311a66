"""The command `tap`: the file that says which records are taps, the plate that is learnt from them, how sure each mode
is, and the error that is left; and its modes as a universal file, by pyuff (extra `records`).
"""

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from scipy.optimize import linear_sum_assignment

from analysis.signals.records import clipped
from common.files.output_directory import is_sealed_as, refuse_file
from common.files.whole import written_whole
from common.input_error import optional_library
from common.process.messages import told
from common.result import Result
from common.tables import Place, Table, about, check, read_toml
from recognition.estimation.arrays import Booleans, Floats
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import FORMAT, PlateModel
from recognition.plate.records import numbers, read_accelerations
from recognition.sensors.channel_check import LEAST_HUM, channel_faults, without_hum
from recognition.tapping.fit import BEYOND, IDENTIFIED, Fit, Fitted, Prior, fit_plate
from recognition.tapping.structure import Parameters, Structure
from recognition.tapping.taps import BAND, Tap

_log = logging.getLogger(__name__)
DRAWS, SEED = 64, 1  # of the posterior
RESIDUAL = 2.0  # times the highest frequency of the fit: so far residual modes stand for the scene's
HUM_PERIODS = 5.0  # of a tap's record: in fewer the plate's own motion may pass for hum


@dataclass(frozen=True)
class Learnt:
    """plate: with what the taps say in it. identified (m,): which modes they say something of.

    misfit, noise (s,): rms of what is left at each sensor, and of its noise before the taps, in shares of the records,
    up to highest_Hz. gain (s,): of each sensor, already in `plate.sensor_shape`; gain_sd (s,).
    """

    plate: PlateModel
    identified: Booleans
    misfit: Floats
    noise: Floats
    gain: Floats
    gain_sd: Floats
    highest_Hz: float

    def whole_plate(self, scene: str | Path) -> PlateModel:
        """With the residual modes of the scene whose plate was tapped."""
        return self.plate.with_residual_modes(PlateModel.from_scene(scene, RESIDUAL * self.highest_Hz))

    @property
    def unexplained(self) -> Floats:
        """(s,): rms of what neither plate nor noise explains, in shares of the records."""
        return np.asarray(np.sqrt(np.maximum(self.misfit**2 - self.noise**2, 0.0)), float)


def learnt(fitted: Fitted, prior: Prior | None = None) -> Learnt:
    """The plate of a fit. What the fit leaves unexplained about the frequency of a mode counts as error of its shape,
    half the power each for sensor and place. RecognitionError where a mode may have no stiffness, or does not ring."""
    fit, structure, vector = fitted.fit, fitted.fit.structure, fitted.state[:fitted.fit.shared]
    parameters, left = structure.parameters(vector), fit.residuals(fitted.state)
    frequency, damping, turn = _modes(structure, parameters)
    draws = [_matched(structure, vector + step, turn) for step in _steps(fitted)]
    _check_stiff(structure.plate, [frequency, *(draw[0] for draw in draws)], damping)
    off = np.stack([draw[2] - turn for draw in draws])
    plate, shapes = structure.plate, structure.plate.grid_shape.reshape(-1, frequency.size)
    gram = shapes.T @ shapes / len(shapes)  # means over the grid of products of two shapes
    rms_2 = np.einsum("jk,jl,lk->k", turn, gram, turn)
    shape_2 = np.einsum("djk,jl,dlk->k", off, gram, off) / len(draws) / rms_2
    left_2 = _unexplained(fit, left, frequency)
    frequency_sd = np.sqrt(np.mean([(draw[0] / np.maximum(frequency, 1e-9) - 1) ** 2 for draw in draws], axis=0))
    frequency_sd[frequency == 0] = 0.0
    gain = np.exp(parameters.log_gain)
    modes = replace(
        plate, frequency_Hz=frequency, damping_ratio=damping, grid_shape=plate.grid_shape @ turn,
        sensor_shape=gain[:, None] * structure.sensor_shape(parameters) @ turn,
        rod_force_N_m=plate.rod_force_N_m @ turn, frequency_sd=frequency_sd,
        damping_sd=np.std([_log_ratio(draw[1], damping) for draw in draws], axis=0),
        shape_sd=np.sqrt(shape_2 + left_2 / 2))
    highest_Hz = plate.max_frequency_Hz / BEYOND
    identified = (frequency_sd < IDENTIFIED * (prior or Prior()).frequency) & (frequency < highest_Hz)
    at = structure.pairs[0].size + plate.frequency_Hz.size + np.arange(gain.size)
    return Learnt(modes, identified, *_misfit(fit, left), gain, np.sqrt(np.diag(fitted.covariance)[at]), highest_Hz)


def _check_stiff(plate: PlateModel, frequencies_Hz: list[Floats], damping: Floats) -> None:
    elastic = np.count_nonzero(plate.frequency_Hz)
    if damping.max() >= 1 or any(np.count_nonzero(frequency_Hz) < elastic for frequency_Hz in frequencies_Hz):
        raise RecognitionError("by these taps a mode has no stiffness, or does not ring; is the plate, a place, a sign "
                               "or a unit another one?")


def _steps(fitted: Fitted) -> Floats:
    """(DRAWS, size): deviations of the shared parameters by their covariance."""
    values, vectors = np.linalg.eigh(fitted.covariance)
    normal = np.random.default_rng(SEED).standard_normal((DRAWS, values.size))
    return np.asarray(normal * np.sqrt(np.maximum(values, 0.0)) @ vectors.T, float)


def _modes(structure: Structure, parameters: Parameters) -> tuple[Floats, Floats, Floats]:
    """Frequencies (m,), damping ratios (m,) and, column by column, the modes (m, m) in terms of the starting ones."""
    squares, turn = np.linalg.eigh(structure.stiffness(parameters.coupling))
    omega = np.sqrt(np.where(squares > 1e-12 * squares[-1], squares, 0.0))
    turn = turn * np.where(turn[abs(turn).argmax(axis=0), np.arange(omega.size)] < 0, -1.0, 1.0)
    damping = np.einsum("jk,j,jk->k", turn, structure.damping(parameters.log_damping), turn)
    return omega / (2 * np.pi), damping / np.where(omega > 0, 2 * omega, np.inf), turn


def _matched(structure: Structure, vector: Floats, turn: Floats) -> tuple[Floats, Floats, Floats]:
    """`_modes` of parameters, each in the place and with the sign of the one in `turn` that it is most alike."""
    frequency, damping, other = _modes(structure, structure.parameters(vector))
    alike = turn.T @ other
    order = linear_sum_assignment(-abs(alike))[1]
    sign = np.sign(alike[np.arange(order.size), order])
    return frequency[order], damping[order], other[:, order] * sign


def _log_ratio(damping: Floats, other: Floats) -> Floats:
    """(m,): zero where both are, as of rigid-body modes."""
    both = (damping > 0) | (other > 0)
    return np.asarray(np.log(np.where(both, damping, 1.0) / np.where(both, other, 1.0)), float)


def _misfit(fit: Fit, left: list[np.ndarray]) -> tuple[Floats, Floats]:
    """(s,) each: rms of what is left of each tap (s, n), and of the noise, in shares of the records."""
    record, unfitted = (sum(np.sum(abs(one) ** 2, axis=1) for one in every)
                        for every in ((found.acceleration for found in fit.spectra), left))
    noise = sum(one.noise * one.s.size for one in fit.spectra)
    return np.sqrt(unfitted / record), np.sqrt(noise / record)


def _unexplained(fit: Fit, left: list[np.ndarray], frequency_Hz: Floats) -> Floats:
    """(m,): power of what neither fit nor noise explains about each frequency, as a share of the records' there."""
    shares = []
    for f in frequency_Hz:
        unexplained = record = 0.0
        for r, found in zip(left, fit.spectra, strict=True):
            bins = found.frequency_Hz
            near = abs(bins - min(f, bins[-1])) <= max(BAND * f, 2 * (bins[1] - bins[0]))
            unexplained += max(float(np.sum(abs(r[:, near]) ** 2) - np.sum(found.noise) * near.sum()), 0.0)
            record += float(np.sum(abs(found.acceleration[:, near]) ** 2))
        shares.append(unexplained / record if record > 0 else 1.0)
    return np.array(shares)


LARGEST_UNEXPLAINED = 0.3  # of a sensor's record: more, and the plate, a place or a sensor is not what it is said to be
TITLE = "gangue: plate learnt from taps"  # in each of its datasets 55


@dataclass(frozen=True)
class TapResult(Result):
    """What the taps say of the modes in the band of the fit and of the sensors; `not_explained` is why no plate is
    written, "" where one is.

    modes: columns, standard deviations (sd) in shares of the values; identified: do the taps tell anything of a mode?
    sensors: by name gain, its sd, and rms of what is left of the taps and of noise, in shares of the records. taps,
    with_force: how many there are, and how many of them have a measured force."""

    plate: Path | None
    plate_bytes: int
    modes: Mapping[str, list[Any]]
    sensors: Mapping[str, Mapping[str, float]]
    not_explained: str
    taps: int = 0
    with_force: int = 0

    def words(self) -> Iterator[str]:
        yield f"{'mode':>4} {'Hz':>8} {'+- %':>6} {'damping %':>9} {'+- %':>5} {'shape +- %':>10}"
        for number, hz, hz_sd, damping, damping_sd, shape_sd, known in zip(*self.modes.values(), strict=True):
            yield (f"{number:4d} {hz:8.1f} {100 * hz_sd:6.2f} {100 * damping:9.2f} {100 * damping_sd:5.0f} "
                   f"{100 * shape_sd:10.1f}" + ("" if known else "  not identified"))
        for name, one in self.sensors.items():
            yield (f"sensor {name}: gain {one['gain']:.3f} +- {one['gain_sd']:.3f}, "
                   f"left over {100 * one['misfit']:.1f} % of its taps, noise {100 * one['noise']:.1f} %")
        yield f"{self.taps} taps, {self.with_force} with a measured force"
        if self.not_explained:
            yield f"NOT EXPLAINED, no plate written: {self.not_explained}"
        else:
            yield f"plate written to {self.plate}, {self.plate_bytes / 1e3:.0f} kB"


def tap(scene_file: str, taps: str, out: str, max_frequency_Hz: float = 6000.0, uff: str | None = None) -> TapResult:
    """Learn the plate of a scene from taps at known places, and write it to `out` (.json) if they suit it; its modes to
    `uff` as well. Raises RecognitionError, InputError."""
    refuse_file(out, is_sealed_as(FORMAT), ".json")
    if uff is not None:
        refuse_file(uff, is_own, ".uff")
    if not 0 < max_frequency_Hz < 1e5:
        raise RecognitionError(f"--max-frequency {max_frequency_Hz:g}: must be above 0, below 1e5 Hz")
    with told(f"{scene_file}: modes"):
        plate = PlateModel.from_scene(scene_file, BEYOND * max_frequency_Hz)
    given, prior = read_taps(taps, plate)
    with told(f"{taps}: fit"):
        found = learnt(fit_plate(plate, given, prior), prior)
    modes, sensors = _table_of_modes(found), _sensors(found)
    counts = len(given), sum(one.force_N is not None for one in given)
    try:
        refuse_unexplained(found)
    except NotRecognised as error:
        return TapResult(None, 0, modes, sensors, str(error), *counts)
    found.whole_plate(scene_file).save(Path(out))
    if uff is not None:
        write_modes(Path(uff), found.plate)
    return TapResult(Path(out), Path(out).stat().st_size, modes, sensors, "", *counts)


def refuse_unexplained(found: Learnt) -> None:
    """Raises NotRecognised where a sensor's record has more that nothing explains than LARGEST_UNEXPLAINED."""
    worst = int(np.argmax(found.unexplained))
    if found.unexplained[worst] > LARGEST_UNEXPLAINED:
        raise NotRecognised(f"sensor {found.plate.sensor_names[worst]!r}: {found.unexplained[worst]:.0%} of its taps, "
                            f"limit {LARGEST_UNEXPLAINED:.0%}")


def _table_of_modes(found: Learnt) -> dict[str, list[Any]]:
    plate, here = found.plate, np.flatnonzero(found.plate.frequency_Hz < found.highest_Hz)
    names = ("frequency_Hz", "frequency_sd", "damping_ratio", "damping_sd", "shape_sd")
    return {"number": (here + 1).tolist(), **{name: getattr(plate, name)[here].tolist() for name in names},
            "identified": found.identified[here].tolist()}


def _sensors(found: Learnt) -> dict[str, dict[str, float]]:
    names = ("gain", "gain_sd", "misfit", "noise")
    return {sensor: {name: float(getattr(found, name)[k]) for name in names}
            for k, sensor in enumerate(found.plate.sensor_names)}


def is_own(content: bytes) -> bool:
    """Is this a file that `write_modes` wrote?"""
    return TITLE.encode() in content


def write_modes(file: Path, plate: PlateModel) -> None:
    """Write the points of the plate's grid as nodes from 1, row by row along x (dataset 15), and each mode as their
    vertical displacement in kg^-1/2, at a modal mass of 1 (dataset 55). Raises RecognitionError without pyuff."""
    pyuff = optional_library("pyuff", f"{file}: UFF", "pyuff", RecognitionError)
    x, y = (grid.ravel() for grid in np.meshgrid(plate.lines_x_m, plate.lines_y_m, indexing="ij"))
    nodes, ones, none = np.arange(1, x.size + 1), np.ones(x.size, dtype=int), np.zeros(x.size)
    same = {"model_type": 1, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8, "data_type": 2,
            "n_data_per_node": 3, "node_nums": nodes, "load_case": 1, "modal_m": 1.0, "modal_damp_his": 0.0,
            "id1": TITLE, **{f"id{k}": "NONE" for k in range(2, 6)}}
    sets = [pyuff.prepare_164(units_code=1, units_description="SI", temp_mode=1, length=1.0, force=1.0, temp=1.0,
                              temp_offset=0.0),
            pyuff.prepare_15(node_nums=nodes, def_cs=ones, disp_cs=ones, color=ones, x=x, y=y, z=none)]
    for k, shape in enumerate(plate.grid_shape.reshape(x.size, -1).T):
        sets.append(pyuff.prepare_55(r1=none, r2=none, r3=shape, mode_n=k + 1, freq=float(plate.frequency_Hz[k]),
                                     modal_damp_vis=float(plate.damping_ratio[k]), **same))
    with written_whole(file) as beside:
        pyuff.UFF(str(beside)).write_sets(sets, "add")


class TapTable(Place):
    record: Annotated[str, about("beside this file: t_s, acc_NAME_m_s2 and, where measured, force_N; or FRFs")]
    unknown_force: Annotated[bool, about("take no notice of force_N")] = False


class TapFile(Table):
    taps: Annotated[tuple[TapTable, ...], Field(min_length=1), about("the taps")]
    prior: Prior = Prior()
    scale: Annotated[float, about("factor on the samples of accelerations")] = 1.0
    unit: Annotated[str | None, about("unit of the scaled samples; absent: as their names say")] = None


def read_taps(path: str | Path, plate: PlateModel) -> tuple[list[Tap], Prior]:
    """The taps that a file names, with the plate's sensors in their order, and what is known beforehand.

    Raises InputError for the file, RecordError or RecognitionError for a record.
    """
    content: TapFile = check(TapFile, read_toml(path), path)
    for k, table in enumerate(content.taps):
        try:
            plate.shape(*np.array(table.place_m)[:, None])
        except RecognitionError as reason:
            raise RecognitionError(f"{path}: taps.{k}.place_m: {reason}") from None
    taps = [_tap(Path(path).parent / table.record, table, plate, content) for table in content.taps]
    return taps, content.prior


def _tap(file: Path, table: TapTable, plate: PlateModel, content: TapFile) -> Tap:
    found, acceleration, rate_Hz = read_accelerations(file, plate, content.scale, content.unit)
    force = None if table.unknown_force or "force_N" not in found.columns else numbers(found, "force_N", file)
    tap = Tap(np.array(table.place_m), acceleration, rate_Hz, force, str(file))
    faults = channel_faults(acceleration, plate.sensor_names)
    if force is not None and (cut := clipped(force, force[abs(force).argmax()], "N")):
        faults.append(f"force_N: {cut}; unknown_force = true takes no notice of it")
    if faults:
        raise RecognitionError(f"{file}: {'; '.join(faults)}")
    clean, _, told_of = without_hum(acceleration, rate_Hz, plate, tap.onset, HUM_PERIODS)
    offset_N = 0.0 if force is None else float(np.median(force))
    if force is not None and abs(offset_N) > LEAST_HUM * abs(force).max():
        force = force - offset_N
        told_of.append(f"force_N: offset {offset_N:.4g} N taken away")
    for line in told_of:
        _log.warning("note: %s: %s", file, line)
    return replace(tap, acceleration=clean, force_N=force)
