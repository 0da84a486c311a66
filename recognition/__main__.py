"""Command line: `python -m recognition fit | recognise | report`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from analysis import RecordError, read_sweep
from analysis.readers import read_table
from recognition.errors import RecognitionError
from recognition.models import Model
from recognition.pipeline import FusionPipeline


def main(argv: list[str] | None = None) -> int:
    arguments = _parser().parse_args(argv)
    command = {"fit": fit, "recognise": recognise, "report": report}[arguments.command]
    try:
        command(arguments)
    except (RecordError, RecognitionError) as error:
        print(f"recognition: {error}", file=sys.stderr)
        return 2
    return 0


def fit(arguments) -> None:
    sweep = read_sweep(arguments.directory)
    model = Model.fit(sweep.runs)
    out = Path(arguments.out)
    if not out.parent.is_dir():
        raise RecognitionError(f"--out {out}: no directory {out.parent}")
    model.save(out)
    q = model.methods["fusion_q"].fit_
    print(f"{len(sweep.runs)} runs, ratios {', '.join(f'{r:.0%}' for r in sweep.ratios)}")
    print(f"Q: R^2 {q.r2:.5f}, adjusted {q.r2_adjusted:.5f}")
    for name, method in model.methods.items():
        if isinstance(method, FusionPipeline):
            strategy = method.strategy
            print(f"{name}: functions at {strategy.space_.moments.size} of {strategy.n_moments_} moments")
    print(f"model written to {out}")


def recognise(arguments) -> None:
    model = Model.load(arguments.model)
    path = Path(arguments.record)
    path = path / "signals.parquet" if path.is_dir() else path
    for method, answer in model.recognise(read_table(path), str(path)).items():
        print(f"{method:<22} {answer if isinstance(answer, str) else f'{100 * answer:.2f} %'}")


def report(arguments) -> None:
    from recognition.report import write_report  # late: it needs matplotlib

    print(f"report written to {write_report(arguments.directory)}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m recognition", description="Recognise the gangue mixing ratio."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("fit", help="fit a model to a directory of runs")
    command.add_argument("directory", help="directory of runs ratio_*")
    command.add_argument("--out", required=True, help="model file to write (.json)")
    command = commands.add_parser("recognise", help="mixing ratio of a record")
    command.add_argument("record", help="run directory, .parquet or .csv with t_s and the plate's responses")
    command.add_argument("--model", required=True, help="model file")
    command = commands.add_parser("report", help="write report.html into a directory of runs")
    command.add_argument("directory", help="directory of runs ratio_*")
    return parser


if __name__ == "__main__":
    sys.exit(main())
