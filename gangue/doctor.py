"""`gangue doctor`: what this machine has and lacks, in ten lines."""

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
MEMORY = Path("/proc/meminfo")
NEEDED = 5  # findings to simulate; the others are needed for what they name


@dataclass(frozen=True)
class Finding:
    """What was looked at, whether it is there, and which."""

    name: str
    there: bool
    text: str


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
        return plain(self.findings)


def doctor() -> DoctorResult:
    from dem.coupling.launch import check_engine, library_version  # late: no other command of gangue needs it

    free_GB = _free_memory_GB()
    disk_GB = shutil.disk_usage(".").free / 1e9
    return DoctorResult((
        Finding("program", True, f"{PACKAGE} {version(PACKAGE)} in {Path(__file__).resolve().parents[1]}, "
                                 f"Python {platform.python_version()}"),
        Finding("machine", free_GB > LEAST_FREE_GB, f"{platform.machine()}, {len(os.sched_getaffinity(0))} cores, "
                                                    f"{free_GB:.1f} GB of memory free"),
        Finding("disk", disk_GB > LEAST_FREE_GB, f"{disk_GB:.1f} GB free in {Path.cwd()}"),
        _checked("LIGGGHTS", lambda: f"libliggghts-dev {library_version()}"),
        _checked("engine", lambda: str(check_engine())),
        _programs("MPI ranks", ("mpirun",), "for ranks above 1"),
        _extra("report", ("matplotlib",), "report.html and its figures"),
        _extra("records", ("pyuff", "soundfile", "h5py", "nptdms"), "UFF, FLAC, HDF5 and TDMS records"),
        _extra("tables", ("openpyxl",), "tables for spreadsheets (XLSX)"),
        _extra("campaign", ("snakemake", "snakemake_executor_plugin_slurm"), "campaigns"),
        _programs("ParaView", ("paraview", "pvpython"), "opens view.pvd, on this or any other machine")))


def _free_memory_GB() -> float:
    """What a program could have. Memory that only keeps files for later counts, which sysconf leaves out."""
    (available,) = [line for line in MEMORY.read_text().splitlines() if line.startswith("MemAvailable:")]
    return int(available.split()[1]) * 1024 / 1e9


def _checked(name: str, check: Callable[[], str]) -> Finding:
    try:
        return Finding(name, True, check())
    except (InputError, OSError) as error:  # OSError: no dpkg-query, so no Debian
        return Finding(name, False, str(error))


def _programs(name: str, programs: Iterable[str], use: str) -> Finding:
    found = next(filter(None, map(shutil.which, programs)), None)
    return Finding(name, found is not None, f"{found or ' or '.join(programs) + ' is not on the path'}: {use}")


def _extra(name: str, modules: tuple[str, ...], use: str) -> Finding:
    missing = [module for module in modules if find_spec(module) is None]
    lacks = f"lacks {', '.join(missing)}; pip install '{PACKAGE}[{name}]'"
    return Finding(name, not missing, f"{use}: {lacks if missing else ', '.join(modules)}")
