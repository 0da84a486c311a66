"""LIGGGHTS' dumps as text, read."""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd


def read_dump(file: Path) -> Iterator[tuple[int, np.ndarray]]:
    """Yield DEM step and array (n, columns), sorted by id, of each frame of `dump custom id x y z ...`. Raises
    RuntimeError for a file that is cut off, damaged or something else."""
    with open(file) as lines:
        for line in lines:
            if not line.startswith("ITEM: TIMESTEP"):
                raise RuntimeError(f"{file}: not a dump of the engine")
            dem_step = int(next(lines))
            next(lines)
            count = int(next(lines))
            *_, names = itertools.islice(lines, 5)  # the last is ITEM: ATOMS id x y ...
            columns = range(len(names.split()) - 2)
            text = io.StringIO("".join(itertools.islice(lines, count)))
            frame = pd.read_csv(text, sep=" ", header=None, usecols=columns).to_numpy(dtype=float)
            if len(frame) != count or not np.all(np.isfinite(frame)):
                raise RuntimeError(f"{file}: the frame of step {dem_step} is cut off or damaged")
            yield dem_step, frame[np.argsort(frame[:, 0])]
