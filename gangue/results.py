"""Results of commands as JSON, once the command has ended well: what its files say, or the same call again with every
digit.

A result is given the options of the command and its exit code.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from common.files import read_json
from common.tables import read_toml

Options = argparse.Namespace
SHORT = ("gangue_ratio", "status", "peak_force_N", "impulse_N_s", "n_bonds", "n_bonds_broken", "scene_hash")


def _run(options: Options, _code: int) -> Any:
    directory = options.out.with_name(options.out.name.removesuffix(".partial"))
    return {"directory": str(directory), **(read_json(directory / "run.json") or {})}


def _sweep(options: Options, _code: int) -> Any:
    runs = []
    for file in sorted(options.out.glob("ratio_*/run.json")):
        summary = read_json(file) or {}
        runs.append({"directory": str(file.parent), **{key: summary.get(key) for key in SHORT}})
    return {"directory": str(options.out), "runs": runs}


def _features(options: Options, _code: int) -> Any:
    from analysis import read_record, signal_features
    from analysis.resample import resample

    record = read_record(options.file, column=options.column, rate_Hz=options.rate, scale=options.scale,
                         unit=options.unit, time=options.time)
    if options.resample is not None:
        record = resample(record, options.resample, anti_alias=not options.no_filter)
    found = {f.name: {"value": _number(f.value), "unit": f.unit} for f in signal_features(record).values()}
    return {"record": record.name, "rate_Hz": record.rate_Hz, "samples": record.values.size, "features": found}


def _modes(options: Options, _code: int) -> Any:
    from common.cache import user_cache
    from common.plate import FlexiblePlate, read_plate
    from plate_fem.modes import plate_modes

    plate = read_plate(options.scene)
    assert isinstance(plate, FlexiblePlate)  # the command has refused others
    modes = plate_modes(plate, user_cache())
    return {"theory": modes.theory, "mass_kg": float(modes.mass_kg), "frequency_Hz": modes.frequency_Hz.tolist(),
            "damping_ratio": modes.damping_ratio.tolist()}


def _recognise(options: Options, code: int) -> Any:
    """The best answer is null where the command warns of the whole record."""
    from analysis.readers import read_table
    from recognition import Model

    model = Model.load(options.model)
    path = Path(options.record)
    path = path / "signals.parquet" if path.is_dir() else path
    answers = model.recognise(read_table(path), str(path))
    best = model.best(answers) if code == 0 else None
    found = {name: {"ratio": _number(a.ratio), "low": _number(a.low), "high": _number(a.high),
                    "reason": a.reason or None, "out_of_distribution": a.out_of_distribution or None}
             for name, a in answers.items()}
    return {"out_of_distribution": code != 0, "best": None if best is None else best[0], "methods": found}


def _tap(options: Options, code: int) -> Any:
    """The modes are null where the taps do not suit the plate."""
    from recognition.plate.plate_model import PlateModel

    if code != 0:
        return {"plate": None, "modes": None}
    plate = PlateModel.load(Path(options.out))
    names = ("frequency_Hz", "frequency_sd", "damping_ratio", "damping_sd", "shape_sd")
    return {"plate": str(options.out), "modes": {name: getattr(plate, name).tolist() for name in names}}


def _listen(options: Options, code: int) -> Any:
    """The ratio is that at the end of the record; null where it cannot be trusted."""
    from common.parquet import read_parquet

    last = read_parquet(Path(options.out) / "ratio.parquet").iloc[-1]
    return {"stones": str(Path(options.out) / "stones.parquet"), "explained": code == 0,
            "last": {name: _number(value) for name, value in last.items()}}


def _compare(options: Options, _code: int) -> Any:
    from report.compare_page import page_of

    return {"page": str(options.out or page_of(options.a, options.b))}


def _number(value: float | None) -> float | None:
    """A number of JSON, which has no NaN: null."""
    return None if value is None or value != value or abs(value) == float("inf") else float(value)


RESULTS: dict[str, Callable[[Options, int], Any]] = {
    "run": _run,
    "resume": _run,
    "sweep": _sweep,
    "deck": lambda options, _: {"deck": str(options.out / "deck" / "deck.liggghts")},
    "calibrate": lambda options, _: read_toml(options.out / f"{options.rock or options.material}.toml"),
    "modes": _modes,
    "features": _features,
    "fit": lambda options, _: {"model": str(options.out)},
    "recognise": _recognise,
    "tap": _tap,
    "listen": _listen,
    "report": lambda options, _: {"report": str(Path(options.directory) / "report.html")},
    "compare": _compare,
}
