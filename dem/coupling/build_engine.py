"""Build the engine from the sources in dem/engine, on a machine that has Debian's libliggghts-dev."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from common.tables import InputError
from dem.coupling.launch import SOURCES, build_directory, library_version

TOOLS = {"make": "make", "mpicxx": "libopenmpi-dev", "g++": "g++"}  # and the Debian package of each


def build_engine() -> Path:
    """Build the engine; return where it is. Raises InputError, one line, if LIGGGHTS, a compiler or make is missing, if
    LIGGGHTS is of another version, or after the compiler's errors.
    """
    library_version()
    for tool, package in TOOLS.items():
        if shutil.which(tool) is None:
            raise InputError(f"the engine: {tool} is not installed; it is needed to build it "
                             f"(apt-get install {package})")
    directory = build_directory()
    command = ["make", "-s", "-j", str(os.cpu_count() or 1), "-C", str(SOURCES), f"BUILD={directory}"]
    if subprocess.run(command, check=False).returncode:
        raise InputError("the engine: not built, for what make and the compiler have said")
    return directory / "liggghts-bonded"
