"""`gangue doctor`: what this machine has and lacks, in ten lines."""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
from collections.abc import Callable, Iterable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from common.command import Parser
from common.tables import InputError

PACKAGE = "coal-gangue-impact"
LEAST_FREE_GB = 1.0  # of disk and of memory; the default scene takes less than a tenth of either
Line = tuple[str, bool, str]  # what is looked at, whether it is there, and in words


def findings() -> list[Line]:
    """Ten lines; the first five are needed to simulate, the others for what they name."""
    return [_program(), _memory(), _disk(), _library(), _engine(), _ranks(),
            _extra("report", ("matplotlib",), "report.html and its figures"),
            _extra("records", ("pyuff", "soundfile", "h5py"), "UFF, FLAC and HDF5 records"),
            _extra("campaign", ("snakemake", "snakemake_executor_plugin_slurm"), "campaigns"),
            _programs("ParaView", ("paraview", "pvpython"), "opens view.pvd, on this or any other machine")]


NEEDED = 5


def _program() -> Line:
    here = Path(__file__).resolve().parents[1]
    return "program", True, f"{PACKAGE} {version(PACKAGE)} in {here}, Python {platform.python_version()}"


def _memory() -> Line:
    free_GB = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9
    cores = len(os.sched_getaffinity(0))
    return "machine", free_GB > LEAST_FREE_GB, f"{platform.machine()}, {cores} cores, {free_GB:.1f} GB of memory free"


def _disk() -> Line:
    free_GB = shutil.disk_usage(".").free / 1e9
    return "disk", free_GB > LEAST_FREE_GB, f"{free_GB:.1f} GB free in {Path.cwd()}"


def _library() -> Line:
    from dem.coupling.launch import LIGGGHTS_VERSION, check_library

    return _checked("LIGGGHTS", check_library, f"libliggghts-dev {LIGGGHTS_VERSION}")


def _engine() -> Line:
    from dem.coupling.launch import ENGINE, check_engine

    return _checked("engine", check_engine, str(ENGINE))


def _checked(name: str, check: Callable[[], None], there: str) -> Line:
    try:
        check()
    except (InputError, OSError) as error:  # OSError: no dpkg-query, so no Debian
        return name, False, str(error)
    return name, True, there


def _ranks() -> Line:
    return _programs("MPI ranks", ("mpirun",), "for engine.np above 1")


def _programs(name: str, programs: Iterable[str], use: str) -> Line:
    found = next(filter(None, map(shutil.which, programs)), None)
    return name, found is not None, f"{found or ' or '.join(programs) + ' is not on the path'}: {use}"


def _extra(name: str, modules: tuple[str, ...], use: str) -> Line:
    missing = [module for module in modules if find_spec(module) is None]
    lacks = f"lacks {', '.join(missing)}; pip install '{PACKAGE}[{name}]'"
    return name, not missing, f"{use}: {lacks if missing else ', '.join(modules)}"


def main(arguments: list[str], as_json: bool) -> int:
    """Print the lines; return 0 if this machine can simulate, else 1."""
    parser = Parser(prog="gangue doctor", description=(
        "What this machine has and lacks. Exit code 0 if it can simulate, else 1."),
        epilog="examples:\n  gangue doctor\n  gangue --json doctor\n",
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args(arguments)
    lines = findings()
    if as_json:
        print(json.dumps([{"name": name, "there": there, "text": text} for name, there, text in lines], indent=1))
    else:
        for name, there, text in lines:
            print(f"{'has  ' if there else 'lacks'}  {name:<10} {text}")
    return 0 if all(there for _, there, _ in lines[:NEEDED]) else 1
