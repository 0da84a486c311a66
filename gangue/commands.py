"""The commands: the function that each calls, the arguments that become those of the function, the parser of them, and
the script by which shells complete them."""

import argparse
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from common.process.command import Parser
from common.result import Result

PROGRAM = "gangue"
DESCRIPTION = "Coal and gangue on a steel plate: simulate impacts, analyse records, recognise the mixing ratio."
EXAMPLES = ("gangue doctor", "gangue run scenes/single.toml --out runs/single",
            "gangue sweep scenes/small.toml --out runs/small && gangue report runs/small", "gangue run --help")
EXIT_CODES = """
exit codes:
  0 a result     1 failed             2 bad input, refused in one line
  3 a record without an answer to be trusted        75 stopped at a checkpoint        130 interrupted
"""
JSON_HELP = ("the result as JSON, which says all that the words would; what is told meanwhile goes to the error "
             'output. A command without a result gives {"error": the line that says why, "exit_code": its exit code}')

Argument = tuple[tuple[str, ...], dict[str, Any]]  # of `argparse`


@dataclass(frozen=True)
class Command:
    """`function` (module:name) returns a `common.result.Result`; its parameters are the `arguments`. `examples` follow
    the help."""

    function: str
    help: str
    arguments: tuple[Argument, ...]
    examples: tuple[str, ...]

    @property
    def package(self) -> str:
        """The package that computes the answer, whose `python -m` has this command too."""
        return self.function.partition(".")[0]

    def load(self) -> Callable[..., Any]:
        """Import the function, which may take seconds."""
        module, _, name = self.function.partition(":")
        return getattr(import_module(module), name)


def _arg(*names: str, **settings: Any) -> Argument:
    return names, settings


def _file(name: str, metavar: str, text: str) -> Argument:
    return _arg(name, metavar=metavar, type=Path, help=text)


def _limits(name: str, unit: str, text: str) -> Argument:
    return _arg(f"--{name.partition('_')[0]}", dest=name, type=float, nargs=2, required=True, metavar=("LOW", "HIGH"),
                help=f"{text}, in {unit}")


def _change(text: str) -> tuple[str, Any]:
    """A dotted key of a scene, and its value."""
    import tomllib  # late, as few runs change anything

    key, _, value = text.partition("=")
    try:
        (found,) = tomllib.loads(f"value = {value}").values()
    except (ValueError, RecursionError):
        raise argparse.ArgumentTypeError(f"{text}: must be a dotted key of the scene, =, and a value in TOML") from None
    return key.strip(), found


def _jobs(text: str) -> int:
    with suppress(ValueError):
        if 1 <= int(text) <= 1024:
            return int(text)
    raise argparse.ArgumentTypeError(f"{text}: must be a whole number from 1 to 1024")


def _seconds(text: str) -> float:
    with suppress(ValueError):
        if 0 <= float(text) < float("inf"):
            return float(text)
    raise argparse.ArgumentTypeError(f"{text}: must be a time in s, at least 0")


SCENE = _file("scene_file", "scene", "scene file (TOML)")
OUT = _arg("--out", type=Path, required=True, help="directory to write")
RATIO = _arg("--gangue", dest="gangue_ratio", type=float, help="share of gangue, 0..1, instead of the scene's")
SET = _arg("--set", dest="changes", action="append", default=[], type=_change, metavar="KEY=VALUE",
           help="another value of a key of the scene, as TOML, such as stones.speed_m_s=2.0")
JOBS = _arg("--jobs", type=_jobs, default=2, help="runs, or jobs of a queue, at a time (default 2)")
OVERWRITE = _arg("--overwrite", action="store_true",
                 help="replace runs of other scenes, and discard those that were begun")
WALLTIME = _arg("--walltime", dest="walltime_s", type=_seconds, metavar="SECONDS",
                help="stop at a checkpoint when this time has passed, with exit code 75")
SCALE = _arg("--scale", type=float, default=1.0, help="factor on the samples: the sensor's unit per volt, mV or count")
UNIT = _arg("--unit", help="unit of the scaled samples, such as m/s^2 or g, needed with --scale")
RECORD = _arg("record", help="run directory or record: t_s, acc_NAME_m_s2 or NAME and unit; 20 kHz for stones")
EXPORT = _arg("--out", metavar="FILE", type=Path, help="also write FILE (.csv or .xlsx)")
PLATE = _arg("--plate", required=True, help="plate, from `tap` (.json)")

COMMANDS = {
    "run": Command("dem.commands:run", "simulate one scene", (SCENE, OUT, RATIO, SET, WALLTIME, OVERWRITE), (
        "gangue run scenes/single.toml --gangue 1 --out runs/single",
        "gangue run scenes/paper.toml --set stones.speed_m_s=2.0 --set time.duration_s=0.04 --out runs/slow",
        "gangue --json run scenes/single.toml --out runs/single")),
    "resume": Command("dem.commands:resume", "go on with a run that was stopped or killed, from its last checkpoint", (
        _file("out", "directory", "the --out of the run, with or without .partial"), WALLTIME), (
        "gangue resume runs/single",)),
    "sweep": Command("dem.batch.sweep:sweep", "simulate a scene at every mixing ratio that its stones can give", (
        SCENE, OUT, SET, JOBS, OVERWRITE), (
        "gangue sweep scenes/paper.toml --out runs/paper --jobs 2",
        "gangue sweep scenes/paper.toml --set stones.count=6 --out runs/six")),
    "dataset": Command("dem.batch.dataset:build", "simulate what a plan draws, for recognition", (
        _file("plan_file", "plan", "plan (TOML), such as scenes/dataset.toml"), OUT, JOBS, OVERWRITE,
        _arg("--runs", type=int, metavar="N", help="of each family the first groups with so many (default: all)")), (
        "gangue dataset scenes/dataset.toml --out runs/dataset --runs 44",)),
    "campaign": Command("dem.batch.campaign:campaign", "simulate every combination of values, by Snakemake", (
        _file("file", "file", "campaign (TOML), such as scenes/campaign.toml"), OUT, JOBS,
        _arg("--profile", help="slurm, or a directory with a Snakemake profile (default: this machine)")), (
        "gangue campaign scenes/campaign.toml --out runs/campaign --jobs 2",
        "gangue campaign scenes/campaign.toml --out runs/campaign --jobs 200 --profile slurm")),
    "deck": Command("dem.commands:deck", "write the LIGGGHTS deck of a scene and run nothing", (
        SCENE, OUT, RATIO, SET), (
        "gangue deck scenes/paper.toml --out runs/deck",)),
    "plate": Command("dem.commands:plate", "be the plate of a deck that is run by hand", (SCENE, OUT, RATIO, SET), (
        "gangue plate scenes/paper.toml --out runs/deck",)),
    "calibrate": Command("dem.commands:calibrate", "fit the bonds of a material in virtual tests", (
        _arg("material", help="name of a material of the scene"),
        _arg("--scene", dest="scene_file", type=Path, required=True, help="scene file (TOML)"),
        _arg("--out", type=Path, help="directory for ROCK.toml and ROCK_tests.csv (default: materials/ beside it)"),
        _arg("--rock", help="ROCK (default: what the scene's materials.MATERIAL names, or MATERIAL)"),
        _arg("--targets", metavar="FILE", type=Path, help="lab sheet (TOML; default: the scene's targets.MATERIAL)")), (
        "gangue calibrate gangue --scene my.toml --targets sheet.toml",
        "gangue calibrate coal --scene scenes/paper.toml --out runs/materials")),
    "build-engine": Command("dem.commands:build_engine", "build the engine, where Debian has libliggghts-dev", (), (
        "gangue build-engine",)),
    "modes": Command("plate_fem.commands:modes", "natural frequencies of the plate of a scene", (
        SCENE, _arg("--out", metavar="FILE", type=Path, help="also write the mode shapes to FILE (.vtu)")), (
        "gangue modes scenes/paper.toml",
        "gangue modes scenes/paper.toml --out modes.vtu")),
    "motion": Command("plate_fem.commands:motion", "motion of any point of the plate of a run", (
        _file("directory", "run", "run directory"),
        _arg("--at", dest="at_m", type=float, nargs=2, action="append", required=True, metavar=("X", "Y"),
             help="point from the plate's centre, in m; may be given several times"), EXPORT), (
        "gangue motion runs/single --at 0.1 0 --out motion.csv",)),
    "table": Command("analysis.sweep.run_table:table", "runs in a table: keys that vary, and results", (
        _file("directory", "directory", "directory of a run, a sweep or a campaign"),
        _arg("--stones", action="store_true", help="a row a stone"),
        EXPORT), (
        "gangue table runs/paper --out paper.csv",
        "gangue table runs/campaign --out campaign.xlsx")),
    "features": Command("analysis.commands:features", "time-frequency parameters of a run or of any record", (
        _arg("file", help="run directory, .parquet, .csv, .wav, .flac, .uff, .mat, .h5, .lvm or .tdms"),
        _arg("--column", help="signal to take (default: a_m_s2, or the only one)"),
        _arg("--rate", dest="rate_Hz", type=float, metavar="HZ", help="sample rate, where times are rounded or lack"),
        SCALE, UNIT,
        _arg("--time", metavar="COLUMN", help="column of times (default: the one that is called so)"),
        _arg("--resample", dest="resample_Hz", type=float, metavar="HZ", help="sample rate to go to first"),
        _arg("--no-filter", dest="anti_alias", action="store_false", help="resample without the anti-alias filter")), (
        "gangue features runs/paper/ratio_030",
        'gangue features Messung.csv --column Beschleunigung --time "Zeit [ms]"',
        "gangue features hit.flac --scale 98.1 --unit m/s^2",
        "gangue --json features impact.mat --column acc/north")),
    "fit": Command("recognition.commands:fit", "fit a model of recognition to simulated runs", (
        _arg("directory", help="directory of runs ratio_* or FAMILY/GROUP/ratio_*"),
        _arg("--out", required=True, help="model file to write (.json)")), (
        "gangue fit runs/paper --out model.json",)),
    "recognise": Command("recognition.commands:recognise", "mixing ratio of a record", (
        RECORD, SCALE, UNIT, _arg("--model", required=True, help="model file"),
        _arg("--resample", action="store_true", help="go to the sample rate of the model first"),
        _arg("--plate", help="plate that `tap` wrote, where it is not exactly that of the training")), (
        "gangue recognise runs/other/ratio_040 --model model.json",
        "gangue recognise measured.csv --model model.json --plate plate.json")),
    "evaluate": Command("recognition.commands:evaluate", "error of each method on runs it was not trained on", (
        _arg("directory", help="data set, FAMILY/GROUP/ratio_*; evaluation.csv is written into it"),), (
        "gangue evaluate runs/dataset",)),
    "tap": Command("recognition.tapping.tapped:tap", "learn a plate's modes from taps at known places", (
        _arg("scene_file", metavar="scene", help="scene file whose plate it is thought to be"),
        _arg("taps", help="file with a table [[taps]] a tap: record, place_m (docs/tapping.md)"),
        _arg("--out", required=True, help="file to write the plate to (.json)"),
        _arg("--max-frequency", dest="max_frequency_Hz", type=float, default=6000.0, metavar="HZ",
             help="fit modes and records up to here (default: %(default)g)"),
        _arg("--uff", metavar="FILE", help="also write the modes to FILE (.uff), datasets 15 and 55")), (
        "gangue tap scenes/paper.toml taps.toml --out plate.json",)),
    "check": Command("recognition.sensors.channel_check:check", "look for faults in the channels of a record", (
        RECORD, PLATE, SCALE, UNIT), (
        "gangue check measured.csv --plate plate.json",)),
    "listen": Command("recognition.stream.heard:listen",
                      "stones one by one, and the mixing ratio over time, from a stream", (
        _arg("record", help="run directory or record, at least 20 kHz; live: -, tcp://HOST:PORT (docs/listening.md)"),
        PLATE, SCALE, UNIT, _arg("--out", help="directory for stones.parquet and ratio.parquet; not for what is live"),
        _arg("--follow", action="store_true", help="the record is a file of live samples, which may grow"),
        _arg("--watch", action="store_true", help="draw the ratio of what is live in the terminal, instead of JSON"),
        _limits("radius_m", "m", "between which the stones' radii lie, more or less"),
        _limits("speed_m_s", "m/s", "between which their speeds lie, the components across the plate"),
        _arg("--coal-first", type=int, default=0, metavar="N", help="the first N stones are known to be coal"),
        _arg("--known", dest="known_file", metavar="FILE", help="records of known stones (docs/listening.md)"),
        _arg("--law", metavar="FILE", help="of the forces, by `learn-forces` (default: that of the paper's rock)"),
        _arg("--stop-above", dest="stop_above_percent", type=float, metavar="PERCENT",
             help="alarm where the share of gangue by number rises above"),
        _arg("--false-alarms-per-hour", dest="false_alarms_1_h", type=float, default=1.0, metavar="N",
             help="at most so many at half of that share (default: %(default)g)"),
        _arg("--silence", dest="quiet_s", type=float, default=0.02, metavar="S",
             help="beginning without stones, which tells the noise: 1 s where a machine runs (default: %(default)g s)"),
        _arg("--window", dest="window_s", type=float, default=1.0, metavar="S",
             help="of the ratio (default: %(default)g s)"),
        _arg("--step", dest="step_s", type=float, default=0.1, metavar="S",
             help="between ratios (default: %(default)g s)")), (
        "gangue listen stream.parquet --plate plate.json --radius 0.025 0.025 --speed 2 4 --out runs/heard",
        "gangue listen a.csv --plate p.json --radius 0.02 0.03 --speed 2 4 --coal-first 99 --stop-above 40 --out b",
        "gangue listen - --plate p.json --radius 0.02 0.03 --speed 2 4 --coal-first 99 --stop-above 40")),
    "learn-forces": Command("gangue.learn_forces:learn_forces", "what `listen` believes of one's own rock and plate", (
        SCENE, _arg("--out", type=Path, required=True, help="law to write (.json); runs stay in a directory beside it"),
        _limits("radius_m", "m", "radii"), _limits("speed_m_s", "m/s", "speeds"),
        _arg("--stones", type=int, default=48, metavar="N", help="stones to simulate (default: %(default)d)"), JOBS), (
        "gangue learn-forces scenes/single.toml --radius 0.015 0.035 --speed 2 4 --out law.json",)),
    "volley": Command("recognition.volley.recognise:volley",
                      "mixing ratio of stones that arrive at once on unknown places", (
        RECORD, PLATE, SCALE, UNIT,
        _arg("--stones", type=int, nargs="+", required=True, metavar="N",
             help="how many arrive, where that is certain, or the fewest and the most"),
        _arg("--radius", dest="radius_m", type=float, required=True, metavar="M", help="of all stones"),
        _arg("--speed", dest="speed_m_s", type=float, nargs="+", required=True, metavar="M_S",
             help="of all stones, where that is certain, or the lowest and the highest that it may be")), (
        "gangue volley measured.csv --plate plate.json --stones 8 12 --radius 0.025 --speed 2.5 3.2",)),
    "report": Command("report.page:report", "write report.html of runs; `compare` puts two side by side", (
        _arg("directory", help="run directory, or directory of runs ratio_*"),), (
        "gangue report runs/paper", "gangue report runs/single")),
    "compare": Command("report.comparison:compare", "write a page of what differs between two runs or two sweeps", (
        _file("a", "A", "run directory, or directory of runs ratio_*"), _file("b", "B", "another one of the same kind"),
        _arg("--out", type=Path, help="the page (default: compare_A_B.html beside B)")), (
        "gangue compare runs/before runs/after",
        "gangue compare runs/before/ratio_030 runs/after/ratio_030 --out thirty.html")),
    "scenes": Command("gangue.scenes:scenes", "the shipped scenes, or a copy of one", (
        _arg("name", nargs="?", help="a shipped scene"),
        _arg("--out", metavar="FILE", type=Path, help="copy (default: the scene's name, here)")), (
        "gangue scenes", "gangue scenes paper --out my.toml")),
    "doctor": Command("gangue.doctor:doctor", "what this machine has and lacks to simulate", (), (
        "gangue doctor", "gangue --json doctor")),
    "completion": Command("gangue.commands:completion", "completion of commands for a shell, by shtab", (
        _arg("shell", choices=("bash", "zsh", "tcsh"), help="the shell"),), (
        "gangue completion bash > ~/.local/share/bash-completion/completions/gangue",
        "gangue completion zsh > ~/.zfunc/_gangue")),
}


def parser_of(package: str = "") -> argparse.ArgumentParser:
    """The parser of all commands, or of those of a package."""
    program = f"python -m {package}" if package else PROGRAM
    parser = Parser(prog=program, description=DESCRIPTION, epilog=_examples(EXAMPLES) + EXIT_CODES,
                    formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action=_Version, nargs=0, default=argparse.SUPPRESS,
                        help="version of this program")
    _add_output(parser, False, JSON_HELP)
    commands = parser.add_subparsers(dest="command", required=True, metavar="command", title="commands")
    for name, command in COMMANDS.items():
        if package in ("", command.package):
            sub = commands.add_parser(name, prog=program if package == name else f"{program} {name}", help=command.help,
                                      description=command.help, epilog=_examples(command.examples),
                                      formatter_class=argparse.RawDescriptionHelpFormatter)
            for names, settings in command.arguments:
                sub.add_argument(*names, **settings)
            _add_output(sub, argparse.SUPPRESS, "the result as JSON")  # leaves what was said before the command
            sub.set_defaults(parser=sub)
    return parser


def commands_of(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    return next(action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction))


def _add_output(parser: argparse.ArgumentParser, unsaid: Any, help_of_json: str) -> None:
    """What may stand before or behind the command."""
    parser.add_argument("--quiet", action="store_true", default=unsaid, help="no output but errors and what goes wrong")
    parser.add_argument("--json", action="store_true", default=unsaid, help=help_of_json)


def _examples(lines: tuple[str, ...]) -> str:
    return "examples:\n" + "".join(f"  {line}\n" for line in lines)


class _Version(argparse.Action):
    """Print the version, which takes a while to look up and so is not looked up for anything else."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"{PROGRAM} {version('coal-gangue-impact')}")
        parser.exit()


@dataclass(frozen=True)
class CompletionResult(Result):
    line = "{script}"
    shell: str
    script: str


def completion(shell: str) -> CompletionResult:
    """Write the script. Where a value is not one of a few, files complete it."""
    import shtab  # late: no other command needs it

    parser = parser_of()
    for sub in commands_of(parser).values():
        for action in sub._actions:
            if action.nargs != 0 and not action.choices:
                action.complete = shtab.FILE  # type: ignore[attr-defined]  # shtab's way
    return CompletionResult(shell, shtab.complete(parser, shell, root_prefix=PROGRAM))
