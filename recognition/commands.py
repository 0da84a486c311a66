"""What the commands on models of recognition answer: `fit`, `recognise` and `evaluate`."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from analysis.sweep.runs import read_sweep
from common.files.output_directory import is_sealed_as, is_stamped, refuse_file, refuse_foreign_file
from common.result import Result
from recognition.estimation.answer import Answer
from recognition.models import FORMAT, Model
from recognition.plate.plate_model import PlateModel
from recognition.plate.records import at_rate, record_table


@dataclass(frozen=True)
class FitResult(Result):
    """A model that was written: of how many runs of which ratios, and what each method says of itself; families of a
    data set, and why runs of it and methods were left out."""

    model: Path
    model_bytes: int
    runs: int
    gangue_ratios: tuple[float, ...]
    methods: Mapping[str, str]
    not_fitted: Mapping[str, str]
    families: tuple[str, ...] = ()
    passed_over: tuple[str, ...] = ()

    def words(self) -> Iterator[str]:
        if self.families:
            yield f"families {', '.join(self.families)}"
        for reason in self.passed_over:
            yield f"passed over: {reason}"
        yield f"{self.runs} runs, ratios {', '.join(f'{ratio:.0%}' for ratio in self.gangue_ratios)}"
        for name, summary in self.methods.items():
            yield f"{name}: {summary}"
        for name, reason in self.not_fitted.items():
            yield f"{name}: not fitted: {reason}"
        yield f"model written to {self.model}, {self.model_bytes / 1e3:.0f} kB"


def fit(directory: str, out: str) -> FitResult:
    """Fit a model to a directory of runs or a data set, and write it to `out` (.json). Raises InputError."""
    from recognition.evaluation import CONDITIONS, read_dataset  # late: no record needs it

    file, families, passed_over = Path(out), list[str](), list[str]()
    refuse_file(out, is_sealed_as(FORMAT), ".json")
    if any(Path(directory).glob("ratio_*")):
        runs = read_sweep(directory).runs
        model = Model.fit(runs)
    else:
        data = read_dataset(directory).calibration()
        runs, families, passed_over = data.runs, list(data.table["family"].unique()), list(data.passed_over)
        model = Model.fit(runs, data.table["kin"].to_numpy(), data.table[list(CONDITIONS)])
    model.save(file)
    return FitResult(file, file.stat().st_size, len(runs), tuple(sorted({run.gangue_ratio for run in runs})),
                     {name: method.summary() for name, method in model.methods.items()}, model.left_out,
                     tuple(families), tuple(passed_over))


@dataclass(frozen=True)
class RecogniseResult(Result):
    """Answer of each method to a record, and the name of the best one, None where none has an interval.

    There are no answers where none can be trusted: `refused` says which sensors are at fault, `out_of_distribution` by
    its name why a method finds the record unlike all that it knows."""

    record: str
    best: str | None
    methods: Mapping[str, Answer]
    warnings: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()
    out_of_distribution: Mapping[str, str] | None = None

    def words(self) -> Iterator[str]:
        if self.refused:
            yield f"REFUSED: {'; '.join(self.refused)}"
        if self.out_of_distribution:
            yield "OUT OF DISTRIBUTION, no answer can be trusted"
            for name, reason in self.out_of_distribution.items():
                yield f"{name:<26} {reason}"
        if self.best is not None:
            yield f"mixing ratio {self.methods[self.best].text}, by {self.best}"
        yield from self.warnings
        for name, answer in self.methods.items():
            unlike = answer.out_of_distribution and f"out of distribution: {answer.out_of_distribution}"
            yield f"{name:<26} {answer.reason or unlike or f'{100 * answer.ratio:.2f} %'}"


def recognise(record: str, model: str, plate: str | None = None, resample: bool = False, scale: float = 1.0,
              unit: str | None = None) -> RecogniseResult:
    """Mixing ratio of a record by a model of `fit`, on a plate of `tap` where it is not that of the training.
    `resample`: at the model's rate; scale, unit: see `record_table`. Raises RecordError, RecognitionError."""
    known = Model.load(model)
    if plate is not None:
        known = known.on_plate(PlateModel.load(Path(plate)))
    table, source = record_table(record, scale, unit)
    resampled = table
    if resample and "t_s" in table:
        resampled = at_rate(table, known.window.rate_Hz, source, known.window.anti_alias)
    answers = known.recognise(resampled, source)
    if faults := known.faults(table):  # resampled, what is clipped is no longer level
        return RecogniseResult(source, None, {}, refused=tuple(faults))
    if vetoes := known.vetoes(answers):
        return RecogniseResult(source, None, {}, out_of_distribution=vetoes)
    best = known.best(answers)
    if best is None:
        return RecogniseResult(source, None, answers)
    name, answer = best
    return RecogniseResult(source, name, answers, (answer.warning,) if answer.warning else ())


@dataclass(frozen=True)
class EvaluateResult(Result):
    line = "written to {evaluation}"
    evaluation: Path


def evaluate(directory: str) -> EvaluateResult:
    """Find the error of each method on runs of a data set that it was not trained on. Raises InputError."""
    from recognition.evaluation import read_dataset, write_evaluation  # late, as in `fit`
    from recognition.methods import METHODS

    refuse_foreign_file(Path(directory) / "evaluation.csv", is_stamped)
    return EvaluateResult(write_evaluation(read_dataset(directory), directory, METHODS))
