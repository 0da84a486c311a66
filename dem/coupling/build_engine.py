"""Build the engine from the sources in dem/engine, on a machine that has Debian's libliggghts-dev."""

from __future__ import annotations

import logging
import os
import shutil
import subprocess

from common.tables import InputError
from dem.coupling.launch import SOURCES, build_directory, check_library

TOOLS = {"make": "make", "mpicxx": "libopenmpi-dev", "g++": "g++"}  # and the Debian package of each
_log = logging.getLogger(__name__)


def build_engine() -> int:
    """Build the engine and print where it is; return the exit code of make, which prints the compiler's errors.

    Raises InputError, one line, if LIGGGHTS, a compiler or make is missing or LIGGGHTS is of another version.
    """
    check_library()
    for tool, package in TOOLS.items():
        if shutil.which(tool) is None:
            raise InputError(f"the engine: {tool} is not installed; it is needed to build it "
                             f"(apt-get install {package})")
    directory = build_directory()
    code = subprocess.run(["make", "-s", "-j", str(os.cpu_count() or 1), "-C", str(SOURCES), f"BUILD={directory}"],
                          check=False).returncode
    if code == 0:
        _log.info("%s", directory / "liggghts-bonded")
    return code
