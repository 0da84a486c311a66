"""The command `volley`: the mixing ratio of stones that arrive at once, or why it has none.

Impulses are those of each number of stones that is told, of gangue among them, and each speed.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
from scipy.special import logsumexp

from common.result import Result
from recognition.estimation.answer import Answer
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import record_table
from recognition.stone_forces.forces import StoneForces, load_forces
from recognition.stream.checks import refuse_faulty, without_offset_and_hum
from recognition.stream.recognise import channels_of
from recognition.volley.moments import (
    BEFORE_S,
    DECIMATION,
    DELAY_STEP_S,
    LENGTH_S,
    MARGIN,
    PHASES,
    REACHES,
    HIGHEST_Hz,
    Likelihood,
    Moments,
    RATE_Hz,
    Stones,
    part_of,
)

#: Impulse of a stone of a volley in m v, of coal and of gangue, where stones fall as near as on the paper's circle and
#: anywhere: `python -m lab run volley_shares`, of ten stones at 3 m/s in the families `ring` and `free` of
#: scenes/dataset.toml. Alone a stone pushes up to 7 % more: here others move the plate away from it, the more the
#: nearer they are.
NEAR_SHARE, FAR_SHARE = np.array([1.749, 1.708]), np.array([1.805, 1.768])
SPEEDS = 11  # between the lowest and the highest
WRONG_SPEED = 0.05  # relative, as which an answer is tried for other speeds
ROOM = 1.15  # of the total impulse beside all that is tried


@dataclass(frozen=True)
class Hypotheses:
    """number, gangue, speed_m_s, prior (n,): each number of stones and of gangue among them, each speed, and their
    probability beforehand: numbers are alike, and so are the counts of gangue of each. total, squares (reaches, n):
    total impulse, N s, and sum of its squares."""

    number: Floats
    gangue: Floats
    speed_m_s: Floats
    prior: Floats
    total: Floats
    squares: Floats

    @classmethod
    def of(cls, stones: Stones, forces: StoneForces) -> Self:
        fewest, most = stones.counts
        low, high = stones.speeds_m_s
        rows = np.array([(number, gangue, speed, 1 / (number + 1)) for number in range(fewest, most + 1)
                         for gangue in range(number + 1)
                         for speed in np.linspace(low, high, SPEEDS if high > low else 1)])
        number, gangue, speed, prior = rows.T
        mass = 4 / 3 * np.pi * stones.radius_m**3 * forces.density_kg_m3
        far = (np.array(REACHES) - REACHES[0]) / (REACHES[-1] - REACHES[0])
        impulse = (NEAR_SHARE + far[:, None] * (FAR_SHARE - NEAR_SHARE)) * mass  # by reach and material, per m/s
        of_each = np.stack([number - gangue, gangue])
        return cls(number, gangue, speed, prior / prior.sum(), impulse @ of_each * speed,
                   impulse**2 @ of_each * speed**2)

    def share(self, weight: Floats) -> Floats:
        """(n,): of gangue, where stones of coal and of gangue weigh `weight` (2,)."""
        gangue = self.gangue * weight[1]
        return np.asarray(gangue / (gangue + (self.number - self.gangue) * weight[0]))

    @property
    def reached(self) -> tuple[Floats, Floats]:
        """(reaches,) each: the least and the largest total impulse, and half of what one stone of gangue in the place
        of one of coal makes."""
        low, high = self.total.min(axis=1), self.total.max(axis=1)
        half = 0.5 * (high - low) / self.number.max()
        return low - half, high + half

    @property
    def ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Between which total impulses and effective numbers of stones all of them lie, and some room."""
        number = self.total**2 / self.squares
        return ((float(self.total.min()) / ROOM, float(self.total.max()) * ROOM),
                (float(number.min()), float(number.max())))


def widened(stones: Stones) -> Stones:
    """With one stone fewer and more and speeds by WRONG_SPEED lower and higher than are told."""
    fewest, most = stones.counts
    low, high = stones.speeds_m_s
    return Stones((max(1, fewest - 1), most + 1), stones.radius_m, (low * (1 - WRONG_SPEED), high * (1 + WRONG_SPEED)))


SILENCE_S = 0.02  # at least so much at the beginning of a record tells the sensors' noise
LOUD = 8.0  # standard deviations of noise
TRIED = range(-3, 5)  # samples between the first that is loud and the arrival
MOST_MISFIT, MOST_OUTSIDE, MOST_GAIN = 1.6, 0.9, 0.1
LEVELS = (0.05, 0.95)
TOTALS = 400  # between which the probability of other stones is summed
COUNTS, RADII_m, SPEEDS_m_s = (2, 30), (0.005, 0.1), (2.0, 3.2)  # faster coal breaks, and pushes less


@dataclass(frozen=True)
class Found:
    """What a record says of the stones that it was told to have; arrival_s: of the first stone."""

    likelihood: Likelihood
    stones: Stones
    forces: StoneForces
    arrival_s: float

    def posterior(self, by_mass: bool = False, stones: Stones | None = None) -> tuple[Floats, Floats]:
        """Mixing ratios (n,), rising, and their probability (n,); stones: others than those told."""
        told = Hypotheses.of(stones or self.stones, self.forces)
        log = logsumexp([self.likelihood.at(k, told.total[k], told.squares[k]) for k in range(len(REACHES))], axis=0)
        weight = told.prior * np.exp(log - log.max())
        share = told.share(self.forces.density_kg_m3 if by_mass else np.ones(2))
        order = np.argsort(share)
        return share[order], weight[order] / weight.sum()

    def ratio(self, by_mass: bool = False, stones: Stones | None = None) -> tuple[float, float, float]:
        """Low end, mean and high end of the 90 % interval of the mixing ratio; stones: others than those told."""
        share, weight = self.posterior(by_mass, stones)
        below = np.cumsum(weight)
        low, high = (float(share[min(int(np.searchsorted(below, level)), len(share) - 1)]) for level in LEVELS)
        return low, float(weight @ share), high

    @property
    def outside(self) -> float:
        """Probability that the total impulse is beyond those of all stones that are told, by half a stone at least."""
        told, every = Hypotheses.of(self.stones, self.forces), self.likelihood
        total = np.exp(np.linspace(every.log_total[0], every.log_total[-1], TOTALS))
        number = np.exp(every.log_number.mean())
        log = np.array([every.at(k, total, total**2 / number) for k in range(len(REACHES))])
        inside = [(total > low) & (total < high) for low, high in zip(*told.reached, strict=True)]
        weight = np.exp(log - log.max())
        return float(1 - weight[np.array(inside)].sum() / weight.sum())

    @property
    def refused(self) -> str:
        """Why no ratio can be trusted, "" if it can."""
        off = self.likelihood.gain - 1
        if self.likelihood.misfit > MOST_MISFIT:
            return (f"such stones on this plate do not explain the record: misfit {self.likelihood.misfit:.2f}, "
                    f"limit {MOST_MISFIT}")
        if np.abs(off).max() > MOST_GAIN:
            worst = off[np.abs(off).argmax()]
            return f"the gain of a channel is {worst:+.0%} off, by what the others hear, limit {MOST_GAIN:.0%}"
        if self.outside > MOST_OUTSIDE:
            return "the stones push harder or less than so many of that size and speed can"
        return ""


def recognise_volley(plate: PlateModel, sensors: Sequence[int], stones: Stones, forces: StoneForces,
                     values: Floats) -> Found:
    """What accelerations (c, samples) at RATE_Hz, which begin with silence, say of stones that arrive at once.

    NotRecognised for a channel that is dead or clipped, and where nothing arrives, or not long enough before the end;
    RecognitionError for a plate that is not known high enough.
    """
    if plate.max_frequency_Hz < HIGHEST_Hz:
        raise RecognitionError(f"the plate has modes up to {plate.max_frequency_Hz:g} Hz; needs {HIGHEST_Hz:g}")
    refuse_faulty(values, [plate.sensor_names[k] for k in sensors])
    values = without_offset_and_hum(values, RATE_Hz)
    noise = values[:, :round(SILENCE_S * RATE_Hz)].std(axis=1)
    if not (noise > 0).all():
        raise NotRecognised("a channel has no noise at all: the record must begin with 20 ms of silence")
    loud = _first_loud(values, noise)
    moments = Moments.of(plate, tuple(sensors), stones, forces, noise)
    starts = [loud + k - round(BEFORE_S * RATE_Hz) for k in TRIED]
    parts = np.array([part_of(values / noise[:, None], start, moments.basis.shape[2]) for start in starts])
    likelihood = Likelihood.of(moments, parts, *Hypotheses.of(widened(stones), forces).ranges)
    arrival_s = (loud + TRIED[likelihood.start]) / RATE_Hz + likelihood.case % PHASES * DELAY_STEP_S
    return Found(likelihood, stones, forces, arrival_s)


def _first_loud(values: Floats, noise: Floats) -> int:
    loud = (abs(values) > LOUD * noise[:, None]).any(axis=0)
    first = int(np.argmax(loud))
    margin = MARGIN * DECIMATION
    before, after = BEFORE_S * RATE_Hz + margin - TRIED[0], LENGTH_S * RATE_Hz + margin + TRIED[-1]
    if not loud.any() or first < max(SILENCE_S * RATE_Hz, before):
        raise NotRecognised("nothing is heard, or not after 20 ms of silence")
    if first + after > values.shape[1]:
        raise NotRecognised(f"the record ends less than {LENGTH_S:g} s after the stones arrive")
    return first


@dataclass(frozen=True)
class VolleyResult(Result):
    """Mixing ratio, by number and by mass, of stones that arrive from `arrival_s` on; others: that by number if the
    stones were a little different from those told.

    refused: why the record was not looked at; not_explained: why it is not of such stones; "" of both for an answer."""

    arrival_s: float | None = None
    misfit: float | None = None
    mixing_ratio: Mapping[str, Answer] = field(default_factory=dict)
    others: Mapping[str, float] = field(default_factory=dict)
    refused: str = ""
    not_explained: str = ""

    def words(self) -> Iterator[str]:
        if self.refused:
            yield f"REFUSED: {self.refused}"
        elif self.not_explained:
            yield f"NOT EXPLAINED, no ratio can be trusted: {self.not_explained}"
        else:
            yield f"stones at {self.arrival_s:.4f} s, misfit {self.misfit:.2f}"
            for name, answer in self.mixing_ratio.items():
                yield f"mixing ratio by {name} {answer.text}"
            yield ("the record does not tell whether the stones are those told; by number it would be "
                   + ", ".join(f"{text} {100 * ratio:.0f} %" for text, ratio in self.others.items()))


def volley(record: str, plate: str, stones: Sequence[int], radius_m: float, speed_m_s: Sequence[float],
           scale: float = 1.0, unit: str | None = None) -> VolleyResult:
    """Judge a record on a plate of `tap` by what is told of the stones: how many, or the fewest and the most; their
    radius; their speed, or the lowest and the highest. Raises RecordError, RecognitionError."""
    counts, speeds_m_s = _between("stones", stones, COUNTS), _between("speed", speed_m_s, SPEEDS_m_s, " m/s")
    if not RADII_m[0] <= radius_m <= RADII_m[1]:
        raise RecognitionError(f"--radius {radius_m:g}: must be from {RADII_m[0]:g} to {RADII_m[1]:g} m")
    known = PlateModel.load(Path(plate))
    table, source = record_table(record, scale, unit)
    try:
        channels, values = channels_of(table, known, source)
        sensors, told = channels.accelerometers, Stones((int(counts[0]), int(counts[1])), radius_m, speeds_m_s)
        found = recognise_volley(known, sensors, told, load_forces(), values[:len(sensors)])
    except NotRecognised as error:
        return VolleyResult(refused=str(error))
    if found.refused:
        return VolleyResult(not_explained=found.refused)
    return VolleyResult(found.arrival_s + float(table["t_s"].iloc[0]), found.likelihood.misfit,
                        {name: Answer.between(*found.ratio(name == "mass")) for name in ("number", "mass")},
                        {text: found.ratio(stones=other)[1] for text, other in _others(found)})


def _others(found: Found) -> Iterator[tuple[str, Stones]]:
    """Stones a little different from those told."""
    (fewest, most), (low, high) = found.stones.counts, found.stones.speeds_m_s
    for more, word in ((-1, "fewer"), (1, "more")):
        yield f"with one stone {word}", replace(found.stones, counts=(fewest + more, most + more))
    for factor, word in ((1 - WRONG_SPEED, "slower"), (1 + WRONG_SPEED, "faster")):
        yield f"{WRONG_SPEED:.0%} {word}", replace(found.stones, speeds_m_s=(low * factor, high * factor))


def _between(name: str, values: Sequence[float], limits: tuple[float, float], unit: str = "") -> tuple[float, float]:
    """One value, or the lower and the higher of two."""
    low, high = values[0], values[-1]
    if len(values) > 2 or not limits[0] <= low <= high <= limits[1]:
        given = " ".join(f"{value:g}" for value in values)
        raise RecognitionError(f"--{name} {given}: must be a number from {limits[0]:g} to {limits[1]:g}{unit}, or two, "
                               "the lower first")
    return low, high
