"""Command line: python -m dem run|resume|deck|plate|sweep|campaign|dataset|calibrate|build-engine."""

from __future__ import annotations

import argparse
import shutil
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from common.command import Parser, imports, jobs, listen_for_interrupt, run_command

if __name__ == "__main__":
    listen_for_interrupt()

from common.messages import show_messages
from dem.coupling.exit_code import STOPPED

if TYPE_CHECKING:
    from common.scene import Scene


def main(arguments: list[str] | None = None) -> int:
    """Run a command line; returns the exit code: 2 for bad input, 1 for a run that failed, 75 for one that was
    stopped."""
    show_messages()
    return run_command("dem", lambda: _command(_parser().parse_args(arguments)))


def _command(options: argparse.Namespace) -> int:
    from dem.run.told import exit_code_of  # late, as all below: they take a second, and --help does not need them

    return exit_code_of(lambda: options.command(options))


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m dem", description="Stones that fall on a plate, in LIGGGHTS.")
    commands = parser.add_subparsers(required=True, metavar="command")

    def add(name: str, text: str, command: Callable[[argparse.Namespace], int]) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.set_defaults(command=command)
        return sub

    run = _with_scene(add("run", "run a scene", _run))
    replacers = [run]
    _with_scene(add("deck", "write the deck and run nothing", _deck))
    _with_scene(add("plate", "be the plate of a deck that is run by hand", _plate))
    sub = add("sweep", "run every ratio that the stones can give", _sweep)
    _with_set(sub).add_argument("scene", type=Path, help="scene file (TOML)")
    _with_out(sub, "runs at a time (default 2)")
    replacers.append(sub)
    sub = add("dataset", "run what a plan draws, a data set for recognition", _dataset)
    sub.add_argument("plan", type=Path, help="plan (TOML), scenes/dataset.toml")
    _with_out(sub, "runs at a time (default 2)")
    replacers.append(sub)
    sub = add("campaign", "run every combination of values that a campaign's file lists, by Snakemake",
              _campaign)
    sub.add_argument("file", type=Path, help="campaign (TOML), such as scenes/campaign.toml")
    _with_out(sub, "cores, or jobs in the queue at a time (default 2)")
    sub.add_argument("--profile", help="slurm, or a directory with a Snakemake profile (default: this machine)")
    sub = add("resume", "go on with a run that was stopped or killed, from its last checkpoint", _resume)
    sub.add_argument("out", type=Path, metavar="directory", help="the --out of the run, with or without .partial")
    for replacing in replacers:
        replacing.add_argument("--overwrite", action="store_true",
                               help="replace runs of other scenes, and discard those that were begun")
    for long in (run, sub):
        long.add_argument("--walltime", type=_seconds, metavar="SECONDS",
                          help=f"stop at a checkpoint when this time has passed, with exit code {STOPPED}")
    sub = add("calibrate", "fit the bonds of a material in virtual tests", _calibrate)
    sub.add_argument("material", help="name of a material of the scene")
    sub.add_argument("--scene", type=Path, required=True, help="scene file (TOML)")
    sub.add_argument("--out", type=Path, required=True, help="directory for ROCK.toml and ROCK_tests.csv")
    sub.add_argument("--rock", help="name in scenes/materials/targets.toml; default: MATERIAL")
    sub = add("build-engine", "build the engine, where Debian's libliggghts-dev is installed", _build_engine)
    sub.set_defaults(out="the engine")
    return parser


def _with_scene(sub: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """A command that reads one scene, with what may be changed of it."""
    sub.add_argument("scene", type=Path, help="scene file (TOML)")
    sub.add_argument("--out", type=Path, required=True, help="directory to write")
    sub.add_argument("--gangue", type=float, help="share of gangue, 0..1, instead of the scene's")
    return _with_set(sub)


def _with_set(sub: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """A command that may change keys of a scene."""
    sub.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
                     help="another value of a key of the scene, as TOML, such as stones.speed_m_s=2.0")
    return sub


def _with_out(sub: argparse.ArgumentParser, help_of_jobs: str) -> None:
    """A command that makes many runs."""
    sub.add_argument("--out", type=Path, required=True, help="directory to write")
    sub.add_argument("--jobs", type=jobs, default=2, help=help_of_jobs)


def _changes(options: argparse.Namespace) -> dict[str, Any]:
    """What a command line changes of its scene, by dotted key."""
    from common.tables import InputError

    changes: dict[str, Any] = {}
    for text in options.changes:
        key, _, value = text.partition("=")
        try:
            (changes[key.strip()],) = tomllib.loads(f"value = {value}").values()
        except (ValueError, RecursionError):
            raise InputError(f"--set {text}: must be a dotted key of the scene, =, and a value in TOML") from None
    return changes


def _scene(options: argparse.Namespace) -> Scene:
    """The scene of a command line, with what it changes."""
    from common.scene import changed_scene

    changes = _changes(options)
    if options.gangue is not None:
        changes["stones.gangue_ratio"] = options.gangue
    return changed_scene(options.scene, changes)


def _run(options: argparse.Namespace) -> int:
    with imports():
        from dem.run.run import run_scene
        from dem.run.told import one_line

    print(one_line(run_scene(_scene(options), str(options.scene), options.out, True, options.walltime,
                             options.overwrite)))
    return 0


def _resume(options: argparse.Namespace) -> int:
    from dem.run.run import resume
    from dem.run.told import one_line

    print(one_line(resume(options.out, walltime_s=options.walltime)))
    return 0


def _seconds(text: str) -> float:
    value = float(text)  # a ValueError is refused as well
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text}: must be a time in s, at least 0")
    return value


def _deck(options: argparse.Namespace) -> int:
    from common.cache import user_cache
    from common.output_directory import refuse_place
    from common.tables import InputError
    from dem.deck.render import write_deck
    from dem.run.prepare import prepare

    prepared = prepare(_scene(options), str(options.scene), user_cache())
    refuse_place(options.out)
    if options.out.exists():
        raise InputError(f"--out = {options.out}: must not exist yet")
    try:
        write_deck(options.out / "deck", prepared.scene, prepared.assembly, prepared.step, prepared.modes)
    except BaseException:
        shutil.rmtree(options.out, ignore_errors=True)
        raise
    print(options.out / "deck" / "deck.liggghts")
    return 0


def _plate(options: argparse.Namespace) -> int:
    """Be the plate of an engine that somebody starts, stops and debugs by hand."""
    from common.cache import user_cache
    from common.tables import InputError
    from dem.run.participants import participant_of
    from dem.run.prepare import prepare

    prepared = prepare(_scene(options), str(options.scene), user_cache())
    if not prepared.flexible:
        raise InputError(f"{options.scene}: plate.model = 'rigid': only a flexible plate takes part in a run")
    plate, deck = participant_of(prepared), options.out / "deck"
    with plate.connected(deck):
        plate.take_part(deck, lambda: True, lambda dem_step: None)
    energy = plate.energy()
    print(f"plate: kinetic {energy.kinetic_J:.6g} J, internal {energy.internal_J:.6g} J, "
          f"damped {energy.damped_J:.6g} J")
    return 0


def _sweep(options: argparse.Namespace) -> int:
    with imports():  # for all runs, which are copies of this process
        from dem.batch.sweep import sweep

    return sweep(options.scene, options.out, options.jobs, _changes(options), options.overwrite)


def _dataset(options: argparse.Namespace) -> int:
    with imports():
        from dem.batch.dataset import build

    return build(options.plan, options.out, options.jobs, options.overwrite)


def _campaign(options: argparse.Namespace) -> int:
    from dem.batch.campaign import campaign

    return campaign(options.file, options.out, options.jobs, options.profile)


def _build_engine(options: argparse.Namespace) -> int:
    from dem.coupling.build_engine import build_engine

    return build_engine()


def _calibrate(options: argparse.Namespace) -> int:
    from common.output_directory import refuse_below_a_file
    from dem.calibration.calibrate import calibrate

    name = options.rock or options.material
    refuse_below_a_file(options.out / name)
    _refuse_foreign_calibration(name, options.out)
    calibrate(options.material, options.scene, options.out, rock=options.rock)
    print(options.out / f"{name}.toml")
    return 0


def _refuse_foreign_calibration(material: str, out: Path) -> None:
    """What a calibration would replace must be of an earlier one."""
    from common.output_directory import begins_with, files_in, is_stamped, refuse_foreign_file
    from common.tables import InputError
    from dem.calibration.calibrate import AT_WORK

    if "/" in material:
        return  # no material has such a name, and calibrate says so
    refuse_foreign_file(out / f"{material}.toml", is_stamped)
    refuse_foreign_file(out / f"{material}_tests.csv", begins_with("stage,test,seed,"))
    work = out / f"{material}.partial"
    if not all(map(AT_WORK.fullmatch, files_in(work))):
        raise InputError(f"{work}: is there, and this program did not write it; move it away")


if __name__ == "__main__":
    sys.exit(main())
