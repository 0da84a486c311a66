"""Command line: `python -m recognition fit | recognise | evaluate`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from analysis import RecordError, read_sweep
from analysis.readers import read_table
from recognition.errors import RecognitionError
from recognition.evaluation.dataset import CONDITIONS, read_dataset
from recognition.methods import CALIBRATED
from recognition.models import Model
from recognition.paper.pipeline import FusionPipeline
from recognition.paper.q_parameter import FusionQ
from recognition.physics.arrangement_likelihood import Stones
from recognition.regression.band_energies import CalibratedEnergies


def main(argv: list[str] | None = None) -> int:
    arguments = _parser().parse_args(argv)
    command = {"fit": fit, "recognise": recognise, "evaluate": evaluate}[arguments.command]
    try:
        return command(arguments) or 0
    except (RecordError, RecognitionError) as error:
        print(f"recognition: {error}", file=sys.stderr)
        return 2


def fit(arguments) -> None:
    directory, out = Path(arguments.directory), Path(arguments.out)
    if not out.parent.is_dir():
        raise RecognitionError(f"--out {out}: no directory {out.parent}")
    if any(directory.glob("ratio_*")):
        sweep = read_sweep(directory)
        runs, model = sweep.runs, Model.fit(sweep.runs)
    else:
        data = read_dataset(directory).calibration()
        runs = data.runs
        model = Model.fit(runs, data.table["group"].to_numpy(), data.table[list(CONDITIONS)])
        print(f"families {', '.join(data.table['family'].unique())}")
        for reason in data.passed_over:
            print(f"passed over: {reason}")
    model.save(out)
    print(f"{len(runs)} runs, ratios {', '.join(f'{r:.0%}' for r in sorted({run.gangue_ratio for run in runs}))}")
    for name, method in model.methods.items():
        print(f"{name}: {_fitted(method)}")
    for name, reason in model.left_out.items():
        print(f"{name}: not fitted: {reason}")
    print(f"model written to {out}, {out.stat().st_size / 1e3:.0f} kB")


def _fitted(method) -> str:
    if isinstance(method, FusionPipeline):
        return f"functions at {method.strategy.space_.moments.size} of {method.strategy.n_moments_} moments"
    if isinstance(method, FusionQ):
        return f"R^2 {method.fit_.r2:.5f}, adjusted {method.fit_.r2_adjusted:.5f}"
    if isinstance(method, Stones):
        n = method.numbers_
        return f"{n.stones} stones, {n.low_m_s:.3g} to {n.high_m_s:.3g} m/s, {n.samples} samples of {n.scale.size} signals"
    if isinstance(method, CalibratedEnergies):
        return f"{method.numbers_.mean.size} features, interval of {100 * method.width_ * method.numbers_.usual_error:.1f} points"
    return f"{method.posterior_.variance.size} components, interval of {method.width_:.2f} standard errors"


def recognise(arguments) -> int:
    """0, or 3 for a record outside the calibration."""
    model = Model.load(arguments.model)
    path = Path(arguments.record)
    path = path / "signals.parquet" if path.is_dir() else path
    signals, strange = read_table(path), ""
    answers = model.recognise(signals, str(path))
    if any(name in model.methods and not isinstance(answers[name], str) for name in CALIBRATED):
        name, best = model.best(signals, str(path))
        strange = best.strange
        if strange:
            print(f"OUTSIDE THE CALIBRATION, do not trust: {strange}")
        print(f"mixing ratio {100 * best.ratio:.1f} %, 90 % interval {100 * best.low:.1f} to {100 * best.high:.1f}, "
              f"by {name}")
    why = model.strange(signals, str(path))
    for name, answer in answers.items():
        said = answer if isinstance(answer, str) else f"{100 * answer:.2f} %"
        print(f"{name:<26} {said}" + (f", not to be trusted: {why[name]}" if name in why else ""))
    return 3 if strange else 0


def evaluate(arguments) -> None:
    from recognition.evaluation.cross_validation import write_evaluation
    from recognition.evaluation.error_bounds import write_bounds  # late: they need scikit-learn

    data = read_dataset(arguments.directory)
    print(f"written to {write_evaluation(data, arguments.directory, arguments.method)}")
    print(f"what no method can pass: {write_bounds(data, arguments.directory)}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m recognition", description="Recognise the gangue mixing ratio."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("fit", help="fit a model to a sweep or a data set")
    command.add_argument("directory", help="directory of runs ratio_* or FAMILY/GROUP/ratio_*")
    command.add_argument("--out", required=True, help="model file to write (.json)")
    command = commands.add_parser("recognise", help="mixing ratio of a record")
    command.add_argument("record", help="run directory, .parquet or .csv with t_s and the plate's responses")
    command.add_argument("--model", required=True, help="model file")
    command = commands.add_parser("evaluate", help="what each method makes of runs it was not trained on")
    command.add_argument("directory", help="data set, FAMILY/GROUP/ratio_*; evaluation.csv and bounds.csv are written into it")
    command.add_argument("--method", action="append", help="one method only; may be given several times")
    return parser


if __name__ == "__main__":
    sys.exit(main())
