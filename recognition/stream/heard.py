"""The command `listen`: the stones of a stream one by one, and the file that says which of them one knows."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from analysis.signals.resampling import rate_ratio
from common.files.output_directory import at_work_in
from common.files.parquet import write_parquet
from common.files.whole import written_whole
from common.result import Result
from common.tables import Table, about, check, read_toml
from recognition.estimation.answer import Answer
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.innovations.prior import StonePrior
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import record_table
from recognition.stone_forces.forces import MATERIALS, SHIPPED, load_forces, refuse_limits
from recognition.stream.decision import CALM, Stop
from recognition.stream.listen import Heard
from recognition.stream.live import Window, listen_live
from recognition.stream.recognise import QUIET_S, RATE_Hz, Recognised, channels_of, hear, recognise_stream
from recognition.stream.source import Source, is_live
from recognition.stream.stones import Known, cautions, ratio_of, sliding_ratio

KIND = "stones heard"
MOST_RATIOS = 100_000
LEAST_STEP_S = 1e-3
UNTAPPED = "WARNING: no mode of the plate was tapped; the ratio may be 10 points off, outside its interval"


@dataclass(frozen=True)
class Alarms:
    """When the share of gangue passed `above`, and what was foreseen of such alarms: their delay by the median law and
    by nine laws in ten, and how many are false in an hour at the constant share `calm` by four in five. unsafe: the
    laws differ too much, and there is no alarm."""

    above: float
    calm: float
    at_s: tuple[float, ...]
    delay_s: float
    longest_delay_s: float
    false_alarms_1_h: float
    unsafe: bool

    def words(self) -> Iterator[str]:
        if self.unsafe:
            yield (f"UNSAFE, no alarm above {self.above:.0%}: too few known stones for so few false alarms; "
                   f"{self.false_alarms_1_h:.2g} an hour, delay {self.delay_s:.2g} to {self.longest_delay_s:.2g} s")
            return
        yield (f"an alarm above {self.above:.0%} comes after {self.delay_s:.2g} s, at most {self.longest_delay_s:.2g}; "
               f"at most {self.false_alarms_1_h:.2g} false alarms an hour at {self.calm:.0%}")
        yield f"STOP at {', '.join(f'{t_s:.2f} s' for t_s in self.at_s[:9])}" if self.at_s else "no alarm"


@dataclass(frozen=True)
class ListenResult(Result):
    """The table of the stones that were heard, that of the ratio over time, and the mixing ratio of all stones by
    number and by mass.

    refused: why nothing was written; not_explained: why the stones that were written give no ratio; "" of both where
    they do."""

    stones: Path | None = None
    ratio_over_time: Path | None = None
    heard: int = 0
    mixing_ratio: Mapping[str, Answer] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    stop: Alarms | None = None
    refused: str = ""
    not_explained: str = ""

    def words(self) -> Iterator[str]:
        if self.refused:
            yield f"REFUSED: {self.refused}"
            return
        yield f"{self.heard} stones, written to {self.stones} and ratio.parquet"
        if self.not_explained:
            yield f"NOT EXPLAINED, no ratio can be trusted: {self.not_explained}"
            return
        yield from self.warnings
        for name, answer in self.mixing_ratio.items():
            yield f"mixing ratio by {name} {answer.text}"
        if self.stop is not None:
            yield from self.stop.words()


def listen(record: str, plate: str, radius_m: tuple[float, float], speed_m_s: tuple[float, float],
           out: str | None = None, follow: bool = False, watch: bool = False, coal_first: int = 0,
           known_file: str | None = None, stop_above_percent: float | None = None, false_alarms_1_h: float = 1.0,
           law: str | None = None, window_s: float = 1.0, step_s: float = 0.1, quiet_s: float = QUIET_S,
           scale: float = 1.0, unit: str | None = None) -> Result:
    """Hear the stones of a record on a plate of `tap`, whose radii and speeds lie between limits, more or less; write
    them and the ratio over a window, every so many seconds, into the directory `out`. For the first quiet_s nothing
    falls. The first `coal_first` stones are known to be coal, those of the records that `known_file` names to be of
    their kind; none of them is among the stones. Above a share of gangue there is an alarm, with so many false ones an
    hour. `law` is of `learn-forces`. A record that is live, or a file to `follow`, is told as it comes, without `out`.
    Raises RecordError, RecognitionError, InputError."""
    refuse_limits(radius_m, speed_m_s)
    prior = StonePrior(load_forces(SHIPPED if law is None else Path(law)), radius_m, speed_m_s)
    if stop_above_percent is None and false_alarms_1_h != 1.0:
        raise RecognitionError("--false-alarms-per-hour: goes with --stop-above")
    stop = None if stop_above_percent is None else Stop(stop_above_percent / 100, false_alarms_1_h)
    tapped = PlateModel.load(Path(plate))
    if coal_first < 0:
        raise RecognitionError(f"--coal-first {coal_first}: must be a number of stones")
    for name, value in (("window", window_s), ("step", step_s)):
        if not LEAST_STEP_S <= value < 1e6:
            raise RecognitionError(f"--{name} {value:g}: must be a time, at least {LEAST_STEP_S:g} s")
    live = follow or is_live(record)
    if live != (out is None):
        raise RecognitionError("--out: must be a directory for a record, and not be given for what comes live")
    if watch and not live:
        raise RecognitionError("--watch: is for what comes live")
    try:
        others = () if known_file is None else read_known(known_file, tapped, prior, scale, unit)
        known = Known(coal_first, others)
        if out is None:
            source = Source(record, follow)
            window = Window(window_s, step_s)
            return listen_live(source, tapped, prior, known, stop, window, quiet_s, scale, unit, watch)
        return _of_record(record, Path(out), tapped, prior, known, stop, Window(window_s, step_s), quiet_s, scale, unit)
    except NotRecognised as error:
        return ListenResult(refused=str(error))


def _of_record(record: str, out: Path, tapped: PlateModel, prior: StonePrior, known: Known, stop: Stop | None,
               window: Window, quiet_s: float, scale: float, unit: str | None) -> ListenResult:
    table, source = record_table(record, scale, unit)
    channels, values = channels_of(table, tapped, source)
    length_s = values.shape[1] / RATE_Hz
    if quiet_s >= length_s:
        raise RecognitionError(f"{source}: {length_s:g} s long; must be longer than its quiet beginning, "
                               f"--silence {quiet_s:g}")
    if not 1 <= (ratios := round(length_s / window.step_s)) <= MOST_RATIOS:
        raise RecognitionError(f"--step {window.step_s:g}: leads to {ratios} ratios over time; must lead to 1 to "
                               f"{MOST_RATIOS}")
    found = recognise_stream(tapped, channels, prior, values, quiet_s, known, stop)
    begin_s, end_s = map(float, table["t_s"].iloc[[0, -1]])
    rate_Hz = (len(table) - 1) / (end_s - begin_s)
    clock = RATE_Hz / rate_Hz / (1 if len(table) == values.shape[1] else rate_ratio(round(rate_Hz), RATE_Hz))
    found = replace(found, stones=found.stones.assign(t_s=clock * found.stones["t_s"]))
    files = out / "stones.parquet", out / "ratio.parquet"
    with at_work_in(out, KIND):
        _write(found.stones.assign(t_s=found.stones["t_s"] + begin_s), files[0])
        ratio = sliding_ratio(found.stones, window.window_s, window.step_s, clock * values.shape[1] / RATE_Hz)
        ratio["t_s"] += begin_s
        if found.refused:
            ratio.iloc[:, 2:] = np.nan
        _write(ratio, files[1])
        (out / "stop.parquet").unlink(missing_ok=True)
    if found.refused:
        return ListenResult(*files, len(found.stones), not_explained=found.refused)
    answers = {name: Answer.between(*ratio_of(found.stones, name == "mass")) for name in ("number", "mass")}
    warnings = ["" if found.hearing.tapped else UNTAPPED, *cautions(known, prior),
                *(answer.warning for answer in answers.values())]
    alarms = None if stop is None or found.followed is None else _alarms(found, stop, begin_s, out)
    return ListenResult(*files, len(found.stones), answers, tuple(filter(None, dict.fromkeys(warnings))), alarms)


def _alarms(found: Recognised, stop: Stop, begin_s: float, out: Path) -> Alarms:
    """What is foreseen of other thresholds is written as well."""
    assert found.followed is not None
    foreseen, t_s = found.followed.foreseen, found.stones["t_s"].to_numpy()
    each_s = float(np.ptp(t_s)) / max(len(t_s), 1)
    _write(pd.DataFrame([(h, false, each_s * delay, h == foreseen.threshold) for h, false, delay in foreseen.tried],
                        columns=["threshold", "false_alarms_1_h", "delay_s", "chosen"]), out / "stop.parquet")
    return Alarms(stop.above, CALM * stop.above, tuple((t_s[found.stones["alarm"]] + begin_s).tolist()),
                  foreseen.delay * each_s, foreseen.longest_delay * each_s, foreseen.false_alarms_1_h, foreseen.unsafe)


def _write(table: pd.DataFrame, file: Path) -> None:
    with written_whole(file) as beside:
        write_parquet(table, beside)


class KnownTable(Table):
    """One record of stones that fall on the tapped plate."""

    record: Annotated[str, about("beside this file, as `listen` takes it")]
    kind: Annotated[Literal["coal", "gangue"], about("of all stones of the record")]
    silence_s: Annotated[float, Field(ge=QUIET_S, le=1e3), about("beginning without stones")] = QUIET_S
    alike: Annotated[bool, about("whether they fall as the unknown ones do, from where those come")] = False


class KnownFile(Table):
    """The whole file."""

    known: Annotated[tuple[KnownTable, ...], Field(min_length=1), about("the records")]


def read_known(path: str | Path, plate: PlateModel, prior: StonePrior, scale: float,
               unit: str | None) -> Sequence[tuple[Sequence[Heard], int, bool]]:
    """The stones of each record that a file names, their material and whether they are alike. Raises InputError for the
    file, RecordError or RecognitionError for a record."""
    content: KnownFile = check(KnownFile, read_toml(path), path)
    return [(_stones(Path(path).parent / one.record, one, plate, prior, scale, unit), MATERIALS.index(one.kind),
             one.alike) for one in content.known]


def _stones(file: Path, one: KnownTable, plate: PlateModel, prior: StonePrior, scale: float,
            unit: str | None) -> Sequence[Heard]:
    table, source = record_table(str(file), scale, unit)
    channels, values = channels_of(table, plate, source)
    try:
        found = hear(plate, channels, prior, values, one.silence_s)
        reason = found.checks.reason()
    except NotRecognised as error:
        reason = str(error)
    if reason:
        raise RecognitionError(f"{source}: known stones are not explained: {reason}")
    return found.heard
