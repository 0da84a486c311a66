"""Command line: `python -m recognition fit | recognise | evaluate | tap | check | listen | volley`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from common.command import Parser, listen_for_interrupt, run_command, say

if __name__ == "__main__":
    listen_for_interrupt()

if TYPE_CHECKING:
    from recognition.estimation.answer import Answer


def main(argv: list[str] | None = None) -> int:
    """Run a command line and return its exit code: 2, with one line on standard error, for bad input, 3 for a record
    that has no answer to be trusted."""
    return run_command("recognition", lambda: _command(_parser().parse_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    from analysis.records import RecordError  # late, as all below: they take seconds, and --help does not need them
    from common.tables import InputError
    from recognition.estimation.errors import RecognitionError

    command = {"fit": fit, "recognise": recognise, "evaluate": evaluate, "tap": tap, "check": check,
               "listen": listen, "volley": volley}[arguments.command]
    try:
        return command(arguments) or 0
    except (RecordError, RecognitionError, InputError) as error:
        say(f"recognition: {error}")
        return 2


def fit(arguments: argparse.Namespace) -> None:
    from analysis.runs import read_sweep
    from common.output_directory import is_sealed_as, refuse_file
    from recognition.evaluation.dataset import CONDITIONS, read_dataset
    from recognition.models import FORMAT, Model

    directory, out = Path(arguments.directory), Path(arguments.out)
    refuse_file(arguments.out, is_sealed_as(FORMAT))
    if any(directory.glob("ratio_*")):
        sweep = read_sweep(directory)
        runs, model = sweep.runs, Model.fit(sweep.runs)
    else:
        data = read_dataset(directory).calibration()
        runs = data.runs
        model = Model.fit(runs, data.table["kin"].to_numpy(), data.table[list(CONDITIONS)])
        print(f"families {', '.join(data.table['family'].unique())}")
        for reason in data.passed_over:
            print(f"passed over: {reason}")
    model.save(out)
    print(f"{len(runs)} runs, ratios {', '.join(f'{r:.0%}' for r in sorted({run.gangue_ratio for run in runs}))}")
    for name, method in model.methods.items():
        print(f"{name}: {method.summary()}")
    for name, reason in model.left_out.items():
        print(f"{name}: not fitted: {reason}")
    print(f"model written to {out}, {out.stat().st_size / 1e3:.0f} kB")


def recognise(arguments: argparse.Namespace) -> int:
    """0, or 3 without any number where a sensor is at fault, or where a method finds the record unlike all that it
    knows."""
    from analysis.readers import read_table
    from recognition.models import Model
    from recognition.plate.plate_model import PlateModel

    model = Model.load(arguments.model)
    if arguments.plate is not None:
        model = model.on_plate(PlateModel.load(Path(arguments.plate)))
    path = Path(arguments.record)
    path = path / "signals.parquet" if path.is_dir() else path
    table = read_table(path)
    answers = model.recognise(table, str(path))
    if faults := model.faults(table):
        print(f"REFUSED: {'; '.join(faults)}")
        return 3
    if vetoes := model.vetoes(answers):
        print("OUT OF DISTRIBUTION, no answer can be trusted")
        for name, reason in vetoes.items():
            print(f"{name:<26} {reason}")
        return 3
    best = model.best(answers)
    if best is not None:
        _print_best(*best)
    for name, answer in answers.items():
        print(f"{name:<26} {answer.reason or f'{100 * answer.ratio:.2f} %'}")
    return 0


def _print_best(name: str, answer: Answer) -> None:
    print(f"mixing ratio {100 * answer.ratio:.1f} %, 90 % interval {100 * answer.low:.1f} to {100 * answer.high:.1f}, "
          f"by {name}")
    if answer.warning:
        print(answer.warning)


def evaluate(arguments: argparse.Namespace) -> None:
    from common.output_directory import begins_with, refuse_foreign_file
    from recognition.estimation.errors import RecognitionError
    from recognition.evaluation.cross_validation import write_evaluation
    from recognition.evaluation.dataset import read_dataset
    from recognition.methods import METHODS

    names = arguments.method or list(METHODS)
    unknown = [name for name in names if name not in METHODS]
    if unknown:
        raise RecognitionError(f"method {unknown[0]!r}; choose among {', '.join(METHODS)}")
    refuse_foreign_file(Path(arguments.directory) / "evaluation.csv", begins_with("method,held_out,"))
    data = read_dataset(arguments.directory)
    print(f"written to {write_evaluation(data, arguments.directory, {name: METHODS[name] for name in names})}")


def tap(arguments: argparse.Namespace) -> int:
    from recognition.tapping.command import tap as learn

    return learn(arguments)


def check(arguments: argparse.Namespace) -> int:
    from recognition.sensors.command import check as look

    return look(arguments)


def listen(arguments: argparse.Namespace) -> int:
    from recognition.stream.command import listen as hear

    return hear(arguments)


def volley(arguments: argparse.Namespace) -> int:
    from recognition.volley.command import volley as judge

    return judge(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="python -m recognition", description="Recognise the gangue mixing ratio."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("fit", help="fit a model to a sweep or a data set")
    command.add_argument("directory", help="directory of runs ratio_* or FAMILY/GROUP/ratio_*")
    command.add_argument("--out", required=True, help="model file to write (.json)")
    command = commands.add_parser("recognise", help="mixing ratio of a record")
    command.add_argument("record", help="run directory, .parquet or .csv with t_s and the plate's responses")
    command.add_argument("--model", required=True, help="model file")
    command.add_argument("--plate", help="plate that `tap` wrote, where it is not exactly that of the training")
    command = commands.add_parser("evaluate", help="what each method makes of runs it was not trained on")
    command.add_argument("directory",
                         help="data set, FAMILY/GROUP/ratio_*; evaluation.csv is written into it")
    command.add_argument("--method", action="append", help="one method only; may be given several times")
    command = commands.add_parser("tap", help="learn a plate's modes from taps at known places")
    command.add_argument("scene", help="scene file whose plate it is thought to be")
    command.add_argument("taps", help="file with a table [[taps]] a tap: record, x_m, y_m (docs/tapping.md)")
    command.add_argument("--out", required=True, help="file to write the plate to (.json)")
    command.add_argument("--max-frequency", type=float, default=6000.0, metavar="HZ",
                         help="fit modes and records up to here (default: %(default)g)")
    command = commands.add_parser("check", help="look for faults in the channels of a record")
    command.add_argument("record", help="run directory, .parquet or .csv with t_s and acc_NAME_m_s2")
    command.add_argument("--plate", required=True, help="plate that `tap` wrote")
    _add_listen(commands.add_parser("listen", help="stones one by one, and the mixing ratio over time, from a stream"))
    _add_volley(commands.add_parser("volley", help="mixing ratio of stones that arrive at once on unknown places"))
    return parser


def _add_volley(command: argparse.ArgumentParser) -> None:
    command.add_argument("record", help="run directory, .parquet or .csv with t_s and acc_NAME_m_s2, from 20 kHz on")
    command.add_argument("--plate", required=True, help="plate, from `tap` (.json)")
    command.add_argument("--stones", type=int, nargs="+", default=[10], metavar="N",
                         help="how many arrive, or the fewest and the most (default: 10)")
    command.add_argument("--radius", type=float, default=0.025, metavar="M",
                         help="of all stones (default: %(default)g m)")
    command.add_argument("--speed", type=float, nargs="+", default=[3.0], metavar="M_S",
                         help="of all stones, or the lowest and the highest that it may be (default: 3 m/s)")


def _add_listen(command: argparse.ArgumentParser) -> None:
    command.add_argument("record", help="run directory, .parquet or .csv with t_s and acc_NAME_m_s2, from 20 kHz on")
    command.add_argument("--plate", required=True, help="plate, from `tap` (.json)")
    command.add_argument("--out", required=True, help="directory for stones.parquet and ratio.parquet")
    command.add_argument("--radius", type=float, nargs=2, default=(0.025, 0.025), metavar=("LOW", "HIGH"),
                         help="between which the stones' radii lie, in m (default: 0.025 0.025)")
    command.add_argument("--speed", type=float, nargs=2, default=(2.0, 4.0), metavar=("LOW", "HIGH"),
                         help="between which their speeds lie, in m/s (default: 2 4)")
    command.add_argument("--window", type=float, default=1.0, metavar="S", help="of the ratio (default: %(default)g s)")
    command.add_argument("--step", type=float, default=0.1, metavar="S", help="between ratios (default: %(default)g s)")


if __name__ == "__main__":
    sys.exit(main())
