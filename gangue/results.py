"""Results of commands as JSON: from the files that a command leaves, or from a call in its place."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from common.files import read_json
from common.tables import read_toml

Options = argparse.Namespace
SHORT = ("gangue_ratio", "status", "peak_force_N", "impulse_N_s", "n_bonds", "n_bonds_broken", "scene_hash")


def _run(options: Options) -> Any:
    directory = options.out.with_name(options.out.name.removesuffix(".partial"))
    return {"directory": str(directory), **(read_json(directory / "run.json") or {})}


def _sweep(options: Options) -> Any:
    runs = []
    for file in sorted(options.out.glob("ratio_*/run.json")):
        summary = read_json(file) or {}
        runs.append({"directory": str(file.parent), **{key: summary.get(key) for key in SHORT}})
    return {"directory": str(options.out), "runs": runs}


#: By command: what its files say.
RESULTS: dict[str, Callable[[Options], Any]] = {
    "run": _run,
    "resume": _run,
    "sweep": _sweep,
    "deck": lambda options: {"deck": str(options.out / "deck" / "deck.liggghts")},
    "calibrate": lambda options: read_toml(options.out / f"{options.material}.toml"),
    "fit": lambda options: {"model": str(options.out)},
    "report": lambda options: {"report": str(Path(options.directory) / "report.html")},
}


def result_of_call(name: str, options: Options) -> tuple[int, Any]:
    """Exit code and result of `features`, `modes` or `recognise`; 2 and None, with one line, for bad input."""
    from analysis.records import RecordError
    from common.tables import InputError
    from recognition.estimation.errors import RecognitionError

    calls: dict[str, Callable[[Options], tuple[int, Any]]] = {
        "features": _features, "modes": _modes, "recognise": _recognise}
    try:
        return calls[name](options)
    except (InputError, RecordError, RecognitionError) as error:
        print(error, file=sys.stderr)
        return 2, None


def _features(options: Options) -> tuple[int, Any]:
    from analysis import read_record, signal_features
    from analysis.resample import resample

    record = read_record(options.file, column=options.column, rate_Hz=options.rate, scale=options.scale,
                         unit=options.unit, time=options.time)
    if options.resample is not None:
        record = resample(record, options.resample, anti_alias=not options.no_filter)
    found = {f.name: {"value": _number(f.value), "unit": f.unit} for f in signal_features(record).values()}
    return 0, {"record": record.name, "rate_Hz": record.rate_Hz, "samples": record.values.size, "features": found}


def _modes(options: Options) -> tuple[int, Any]:
    from plate_fem.__main__ import modes_of, write_shapes

    modes = modes_of(options.scene, options.out)
    if options.out is not None:
        write_shapes(modes, options.out)
    return 0, {"theory": modes.theory, "mass_kg": float(modes.mass_kg), "frequency_Hz": modes.frequency_Hz.tolist(),
               "damping_ratio": modes.damping_ratio.tolist()}


def _recognise(options: Options) -> tuple[int, Any]:
    """Exit code 3 for a record out of distribution, as without --json."""
    from analysis.readers import read_table
    from recognition import Model

    model = Model.load(options.model)
    path = Path(options.record)
    path = path / "signals.parquet" if path.is_dir() else path
    answers = model.recognise(read_table(path), str(path))
    best = model.best(answers)
    found = {name: {"ratio": _number(a.ratio), "low": _number(a.low), "high": _number(a.high),
                    "reason": a.reason or None, "out_of_distribution": a.out_of_distribution or None}
             for name, a in answers.items()}
    result = {"best": None if best is None else best[0], "methods": found}
    return 3 if best is not None and best[1].out_of_distribution else 0, result


def _number(value: float | None) -> float | None:
    """A number of JSON, which has no NaN: null."""
    return None if value is None or value != value or abs(value) == float("inf") else float(value)
