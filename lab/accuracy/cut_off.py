"""Error of a cut-off of the plate's modes in its accelerometers, as they are sampled and behind the anti-alias filter; on
a large plate with its cost. Each is compared with the highest cut-off of its plate."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis import read_run
from common.channels import ACCELEROMETERS
from common.files.whole import write_text
from lab.recognition.anti_alias import WAYS, resampled
from lab.rock.stone import SCENES
from lab.study import Row

ROD = "diameter_m = 0.02, length_m = 0.1, youngs_modulus_Pa = 2.07e11, density_kg_m3 = 7830.0"
LARGE = f"""
base = "{SCENES / 'paper.toml'}"
name = "large"
without = ["time.view_interval_s", "plate.max_frequency_Hz"]
time = {{ duration_s = 0.04, anti_alias = true }}
[stones]
count = 20
gangue_order = {list(range(1, 21))}
positions_m = [{", ".join(f"[{x}, {y}]" for x in (-0.4, -0.2, 0.0, 0.2, 0.4) for y in (-0.225, -0.075, 0.075, 0.225))}]
[plate]
size_m = [1.2, 0.8]
thickness_m = 0.016
rods = [{", ".join(f"{{ place_m = [{x}, {y}], {ROD} }}" for x in (-0.5, 0.0, 0.5) for y in (-0.3, 0.3))}]
"""
SPHERE = f"""
base = "{SCENES / 'elastic_plate.toml'}"
name = "sphere"
time = {{ duration_s = 0.03 }}
stones = {{ radius_m = %g }}
plate = {{ sensors = [{{ name = "north", place_m = [0.0, 0.17] }}, {{ name = "west", place_m = [-0.15, 0.05] }}] }}
"""
SCENES_OF = {"20 stones of 25 mm": LARGE, **{f"sphere of {1000 * r:g} mm": SPHERE % r for r in (0.005,)}}
CUT_OFFS_Hz = {name: (20e3, None) if text is LARGE else (40e3, 10e3, 7e3) for name, text in SCENES_OF.items()}


def cut_off(out: Path) -> Iterator[Row]:
    """Processor time and memory are those from an empty cache to the signals; memory is that of the largest process."""
    found = cache(partial(run, out))
    for name, cut_offs in CUT_OFFS_Hz.items():
        for highest_Hz in cut_offs:
            yield Row({"stones": name, "cut_off_Hz": highest_Hz}, partial(figures, found, name, highest_Hz))


def run(out: Path, name: str, highest_Hz: float | None) -> dict[str, Any]:
    """Samples of the accelerometers in both ways, what run.json says, and the cost."""
    with tempfile.TemporaryDirectory() as work:
        scene = Path(work) / "scene.toml"
        write_text(scene, SCENES_OF[name])
        given = [] if highest_Hz is None else ["--set", f"plate.max_frequency_Hz={highest_Hz}"]
        process = subprocess.Popen(
            [sys.executable, "-m", "gangue", "run", scene, "--out", f"{work}/run", "--quiet", *given], env=os.environ | {"XDG_CACHE_HOME": f"{work}/cache"})
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise RuntimeError(f"{name}: exit code {process.returncode}")
        one = read_run(f"{work}/run")
        taken = {way: resampled(one, filtered).signals for way, filtered in WAYS.items()}
    return {"taken": taken, "summary": one.summary, "cpu_s": used.ru_utime + used.ru_stime,
            "memory_GB": used.ru_maxrss / 1e6}


def figures(found: Any, name: str, highest_Hz: float | None) -> dict[str, Any]:
    this, finest = found(name, highest_Hz), found(name, CUT_OFFS_Hz[name][0])
    summary = this["summary"]
    return {"modes_to_Hz": summary.scene.plate.max_frequency_Hz, "modes": summary.n_modes,
            **{f"error_{way}": worst(this["taken"][way], finest["taken"][way]) for way in this["taken"]},
            "expected": sum(error for key, error in summary.expected_error.items() if key.startswith("modes")),
            "cpu_s": this["cpu_s"], "memory_GB": this["memory_GB"]}


def worst(signals: pd.DataFrame, exact: pd.DataFrame) -> float:
    """Largest relative L2 difference of a sensor."""
    return max(float(np.linalg.norm(signals[name] - exact[name]) / np.linalg.norm(exact[name]))
               for name in exact if str(name).startswith(ACCELEROMETERS))
