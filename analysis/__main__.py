"""Command line of the analysis: `python -m analysis features FILE`."""

from __future__ import annotations

import argparse
import sys

from common.command import Parser, listen_for_interrupt, run_command, say

if __name__ == "__main__":
    listen_for_interrupt()


def main(argv: list[str] | None = None) -> int:
    """Run a command line and return its exit code: 2, with one line on standard error, for bad input."""
    return run_command("analysis", lambda: _features(_parser().parse_args(argv)))


def _features(arguments: argparse.Namespace) -> int:
    from analysis.features import signal_features  # late, since --help does not need them
    from analysis.readers import read_record
    from analysis.records import RecordError

    try:
        record = read_record(
            arguments.file,
            column=arguments.column,
            rate_Hz=arguments.rate,
            scale=arguments.scale,
            unit=arguments.unit,
            time=arguments.time,
        )
        if arguments.resample is not None:
            from analysis.resample import resample

            record = resample(record, arguments.resample, anti_alias=not arguments.no_filter)
        found = signal_features(record)
    except RecordError as error:
        say(f"analysis: {error}")
        return 2
    print(f"{'name':<28} {'value':>14}  unit")
    for feature in found.values():
        print(f"{feature.name:<28} {feature.value:>14.6g}  {feature.unit}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m analysis", description="Analyse an acceleration record.")
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("features", help="print the time-frequency parameters of a record")
    command.add_argument("file", help="run directory, .parquet, .csv, .wav, .flac, .uff, .mat or .h5")
    command.add_argument("--column", help="signal to take (default: a_m_s2, or the only one)")
    command.add_argument(
        "--rate", type=float, metavar="HZ", help="sample rate, where the file has no time column"
    )
    command.add_argument(
        "--scale", type=float, default=1.0, help="factor on the samples, of the sensor's calibration"
    )
    command.add_argument("--unit", help="unit of the scaled samples, such as m/s^2")
    command.add_argument("--time", metavar="COLUMN", help="column of times (default: the one that is called so)")
    command.add_argument("--resample", type=float, metavar="HZ", help="sample rate to go to first")
    command.add_argument("--no-filter", action="store_true", help="resample without the anti-alias filter")
    return parser


if __name__ == "__main__":
    sys.exit(main())
