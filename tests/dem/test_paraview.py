"""A run opened in ParaView itself: every file is read as it was meant, and view.py makes its picture."""

import json
import subprocess

import matplotlib.image
import meshio
import numpy as np
import pytest
from scenes_of_tests import changed

from dem.run.run import run_scene

pytestmark = pytest.mark.validate
READ = """
import json, sys
from paraview import simple
found = {}
for part in sys.argv[2:]:
    reader = simple.PVDReader(FileName=f"{sys.argv[1]}/{part}.pvd")
    t = reader.TimestepValues[8]
    reader.UpdatePipeline(t)
    data = reader.GetDataInformation()
    arrays = {a.Name: a.GetRange(-1 if a.GetNumberOfComponents() > 1 else 0)
              for side in (reader.PointData, reader.CellData) for a in side.values()}
    found[part] = {"times": list(reader.TimestepValues), "points": data.GetNumberOfPoints(),
                   "cells": data.GetNumberOfCells(), "bounds": data.GetBounds(), "arrays": arrays}
print("FOUND" + json.dumps(found))
"""


def paraview(directory, *arguments):
    """Run pvpython on a screen that is none; return what it printed."""
    command = ["xvfb-run", "-a", "-w", "15", "-s", "-screen 0 1700x1100x24 +extension GLX", "pvpython", *map(str, arguments)]
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0 and "ERR|" not in done.stderr, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def opened(runs):
    """Two stones, one of each material, on the plate, and a wall behind them."""
    changes = {"plate.wall_height_m": {"y_plus": 0.1}, "stones.agglomerate.subspheres": 100, "plate.max_frequency_Hz": 2000.0, "time.duration_s": 3e-3}
    run_scene(changed("small", changes), "small", runs / "opened")
    return runs / "opened"


def test_paraview_reads_what_was_written(opened, tmp_path):
    (tmp_path / "read.py").write_text(READ)
    parts = ("particles", "bonds", "plate", "rods", "walls")
    printed = paraview(tmp_path, "read.py", opened, *(f"view/{part}" for part in parts))
    found = {part.removeprefix("view/"): seen for part, seen in json.loads(printed.split("FOUND")[1]).items()}
    for part in parts:
        mesh, seen = meshio.read(opened / "view" / ("walls.vtu" if part == "walls" else f"{part}_0008.vtu")), found[part]
        assert (seen["points"], seen["cells"]) == (len(mesh.points), len(mesh.cells[0].data))
        assert seen["bounds"] == pytest.approx(np.column_stack([mesh.points.min(0), mesh.points.max(0)]).ravel(), abs=1e-9)
        arrays = mesh.point_data | {name: blocks[0] for name, blocks in mesh.cell_data.items()}
        assert set(arrays) == set(seen["arrays"])
        for name, values in arrays.items():
            size = np.linalg.norm(values.astype(float), axis=1) if values.ndim > 1 else values
            assert seen["arrays"][name] == pytest.approx((size.min(), size.max()), rel=1e-6, abs=1e-12)
        assert seen["times"] == found["particles"]["times"]
    assert found["particles"]["times"][:5] == pytest.approx([0, 2e-5, 4e-5, 6e-5, 8e-5])


def test_view_makes_a_picture_with_stones_plate_and_rods(opened, tmp_path):
    paraview(opened, "view.py", tmp_path / "picture.png", 0.0002)
    picture = matplotlib.image.imread(tmp_path / "picture.png")[:850, :, :3]  # without legends
    assert picture.shape[1] == 1600
    dark = (picture.max(axis=2) < 0.3) & (np.ptp(picture, axis=2) < 0.1)  # coal, near grey
    violet = (picture[..., 2] > picture[..., 1] + 0.1)  # the plate where it is not stressed
    sandy = (picture[..., 0] > picture[..., 2] + 0.15) & (picture[..., 1] > picture[..., 2])  # gangue, or high stress
    for kind in (dark, violet, sandy):
        assert 1e-3 < kind.mean() < 0.5
    assert (picture.min(axis=2) > 0.99).mean() > 0.2  # a white background
