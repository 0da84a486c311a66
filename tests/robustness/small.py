"""Small scenes, and programs started beside the tests."""

import contextlib
import io
import os
import subprocess
import sys
import time
from pathlib import Path

from gangue.__main__ import door

ROOT = Path(__file__).resolve().parents[2]
SCENES = ROOT / "scenes"
HERTZ = SCENES / "hertz_coal.toml"


def small_stone(directory, **changes):
    """One breaking stone on a coarse flexible plate; `changes` are further replacements, old text by new."""
    text = (ROOT / "tests" / "single.toml").read_text()
    coarse = {"max_frequency_Hz = 20000.0": "max_frequency_Hz = 1000.0", "subspheres = 500": "subspheres = 60",
              'contact = "smooth"': 'contact = "sub_spheres"',
              "view_interval_s = 1.5e-4": "view_interval_s = 1.5e-3"}
    for old, new in (coarse | changes).items():
        assert old in text, old
        text = text.replace(old, new)
    file = directory / "stone.toml"
    file.write_text(text)
    return file


def start(*arguments, **options):
    """A package of the project as a program, `start("dem", "run", ...)`."""
    options = {"cwd": ROOT, "stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE,
               "text": True, **options}
    return subprocess.Popen([sys.executable, "-m", *map(str, arguments)], **options)


def run(package, *words):
    """Exit code, output and errors of a command line of a package, in this process."""
    output, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        code = door(package)([str(word) for word in words])
    return code, output.getvalue(), errors.getvalue()


def what_was_said(errors):
    """Lines on standard error but those of a run's progress and stages and those that warn."""
    return [line for line in errors.splitlines()
            if not (" left " in line or line.endswith(" ...") or line.startswith("warning: "))]


def below(pid):
    """Every process below one, with the name of its program."""
    found = []
    try:
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in (task / "children").read_text().split():
                found += [(int(child), os.readlink(f"/proc/{child}/exe")), *below(child)]
    except OSError:
        pass  # gone meanwhile
    return found


def wait_until(condition, process, what):
    """Look again and again until the condition holds; an error if the process ends first."""
    deadline = time.monotonic() + 3000
    while not (found := condition()):
        assert process.poll() is None and time.monotonic() < deadline, (what, process.poll(), process.stderr.read())
        time.sleep(0.02)
    return found


def is_alive(pid):
    """Is there such a process, and no zombie?"""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
