"""The command `listen` on samples as they come: what is heard is told at once, a line of JSON each."""

import ctypes
import json
import logging
import platform
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from analysis.signals.records import RecordError
from analysis.signals.resampling import Resampler
from common.result import Result, plain
from recognition.estimation.arrays import Floats
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.innovations.bank import TIME
from recognition.innovations.prior import StonePrior
from recognition.innovations.signatures import LEAD
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import acceleration, known_unit
from recognition.stream.decision import Judge, Judged, Stop
from recognition.stream.listen import PART, PARTS, Heard
from recognition.stream.recognise import LEAST_DOUBT, RATE_SHARE, Ear, RATE_Hz, sensors_of
from recognition.stream.source import Source
from recognition.stream.stone_law import UNKNOWN
from recognition.stream.stones import COLUMNS, Known, cautions, first_touches, ratios_of, rows_of, told_of

_log = logging.getLogger(__name__)
LAST_STONES = 100  # of which the share that is no stone is told
EXPLAINED = 3  # stones that are heard lately before a ratio is told again
CHECKED = 2000  # samples after which what was heard lately is looked at again
WIDTH = 50  # of what is drawn in a terminal
GLIBC = ctypes.CDLL(None) if platform.libc_ver()[0] == "glibc" else None
ONE_HEAP = -8, 1  # arguments of mallopt: no heap of its own for the thread in which a law is learnt
NAMES = ("low", "ratio", "high", "mass_low", "mass_ratio", "mass_high")


@dataclass(frozen=True)
class LiveResult(Result):
    """How many stones were heard and how many alarms there were, until which time. refused: why it ended early;
    not_explained: why no ratio was given in the end."""

    heard: int = 0
    alarms: int = 0
    t_s: float = 0.0
    refused: str = ""
    not_explained: str = ""

    def words(self) -> Iterator[str]:
        event = "REFUSED" if self.refused else "NOT EXPLAINED" if self.not_explained else "end"
        yield json.dumps({"event": event, **self.as_json()}, ensure_ascii=False)


@dataclass(frozen=True)
class Window:
    """Of the ratio, and between ratios."""

    window_s: float
    step_s: float


def listen_live(source: Source, plate: PlateModel, prior: StonePrior, known: Known, stop: Stop | None, window: Window,
                quiet_s: float, scale: float, unit: str | None, watch: bool = False) -> LiveResult:
    """Tell what is heard until no more comes, or can be read, in JSON or, to `watch`, drawn. Raises RecordError,
    RecognitionError."""
    unit = known_unit(source.name, scale, source.unit if unit is None else unit)
    ones = [acceleration(pd.Series([1.0], name=name), scale, unit, source.name) for name in source.channels]
    names = [str(one.name) for one in ones]
    if len(set(names)) < len(names):
        raise RecordError(f"{source.name}: channels = {source.channels}; must be different sensors")
    channels, columns = sensors_of(names, source.rate_Hz, plate, source.name)
    order = [names.index(name) for name in columns]
    factor = np.array([[float(ones[k].iloc[0])] for k in order])
    recorded_Hz = RATE_Hz if abs(source.rate_Hz / RATE_Hz - 1) < RATE_SHARE else round(source.rate_Hz)
    resampler = Resampler(recorded_Hz, RATE_Hz, len(order), source.name)
    recorded_Hz = RATE_Hz * resampler.down / resampler.up
    clock = recorded_Hz / source.rate_Hz
    if GLIBC is not None:
        GLIBC.mallopt(*ONE_HEAP)
    live = Live(Ear(plate, channels, prior, quiet_s, recorded_Hz), prior, known, stop, window)
    if not live.ear.tapped:
        raise RecognitionError("--plate: no mode was tapped; what comes live needs a plate of `tap`")
    try:
        for values in source.blocks():
            values = factor * values[order]
            recorded = values[:len(channels.accelerometers)]
            _tell(live.hear(resampler.more(values), recorded), watch, clock)
        _tell(live.hear(resampler.end(), recorded[:, :0], ended=True), watch, clock)
    except RecognitionError as error:
        if source.broken is None and isinstance(error, NotRecognised):
            return LiveResult(live.count, live.alarms, clock * live.t_s, refused=str(error))
        raise source.broken or error from None
    if source.broken is not None:  # what was heard until then is told
        raise source.broken
    return LiveResult(live.count, live.alarms, clock * live.t_s, not_explained=live.reason)


def _tell(events: Iterator[dict[str, Any]], watch: bool, clock: float) -> None:
    """In times of the source, which are `clock` times those at RATE_Hz."""
    for event in events:
        event["t_s"] *= clock
        if line := watched(event) if watch else json.dumps(plain(event), ensure_ascii=False):
            _log.info(line)
        if event["event"] in ("calibrated", "law") and GLIBC is not None:
            GLIBC.malloc_trim(0)  # it would keep what a filter and a law are made with


def watched(event: dict[str, Any]) -> str:
    """A line of a terminal, "" for an event that has none: the ratio is drawn over its interval, from 0 to 100 %."""
    at = f"{event.get('t_s', 0):8.1f} s "
    if event["event"] == "ratio" and event["stones"]:
        low, middle, high = (round(WIDTH * event[name]) for name in ("low", "ratio", "high"))
        bar = "".join("#" if k == middle else "=" if low <= k <= high else "." for k in range(WIDTH + 1))
        return f"{at}{bar} {event['ratio']:4.0%} of {event['stones']} stones"
    if event["event"] in ("calibrated", "noise learnt", "refused", "explained", "alarm"):
        said = "STOP" if event["event"] == "alarm" else event.get("not_explained", event["event"])
        return f"{at}{said} {event.get('warning', '')}".rstrip()
    return f"{at}UNSAFE, no alarm: too few known stones" if event.get("unsafe") else ""


class Live:
    """What there is to tell of channels (c, samples) at RATE_Hz, as they come. Memory is that of some seconds."""

    def __init__(self, ear: Ear, prior: StonePrior, known: Known, stop: Stop | None, window: Window) -> None:
        self.ear, self.prior, self.known, self.stop, self.window = ear, prior, known, stop, window
        self.coal: list[Heard] = []
        self.before: list[Heard] = []
        self.waiting: list[Heard] = []  # for a law
        self.lately: deque[Heard] = deque()
        self.judge: Judge | None = None
        self.judged: Judged | None = None
        self.none: deque[bool] = deque(maxlen=LAST_STONES)
        self.stones: list[pd.DataFrame] = []  # of the window
        self.count, self.alarms, self.misplaced, self.reason, self.steps, self.checked = 0, 0, 0.0, "", 0, 0

    @property
    def t_s(self) -> float:
        """Until when all stones are known."""
        return (self.ear.listener.at - LEAD) / RATE_Hz if self.ear.listens else 0.0

    def hear(self, values: Floats, recorded: Floats | None = None, ended: bool = False) -> Iterator[dict[str, Any]]:
        """What further samples tell, `recorded` as `Ear.hear` takes them."""
        listened = self.ear.listens
        heard = self.ear.hear(values, recorded) + (self.ear.end() if ended else [])
        if self.ear.listens and not listened:
            self.steps = int(self.t_s / self.window.step_s)
            warning = {"warning": "; ".join(said)} if (said := cautions(self.known, self.prior)) else {}
            yield {"event": "calibrated", "t_s": self.ear.listener.end / RATE_Hz,
                   "noise_change": self.ear.noise.change, **warning}
        if self.ear.listens:
            self.lately += heard
            while self.ear.anew:
                at_s, change = self.ear.anew.pop(0)
                self.lately.clear()
                yield {"event": "noise learnt", "t_s": at_s, "change": change}
            if ended or self.ear.listener.at >= self.checked + CHECKED:
                yield from self._checked()
            if ended or heard:
                yield from self._stones(heard, ended)
            if ended:  # by what the last stones tell
                yield from self._checked()
            yield from self._ratios()

    def _checked(self) -> Iterator[dict[str, Any]]:
        """Whether stones explain what was heard lately."""
        self.checked = self.ear.listener.at
        while self.lately and self.lately[0].stone[TIME] < self.checked - PART * PARTS:
            self.lately.popleft()
        found = self.ear.checks(self.ear.listener.recent, self.lately)
        if self.judged is not None:
            found = replace(found, none=float(np.mean(self.none)), beyond=self.judged.by.law.beyond,
                            misplaced=self.misplaced)
        before, now = self.reason, found.reason()
        self.reason = before if not now and len(self.lately) < EXPLAINED else now
        if self.reason and not before:
            yield {"event": "refused", "t_s": self.t_s, "not_explained": self.reason}
        elif before and not self.reason:
            yield {"event": "explained", "t_s": self.t_s}

    def _stones(self, heard: Sequence[Heard], ended: bool) -> Iterator[dict[str, Any]]:
        own = first_touches(heard, self.before)
        self.before = (self.before + own)[-4:]
        coal = self.known.coal_first - len(self.coal) if self.judge is None else 0
        self.coal, unknown = self.coal + own[:coal], own[coal:]
        if self.judge is None and (unknown or ended):
            _, told = self.known.beside(self.coal, self.ear.prior)
            self.judge = Judge(told, self.prior, self.stop, LEAST_DOUBT)
        if self.judge is None:
            return
        self.waiting += unknown
        at_s = np.array([h.stone[TIME] for h in unknown]) / RATE_Hz
        told = told_of(unknown, self.ear.prior, np.full(len(unknown), UNKNOWN), np.zeros(len(unknown), dtype=bool))
        for judged in self.judge.judge(told, at_s, ended):
            yield from self._judged(judged, self.waiting[:len(judged.none)])
            del self.waiting[:len(judged.none)]

    def _judged(self, judged: Judged, heard: Sequence[Heard]) -> Iterator[dict[str, Any]]:
        """Stones, and alarms unless stones do not explain what is heard."""
        if self.judged is None or judged.by is not self.judged.by:
            known = self.judge.known if self.judge is not None else judged.told
            self.misplaced = judged.by.law.misplaced(known) / max(len(known.x), 1)
            yield {"event": "law", "t_s": self.t_s, "stones": self.count, **_foreseen(judged)}
        self.judged = judged
        self.none += (judged.none >= 0.5).tolist()
        chosen = np.flatnonzero(judged.none < 0.5)
        table = rows_of([heard[k] for k in chosen.tolist()], judged.told.only(chosen), judged.by.law, self.prior,
                        judged.by_law[chosen], np.array(self.none), RATE_Hz)
        if len(table):
            self.stones.append(table)
        self.count += len(table)
        for row, total, alarm in zip(table.to_numpy(), judged.sum[chosen], judged.alarm[chosen], strict=True):
            yield {"event": "stone", **dict(zip(COLUMNS, row, strict=False)), "stop": total}
            if alarm and not self.reason:
                self.alarms += 1
                yield {"event": "alarm", "t_s": row[0]}

    def _ratios(self) -> Iterator[dict[str, Any]]:
        """All that are due, none where stones do not explain what is heard."""
        while (t_s := (self.steps + 1) * self.window.step_s) <= self.t_s:
            self.steps += 1
            if not self.stones:
                continue
            stones = pd.concat(self.stones)
            self.stones = [stones[stones["t_s"] > t_s - self.window.window_s]]
            if self.reason:
                continue
            inside = self.stones[0][self.stones[0]["t_s"] <= t_s]
            values = [value for one in ratios_of(inside) for value in one]
            yield {"event": "ratio", "t_s": t_s, "stones": len(inside), **dict(zip(NAMES, values, strict=True))}


def _foreseen(judged: Judged) -> dict[str, Any]:
    """Of an alarm."""
    found, rate_1_s = judged.by.foreseen, judged.by.rate_1_s
    if found is None:
        return {}
    return {"delay_s": found.delay / rate_1_s, "longest_delay_s": found.longest_delay / rate_1_s,
            "false_alarms_1_h": found.false_alarms_1_h, "unsafe": bool(found.unsafe)}
