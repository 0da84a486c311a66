"""Modes of a learnt plate for programs of modal analysis: a universal file, by pyuff (extra `records`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from common.files.whole import written_whole
from recognition.estimation.errors import RecognitionError
from recognition.plate.plate_model import PlateModel

TITLE = "gangue: plate learnt from taps"  # in each of its datasets 55


def is_own(content: bytes) -> bool:
    """Is this a file that `write_modes` wrote?"""
    return TITLE.encode() in content


def write_modes(file: Path, plate: PlateModel) -> None:
    """Write the points of the plate's grid as nodes from 1, row by row along x (dataset 15), and each mode as their
    vertical displacement in kg^-1/2, at a modal mass of 1 (dataset 55). Raises RecognitionError without pyuff."""
    try:
        import pyuff
    except ImportError:
        raise RecognitionError(f"{file}: UFF needs the package pyuff (pip install pyuff)") from None

    x, y = (grid.ravel() for grid in np.meshgrid(plate.lines_x_m, plate.lines_y_m, indexing="ij"))
    nodes, ones, none = np.arange(1, x.size + 1), np.ones(x.size, dtype=int), np.zeros(x.size)
    same = {"model_type": 1, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8, "data_type": 2,
            "n_data_per_node": 3, "node_nums": nodes, "load_case": 1, "modal_m": 1.0, "modal_damp_his": 0.0,
            "id1": TITLE, **{f"id{k}": "NONE" for k in range(2, 6)}}
    sets = [pyuff.prepare_164(units_code=1, units_description="SI", temp_mode=1, length=1.0, force=1.0, temp=1.0,
                              temp_offset=0.0),
            pyuff.prepare_15(node_nums=nodes, def_cs=ones, disp_cs=ones, color=ones, x=x, y=y, z=none)]
    for k, shape in enumerate(plate.grid_shape.reshape(x.size, -1).T):
        sets.append(pyuff.prepare_55(r1=none, r2=none, r3=shape, mode_n=k + 1, freq=float(plate.frequency_Hz[k]),
                                     modal_damp_vis=float(plate.damping_ratio[k]), **same))
    with written_whole(file) as beside:
        pyuff.UFF(str(beside)).write_sets(sets, "add")
