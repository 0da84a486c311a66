"""`gangue doctor`: what this machine has and lacks, in ten lines."""

from __future__ import annotations

import os
import platform
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from common.result import Result, plain
from common.tables import InputError

PACKAGE = "coal-gangue-impact"
LEAST_FREE_GB = 1.0  # of disk and of memory; the default scene takes less than a tenth of either
NEEDED = 5  # findings to simulate; the others are needed for what they name


@dataclass(frozen=True)
class Finding:
    """What was looked at, whether it is there, and which."""

    name: str
    there: bool
    text: str


Line = tuple[str, bool, str]  # a finding in the making


@dataclass(frozen=True)
class DoctorResult(Result):
    """What this machine has and lacks."""

    findings: tuple[Finding, ...]

    @property
    def failed(self) -> list[Finding]:
        """What it would need to simulate."""
        return [one for one in self.findings[:NEEDED] if not one.there]

    def words(self) -> Iterator[str]:
        for one in self.findings:
            yield f"{'has  ' if one.there else 'lacks'}  {one.name:<10} {one.text}"

    def as_json(self) -> Any:
        """A list of the findings."""
        return plain(self.findings)


def doctor() -> DoctorResult:
    """Look at this machine."""
    lines = (
        _program(), _memory(), _disk(), _library(), _engine(), _ranks(),
        _extra("report", ("matplotlib",), "report.html and its figures"),
        _extra("records", ("pyuff", "soundfile", "h5py", "nptdms"), "UFF, FLAC, HDF5 and TDMS records"),
        _extra("tables", ("openpyxl",), "tables for spreadsheets (XLSX)"),
        _extra("campaign", ("snakemake", "snakemake_executor_plugin_slurm"), "campaigns"),
        _programs("ParaView", ("paraview", "pvpython"), "opens view.pvd, on this or any other machine"))
    return DoctorResult(tuple(Finding(*line) for line in lines))


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
    from dem.coupling.launch import library_version

    return _checked("LIGGGHTS", lambda: f"libliggghts-dev {library_version()}")


def _engine() -> Line:
    from dem.coupling.launch import ENGINE, check_engine

    def there() -> str:
        check_engine()
        return str(ENGINE)

    return _checked("engine", there)


def _checked(name: str, check: Callable[[], str]) -> Line:
    try:
        return name, True, check()
    except (InputError, OSError) as error:  # OSError: no dpkg-query, so no Debian
        return name, False, str(error)


def _ranks() -> Line:
    return _programs("MPI ranks", ("mpirun",), "for ranks above 1")


def _programs(name: str, programs: Iterable[str], use: str) -> Line:
    found = next(filter(None, map(shutil.which, programs)), None)
    return name, found is not None, f"{found or ' or '.join(programs) + ' is not on the path'}: {use}"


def _extra(name: str, modules: tuple[str, ...], use: str) -> Line:
    missing = [module for module in modules if find_spec(module) is None]
    lacks = f"lacks {', '.join(missing)}; pip install '{PACKAGE}[{name}]'"
    return name, not missing, f"{use}: {lacks if missing else ', '.join(modules)}"
