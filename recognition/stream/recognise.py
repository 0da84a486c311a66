"""From a record to stones: its channels, noise, the plate's ringing, innovations, stones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import process_time

import numpy as np
import pandas as pd

from analysis.signals.records import Record, sample_rate_Hz
from analysis.signals.resampling import resample
from common.channels import rod_column, sensor_column
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.innovations.bank import Bank
from recognition.innovations.coloured_noise import SensorNoise
from recognition.innovations.retuning import retuned
from recognition.innovations.signatures import Channels
from recognition.innovations.whitening import Whitening
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import numbers
from recognition.stream.checks import Checks, refuse_faulty, without_offset_and_hum
from recognition.stream.decision import Followed, Stop
from recognition.stream.listen import Heard, Listener
from recognition.stream.prior import StonePrior
from recognition.stream.search import Dictionary
from recognition.stream.stones import UNKNOWN_ALL, Known, learnt_table

RATE_Hz = 20_000.0  # at which records are worked on; those at a higher rate are brought to it
QUIET_S = 0.02  # at least so much at the beginning of a record tells the noise
STRETCH_S = 0.02
LOUD = 0.01  # of the power of a record's loudest stretch, in one that counts for its rms
#: Share of stones whose material is wrong in streams of known truth, docs/listening.md.
LEAST_DOUBT = 0.005
#: Of the rate at which a mode loses its phase if its frequency is off by a standard deviation: an error that stays is
#: less harmful than a phase that walks.
PHASE_LOSS = 0.1
#: Of the modes after they were corrected by the record. A filter that believed in less would ring on for longer than
#: the signatures are.
LEAST_FREQUENCY_SD = 0.003


@dataclass(frozen=True)
class Hearing:
    """What was heard in a record by a prior that is wider than what is told, and the plate as it rang. tapped: whether
    any mode of the plate was known well before, as taps teach it. hearing_s: processor time from the record to the
    stones, without what is done once for a plate."""

    heard: list[Heard]
    prior: StonePrior
    plate: PlateModel
    noise: SensorNoise
    checks: Checks
    tapped: bool
    hearing_s: float


@dataclass(frozen=True)
class Recognised:
    """Stones of a record (columns of `recognition.stream.stones`), how they were heard, all checks, and the test of
    when to stop."""

    stones: pd.DataFrame
    hearing: Hearing
    checks: Checks
    followed: Followed | None = None

    @property
    def refused(self) -> str:
        """Why no ratio can be trusted, "" if it can."""
        return self.checks.reason()


def channels_of(table: pd.DataFrame, plate: PlateModel, source: str) -> tuple[Channels, Floats]:
    """Which sensors a record has, and their signals (c, samples) at RATE_Hz. RecognitionError where it has none of the
    plate's sensors, a value that is not finite, or too low a rate."""
    names = [sensor_column(name) for name in plate.sensor_names]
    here = [k for k, name in enumerate(names) if name in table.columns]
    rods = [k for k in range(len(plate.rod_force_N_m)) if rod_column(k + 1) in table.columns]
    if "t_s" not in table.columns or not here:
        raise RecognitionError(f"{source}: needs columns 't_s' and at least one of {', '.join(names)}")
    rate_Hz = sample_rate_Hz(numbers(table, "t_s", source), f"{source}: t_s")
    if rate_Hz < RATE_Hz * (1 - 1e-3):
        raise RecognitionError(f"{source}: {rate_Hz:.6g} Hz; needs at least {RATE_Hz:g}")
    columns = [names[k] for k in here] + [rod_column(k + 1) for k in rods]
    rate_Hz = RATE_Hz if abs(rate_Hz / RATE_Hz - 1) < 1e-3 else round(rate_Hz)
    records = [Record(numbers(table, name, source), rate_Hz, name=f"{source}: {name}") for name in columns]
    if rate_Hz != RATE_Hz:
        records = [resample(record, RATE_Hz) for record in records]
    return Channels(tuple(here), tuple(rods)), np.array([record.values for record in records])


def recognise_stream(plate: PlateModel, channels: Channels, prior: StonePrior, values: Floats,
                     quiet_s: float = QUIET_S, known: Known = UNKNOWN_ALL, stop: Stop | None = None) -> Recognised:
    """The stones of channels (c, samples), see `hear`, by the law that they and known ones teach; and when to stop."""
    found = hear(plate, channels, prior, values, quiet_s)
    stones, law, followed = learnt_table(found.heard, found.prior, prior, known, RATE_Hz, LEAST_DOUBT, stop)
    return Recognised(stones, found, replace(found.checks, **law), followed)


def hear(plate: PlateModel, channels: Channels, prior: StonePrior, values: Floats, quiet_s: float) -> Hearing:
    """The stones of channels (c, samples) at RATE_Hz, accelerometers before rods, which begin with quiet_s without any.

    NotRecognised for a channel that is dead, clipped or without noise, or a record without stones; RecognitionError for
    a plate that is known too low, or a quiet beginning that is shorter than QUIET_S or longer than the record.
    """
    names = [plate.sensor_names[k] for k in channels.accelerometers]
    refuse_faulty(values[:len(names)], names)
    values = without_offset_and_hum(values, RATE_Hz)
    if plate.max_frequency_Hz < RATE_Hz / 2:
        raise RecognitionError(f"the plate has modes up to {plate.max_frequency_Hz:g} Hz; needs {RATE_Hz / 2:g}")
    if not QUIET_S <= quiet_s < values.shape[1] / RATE_Hz:
        raise RecognitionError(f"--silence {quiet_s:g}: must be from {QUIET_S:g} s to the length of the record")
    quiet = round(quiet_s * RATE_Hz)
    noise = _noise_of(values[:, :quiet])
    white = noise.whitened(values)
    tapped = bool(plate.frequency_sd.min() <= LEAST_FREQUENCY_SD)  # taps teach some modes, and others stay unknown
    if np.median(plate.frequency_sd) > LEAST_FREQUENCY_SD:
        plate = retuned(plate, channels, values[:, quiet:], RATE_Hz, noise)
    plate = replace(plate, frequency_sd=np.full(len(plate.frequency_Hz), LEAST_FREQUENCY_SD))
    prior = prior.widened()
    listener, whitening = listener_of(plate, channels, prior, noise, _loud_rms(white))
    began_s = process_time()
    heard = listener.hear(whitening(values), quiet)
    hearing_s = process_time() - began_s
    return Hearing(heard, prior, plate, noise, Checks.of(listener, heard, noise.change), tapped, hearing_s)


def listener_of(plate: PlateModel, channels: Channels, prior: StonePrior, noise: SensorNoise,
                rms: Floats) -> tuple[Listener, Whitening]:
    """What hears the stones, and what whitens the record for it."""
    whitening = Whitening.of(plate, channels, RATE_Hz, noise, rms, PHASE_LOSS)
    bank = Bank.of(plate, channels, prior.forces, whitening, RATE_Hz)
    return Listener(bank, prior, Dictionary.of(bank, prior)), whitening


def _noise_of(quiet: Floats) -> SensorNoise:
    try:
        return SensorNoise.of(quiet)
    except np.linalg.LinAlgError:
        raise NotRecognised("a channel has no noise at all, or is a copy of others, in the quiet beginning") from None


def _loud_rms(white: Floats) -> Floats:
    """(c,): root mean square of the signal in channels (c, samples) with unit noise while something rings, that is, in
    those stretches that have more than LOUD of the power of the loudest. The filter would take stones between long
    silences to be weaker than they are. NotRecognised where nothing rings."""
    size = round(STRETCH_S * RATE_Hz)
    stretches = white[:, :white.shape[1] // size * size].reshape(len(white), -1, size)
    power = np.mean(stretches**2, axis=2) - 1
    loud = power.mean(axis=0) > LOUD * power.mean(axis=0).max()
    signal = power[:, loud].mean(axis=1)
    if not np.all(signal > 0):
        raise NotRecognised("a channel hears nothing that is louder than the quiet beginning")
    return np.asarray(np.sqrt(signal))
