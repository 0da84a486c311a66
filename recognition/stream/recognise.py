"""From a record to stones: its channels, noise, the plate's ringing, innovations, stones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np
import pandas as pd

from analysis.signals.records import READ_AS_S, Record, sample_rate_Hz
from analysis.signals.resampling import resample
from common.channels import rod_column, sensor_column
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.innovations.bank import TIME, Bank
from recognition.innovations.coloured_noise import SensorNoise
from recognition.innovations.prior import StonePrior
from recognition.innovations.retuning import retuned, shifted
from recognition.innovations.signatures import LEAD, Channels
from recognition.innovations.whitening import Whitening
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import numbers, what_has
from recognition.stream.checks import Checks, Mains, refuse_faulty, together, without_offset_and_hum
from recognition.stream.decision import Followed, Stop
from recognition.stream.listen import BLOCK, LOOK_BACK, Heard, Listener, Sums
from recognition.stream.search import Dictionary
from recognition.stream.stones import UNKNOWN_ALL, Known, learnt_table

RATE_SHARE = 1e-3  # of rates that are taken for the same
RATE_Hz = 20_000.0  # at which records are worked on; those at a higher rate are brought to it
QUIET_S = 0.02  # at least so much at the beginning of a record tells the noise
STRETCH_S = 0.02
LOUDER = 2.0  # power over that of the quiet, in a stretch in which something falls
#: What is heard from then on tells how loud stones are, and for a plate that is not tapped its modes; a wait that is
#: longer begins anew.
FIRST_S, UNTAPPED_S, WAIT_S = 1.0, 20.0, 10.0
FOLLOWED_S, HUM_MEMORY = 1.0, 0.7  # offset and hum are learnt anew so often, and what was learnt then counts so much
#: Noise is learnt anew from as long a gap as the beginning, at least GAP_S, where its power is OTHER than expected; it
#: must not CHANGE more (coloured_noise.py), nor a block's energy be farther from the mean: as it comes by a factor, and
#: when it is white in standard deviations.
GAP_S, OTHER, CHANGE, UNLIKE, UNLIKE_SD = 0.25, 1.3, 1.5, 6.0, 8.0
LOUD = 0.01  # of the power of a record's loudest stretch, in one that counts for its rms
LEAST_DOUBT = 0.005  # share of stones whose material is wrong in streams of known truth
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
        return self.checks.reason() or ("" if len(self.stones) else "no stone was heard that is not known")


def channels_of(table: pd.DataFrame, plate: PlateModel, source: str) -> tuple[Channels, Floats]:
    """Which sensors a record has, and their signals (c, samples) at RATE_Hz. RecognitionError where it has none of the
    plate's sensors, a value that is not finite, or too low a rate; NotRecognised for a channel that is dead or clipped,
    which is no longer level once it is resampled."""
    rate_Hz = sample_rate_Hz(numbers(table, "t_s", source), f"{source}: t_s") if "t_s" in table.columns else np.nan
    channels, columns = sensors_of(list(table.columns), rate_Hz, plate, source)
    rate_Hz = RATE_Hz if abs(rate_Hz / RATE_Hz - 1) < RATE_SHARE else round(rate_Hz)
    records = [Record(numbers(table, name, source), rate_Hz, name=f"{source}: {name}") for name in columns]
    names = [plate.sensor_names[k] for k in channels.accelerometers]
    refuse_faulty(np.array([record.values for record in records[:len(names)]]), names)
    if rate_Hz != RATE_Hz:
        records = [resample(record, RATE_Hz) for record in records]
    return channels, np.array([record.values for record in records])


def sensors_of(columns: Sequence[str], rate_Hz: float, plate: PlateModel, source: str) -> tuple[Channels, list[str]]:
    """Which of the plate's sensors have a column, and its name. RecognitionError for none or a rate that is too low."""
    names = [sensor_column(name) for name in plate.sensor_names]
    here = [k for k, name in enumerate(names) if name in columns]
    rods = [k for k in range(len(plate.rod_force_N_m)) if rod_column(k + 1) in columns]
    if np.isnan(rate_Hz) or not here:
        raise RecognitionError(f"{source}: needs columns 't_s' and at least one of {', '.join(names)}; "
                               f"{what_has(columns)}")
    if rate_Hz < RATE_Hz * (1 - RATE_SHARE):
        raise RecognitionError(f"{source}: {rate_Hz:.6g} Hz; needs at least {RATE_Hz:g}; {READ_AS_S}")
    return Channels(tuple(here), tuple(rods)), [names[k] for k in here] + [rod_column(k + 1) for k in rods]


def recognise_stream(plate: PlateModel, channels: Channels, prior: StonePrior, values: Floats,
                     quiet_s: float = QUIET_S, known: Known = UNKNOWN_ALL, stop: Stop | None = None) -> Recognised:
    """The stones of channels (c, samples), see `hear`, by the law that they and known ones teach; and when to stop."""
    found = hear(plate, channels, prior, values, quiet_s)
    stones, law, followed = learnt_table(found.heard, found.prior, prior, known, RATE_Hz, LEAST_DOUBT, stop)
    return Recognised(stones, found, replace(found.checks, **law), followed)


def hear(plate: PlateModel, channels: Channels, prior: StonePrior, values: Floats, quiet_s: float) -> Hearing:
    """The stones of channels (c, samples), as `Ear` hears them."""
    ear = Ear(plate, channels, prior, quiet_s)
    heard = [h for k in range(0, values.shape[1], ear.followed) for h in ear.hear(values[:, k:k + ear.followed])]
    heard += ear.end()
    return Hearing(heard, ear.prior, ear.plate, ear.noise, ear.checks(ear.listener.total, heard), ear.tapped,
                   ear.hearing_s)


class Ear:
    """Hears the stones of channels (c, samples) at RATE_Hz, accelerometers before rods, as they come, the same stones
    in blocks of any length.

    They begin with quiet_s without any, which teaches the noise. It then waits for stones, and listens once it knows
    how loud these are. recorded_Hz: at which accelerometers were recorded, whose samples then show what is clipped.
    NotRecognised for a channel that is dead, clipped or without noise, or a record without stones; RecognitionError for
    a plate that is known too low, or less than QUIET_S.
    """

    listener: Listener
    noise: SensorNoise

    def __init__(self, plate: PlateModel, channels: Channels, prior: StonePrior, quiet_s: float,
                 recorded_Hz: float = RATE_Hz) -> None:
        if plate.max_frequency_Hz < RATE_Hz / 2:
            raise RecognitionError(f"the plate has modes up to {plate.max_frequency_Hz:g} Hz; needs {RATE_Hz / 2:g}")
        if not QUIET_S <= quiet_s < WAIT_S:
            raise RecognitionError(f"--silence {quiet_s:g}: must be from {QUIET_S:g} s to the length of the record, "
                                   f"less than {WAIT_S:g}")
        self.tapped = bool(plate.frequency_sd.min() <= LEAST_FREQUENCY_SD)  # some modes; others stay unknown
        self.retunes = bool(np.median(plate.frequency_sd) > LEAST_FREQUENCY_SD)
        self.plate, self.channels, self.told, self.prior = plate, channels, prior, prior.widened()
        self.names = [plate.sensor_names[k] for k in channels.accelerometers]
        self.quiet, self.followed = round(quiet_s * RATE_Hz), round(FOLLOWED_S * RATE_Hz)
        self.values = np.zeros((len(self.names) + len(channels.rods), 0))  # which wait, from sample `first` on
        self.recorded, self.recorded_Hz = self.values[:len(self.names)], recorded_Hz  # not yet looked at
        self.first, self.looked = 0, self.quiet
        self.begins: int | None = None  # samples by which it is known how loud stones are
        self.mains, self.hearing_s = Mains(len(self.values), RATE_Hz), 0.0

    @property
    def listens(self) -> bool:
        """Whether it knows how loud stones are."""
        return hasattr(self, "listener")

    def hear(self, values: Floats, recorded: Floats | None = None) -> list[Heard]:
        """The stones that are final with further samples of the channels, `recorded` at recorded_Hz."""
        self.values = np.hstack([self.values, values])
        self.recorded = np.hstack([self.recorded, values[:len(self.names)] if recorded is None else recorded])
        if self.begins is None:
            self._wait()
        if not self.listens and self.begins is not None and self.values.shape[1] >= self.begins:
            self._begin()
        return self._listened() if self.listens else []

    def end(self) -> list[Heard]:
        """Those that are left when no more will come. RecognitionError for a beginning that is longer than all."""
        if not self.listens:
            if self.quiet >= self.values.shape[1]:
                raise RecognitionError(f"--silence {self.quiet / RATE_Hz:g}: must be from {QUIET_S:g} s to the length "
                                       "of the record")
            self.begins = self.values.shape[1]
            self._begin()
        return self._listened(ended=True)

    def checks(self, sums: Sums, heard: Sequence[Heard]) -> Checks:
        """Before a law is learnt, of what was heard in a part of a record."""
        at_s = np.array([h.stone[TIME] for h in heard]) / RATE_Hz
        return Checks(sums.unexplained, sums.gain, together(at_s), self.noise.change, self.unheard)

    def _recorded(self, samples: int, passed: int) -> Floats:
        """The next ones, so many at RATE_Hz, as they were recorded; those that are passed are not looked at again."""
        count, over = (round(n * self.recorded_Hz / RATE_Hz) for n in (samples, passed))
        found, self.recorded = self.recorded[:, :count], self.recorded[:, over:]
        return found

    def _wait(self) -> None:
        """For a stretch that is louder than the quiet. After WAIT_S the quiet is that before the last stretch."""
        size = round(STRETCH_S * RATE_Hz)
        while self.begins is None and self.looked + size <= self.values.shape[1]:
            quiet = self.values[:, :self.quiet]
            if self.looked == self.quiet:
                self.noise = _noise_of(without_offset_and_hum(quiet, RATE_Hz))
            lags = len(self.noise.filter)
            part = self.values[:, self.looked - lags:self.looked + size] - quiet.mean(axis=1, keepdims=True)
            self.looked += size
            if np.mean(self.noise.whitened(part)[:, lags:] ** 2) > LOUDER:
                self.begins = self.looked - size + round((UNTAPPED_S if self.retunes else FIRST_S) * RATE_Hz)
            elif self.looked > WAIT_S * RATE_Hz:
                over = self.looked - self.quiet
                self._recorded(0, over)
                self.first, self.values, self.looked = self.first + over, self.values[:, over:], self.quiet

    def _begin(self) -> None:
        """Learns noise, how loud stones are, and the filter."""
        known = self.values[:, :self.begins]
        begin = self.quiet - LEAD - LOOK_BACK
        refuse_faulty(self._recorded(known.shape[1], begin), self.names)
        self.mains.learn(known, self.first)
        known = known - self.mains.at(self.first, known.shape[1])
        self.noise = _noise_of(known[:, :self.quiet])
        rms = _loud_rms(self.noise.whitened(known))
        for needed, tune in ((self.tapped, shifted), (self.retunes, retuned)):
            if needed:
                self.plate = tune(self.plate, self.channels, known[:, self.quiet:], RATE_Hz, self.noise)
        self.plate = replace(self.plate, frequency_sd=np.full(len(self.plate.frequency_Hz), LEAST_FREQUENCY_SD))
        self.whitening = Whitening.of(self.plate, self.channels, RATE_Hz, self.noise, rms, PHASE_LOSS)
        bank = Bank.of(self.plate, self.channels, self.prior.forces, self.whitening, RATE_Hz)
        self.listener = Listener(bank, self.prior, Dictionary.of(bank, self.prior), self.first + begin)
        self.unheard = self.listener.unheard(self.told)
        self.before, self.values, self.first = known[:, :begin], self.values[:, begin:], self.first + begin
        self.follows = min(known.shape[1] - begin, 2 * self.followed)
        self.loudest, self.lately = abs(known).max(), list[Floats]()
        self.gap, self.anew = max(self.quiet, round(GAP_S * RATE_Hz)), list[tuple[float, float]]()
        self.innovations = [self.whitening(self.before)]
        self.power = float(np.mean(self.innovations[0] ** 2))

    def _listened(self, ended: bool = False) -> list[Heard]:
        """The stones of what is there. After each second, faults are looked for, and offset and hum are followed."""
        began_s, heard, more = process_time(), list[Heard](), True
        while more:
            now, self.values = self.values[:, :self.follows], self.values[:, self.follows:]
            more = self.values.shape[1] > 0
            clean = now - self.mains.at(self.first, now.shape[1])
            self.innovations.append(self.whitening.after(self.before, clean))
            heard += self.listener.hear(self.innovations[-1], ended and not more)
            self.before = np.hstack([self.before, clean])[:, -self.whitening.response.shape[2]:]
            self.first, self.follows = self.first + now.shape[1], self.follows - now.shape[1]
            self.lately.append(now)
            if not self.follows or ended and not more:
                heard += self._follow(np.hstack(self.lately))
        self.hearing_s += process_time() - began_s
        return heard

    def _follow(self, second: Floats) -> list[Heard]:
        """Faults show where it is loud, other noise where nothing falls."""
        loud, recorded = abs(second).max(initial=0.0), self._recorded(second.shape[1], second.shape[1])
        if loud > self.loudest / 2:
            refuse_faulty(recorded, self.names)
            self.loudest = max(self.loudest, loud)
        self.mains.learn(second, self.first - second.shape[1], HUM_MEMORY)
        self.follows, self.lately = self.followed, []
        self.innovations = [np.hstack(self.innovations)[:, -self.gap:]]
        return self._noise_anew(self.innovations[0])

    def _noise_anew(self, gap: Floats) -> list[Heard]:
        """The stones that are final where noise is learnt anew from innovations (c, samples) of a gap. What they have
        of ringing is no more than expected, or fades, where the plate is another."""
        power = float(np.mean(gap**2))
        expected = self.power / OTHER < power < OTHER * max(self.power, 1.0)  # in silence, and while the plate rings
        if expected or gap.shape[1] < self.gap or _unlike(gap) > UNLIKE:
            return []
        noise = SensorNoise.of(gap, max(1 - self.power, 0.0))
        white = noise.whitened(gap)[:, len(noise.filter):]
        if noise.change > CHANGE or _unlike(white) > 1 + UNLIKE_SD * np.sqrt(2 / (BLOCK * len(gap))):
            return []
        before, self.whitening, self.innovations = self.listener, self.whitening.then(noise), []
        heard, bank = before.hear(gap[:, :0], ended=True), before.bank.by(self.whitening)
        self.listener = Listener(bank, self.prior, Dictionary.of(bank, self.prior), before.end)
        self.listener.past, self.unheard = before.total, self.listener.unheard(self.told)
        self.anew.append((before.end / RATE_Hz, power / self.power))
        self.power = float(np.mean(white**2))
        return heard


def _unlike(values: Floats) -> float:
    """Largest energy of a block of channels (c, samples), by the mean."""
    energy = (values[:, :values.shape[1] // BLOCK * BLOCK] ** 2).sum(axis=0).reshape(-1, BLOCK).sum(axis=1)
    return float(energy.max() / energy.mean())


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
