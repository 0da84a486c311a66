"""Streams of known truth, and what `listen` makes of them: a table (csv) for each part, for docs/listening.md.

    python -m benchmarks.listening [--out runs/listening] [good | silent | plates | goals | tables ...]

Streams are superpositions (recognition/stream/simulated.py) of forces of single stones (benchmarks/stone_forces.py) on
plates that are not the model's: frequencies, damping and shapes scattered by 1, 10 and 1 % (plates "1" and "2").
Each plate is tapped at the same four places with 20 dB of noise, and what `tap` learnt is what `listen` is given. Places,
arrivals and speeds are unknown, noise is 20 dB at 20 kHz. Rows that are in a table are not made again.

good: streams of the set "tried", from which the limits of recognition/stream/checks.py were set.
silent: the same with something that `listen` is not told.
plates: the same on plates scattered by 3 %, of Kirchhoff's theory and of a solid's modes (known_streams.SOLID).
goals: streams of the sets "held_out", "one_fall" and "any_fall", whose forces no law or limit has seen.
tables: prints what the other parts wrote, a line for each case.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.known_streams import (
    ONE,
    SCENE,
    Case,
    HIGHEST_Hz,
    PAPER_m,
    heard,
    stream,
    tapped,
    told_by_force,
    true_plate,
)
from benchmarks.stream_differences import Difference, differences
from common.files import written_whole
from recognition.evaluation.stone_histories import histories
from recognition.plate.plate_model import PlateModel

#: Goals of the docs: name, case, set of the forces, and how many streams, which fall on the plates "1" and "2" in turn.
GOALS: list[tuple[str, Case, str, int]] = [
    ("100 a second", Case(100, 100), "held_out", 20),
    ("200 a second", Case(200, 100), "held_out", 20),
    ("all sizes, any speed", Case(50, 100, all_sizes=True), "any_fall", 40),
    ("all sizes, 41 stones", Case(50, 100, all_sizes=True), "held_out", 20),
    ("all sizes, one fall", Case(50, 100, all_sizes=True), "one_fall", 20),
    ("20 a second", Case(20, 100), "held_out", 20),
    ("400 stones", Case(100, 400), "held_out", 10),
    ("one accelerometer", Case(20, 60, ONE), "held_out", 20),
    ("volley of ten", Case(100, 30, at_once=10), "held_out", 4)]
PLATES, PLATE_STREAMS, PLATE_RATES_1_s = ("1", "3 %", "other theory", "solid"), 10, (100, 200)
SILENTLY_WRONG = 5.0  # points
SILENT_STREAMS = 60  # of each row: where none is wrong, the rate is below 4.9 % with 95 % confidence


def goals(out: Path) -> None:
    for seed in range(max(streams for *_, streams in GOALS)):
        for name, case, pool, streams in GOALS:
            kind = "12"[seed % 2]
            key: dict[str, object] = {"case": name, "plate": kind, "seed": seed}
            if seed >= streams or there(key, out / "goals.csv"):
                continue
            rng = np.random.default_rng([3, int(case.rate_1_s), case.count, len(case.channels.accelerometers), seed])
            one = replace(case, gangue=rng.uniform(0.2, 0.8))
            record = stream(true_plate(kind), one, histories(pool), rng)
            added({**key, "gangue": one.gangue, **heard(tapped(kind, out), one, record),
                   **told_by_force(one, histories(pool), record.truth)}, out / "goals.csv")


def good(out: Path) -> None:
    pool = histories("tried")
    for number, (kind, rate) in enumerate([(k, r) for k in ("1", "2", "other theory") for r in (20, 50, 100, 200, 50)]):
        key: dict[str, object] = {"plate": kind, "number": number}
        if there(key, out / "good.csv"):
            continue
        rng = np.random.default_rng([5, number])
        case = Case(rate, 60, gangue=rng.uniform(0.2, 0.8), all_sizes=number % 5 == 4)
        record = stream(true_plate(kind), case, pool, rng)
        added({**key, "rate_1_s": rate, "all_sizes": case.all_sizes, **heard(tapped(kind, out), case, record)},
              out / "good.csv")


def plates(out: Path) -> None:
    pool = histories("tried")
    for seed, rate, kind in product(range(PLATE_STREAMS), PLATE_RATES_1_s, PLATES):
        key: dict[str, object] = {"plate": kind, "rate_1_s": rate, "seed": seed}
        if there(key, out / "plates.csv"):
            continue
        rng = np.random.default_rng([17, rate, seed])
        case = Case(rate, 100, gangue=rng.uniform(0.2, 0.8))
        record = stream(true_plate(kind), case, pool, rng)
        added({**key, **heard(tapped(kind, out), case, record)}, out / "plates.csv")


def tables(out: Path) -> None:
    """Errors in points, mean and 95th percentile of their sizes over the streams that were answered."""
    for file, by in (("good", "plate"), ("silent", "differs"), ("plates", ["plate", "rate_1_s"]), ("goals", "case")):
        if (out / f"{file}.csv").is_file():
            rows = pd.read_csv(out / f"{file}.csv", dtype={"plate": str}).fillna({"refused": ""})
            told = pd.DataFrame({name: told_of(part) for name, part in rows.groupby(by, sort=False)}).T
            print(f"\n{file}\n{told.to_string()}")


def told_of(rows: pd.DataFrame) -> dict[str, object]:
    """A line of a table: rows are streams."""
    answered = rows[rows["refused"] == ""]
    warned = answered["warned"].astype(str) == "True"  # strings and NaN, where streams were refused at once
    told: dict[str, object] = {"streams": len(rows), "refused": len(rows) - len(answered), "warned": int(warned.sum())}
    if "number_error" not in answered or answered.empty:
        return told
    for name in ("number", "mass"):
        size = answered[f"{name}_error"].abs()
        told |= {f"{name}_mean": round(size.mean(), 2), f"{name}_95": round(float(np.quantile(size, 0.95)), 2),
                 f"{name}_wrong": int((size > SILENTLY_WRONG).sum()),
                 f"{name}_silently_wrong": int(((size > SILENTLY_WRONG) & ~warned).sum()),
                 f"{name}_inside": int((answered[f"{name}_inside"] == True).sum()),  # noqa: E712, of strings and NaN
                 f"{name}_parts_inside": f"{answered[f'{name}_parts_inside'].sum():g}/{answered['parts'].sum():g}",
                 f"{name}_parts_exact": int(answered[f"{name}_parts_exact"].sum())}
        if f"force_{name}_error" in answered:
            told[f"{name}_by_force"] = round(answered[f"force_{name}_error"].abs().mean(), 2)
    for name in ("stones", "found", "wrong", "none"):
        told[name] = int(answered[name].sum())
    told["s_per_s"] = round(float((answered["hear_s"] / answered["length_s"]).mean()), 2)
    told["unexplained"] = f"{rows['unexplained'].min():.3f} to {rows['unexplained'].max():.3f}"
    return told


def silent(out: Path) -> None:
    """Row by row, those first that were silently wrong before a check was made for them, and at last those with a warning."""
    for difference in differences():
        for seed in range(SILENT_STREAMS):
            key: dict[str, object] = {"differs": difference.name, "seed": seed}
            if there(key, out / "silent.csv"):
                continue
            rng = np.random.default_rng([19, seed])
            case = replace(difference.case, gangue=(0.2, 0.35, 0.5, 0.65, 0.8)[seed % 5])
            added({**key, **_silent_one(difference, case, rng, out)}, out / "silent.csv")


def _silent_one(difference: Difference, case: Case, rng: np.random.Generator, out: Path) -> dict[str, object]:
    pool = histories("tried")
    if difference.stones is not None:
        pool = difference.stones([h for h in pool if abs(h.radius_m - PAPER_m) < 1e-6])
        pool = [replace(h, radius_m=PAPER_m) for h in pool]
    plate = true_plate("1") if difference.plate is None else difference.plate()
    record = stream(plate, case, pool, rng)
    if difference.record is not None:
        record = difference.record(record)
    model = tapped("1", out)
    if difference.untapped:
        model = PlateModel.from_scene(SCENE, HIGHEST_Hz, frequency_sd=0.03, damping_sd=0.5)
    told = replace(case, all_sizes=False, count=len(record.truth))
    return heard(model, told, record)


def there(key: dict[str, object], file: Path) -> bool:
    """Whether a table has a row of that key: what was made before is kept."""
    if not file.is_file():
        return False
    rows = pd.read_csv(file, dtype=str)
    return bool(np.all([rows[name] == str(value) for name, value in key.items()], axis=0).any())


def added(row: dict[str, object], file: Path) -> None:
    print(row, flush=True)
    before = [pd.read_csv(file)] if file.is_file() else []
    with written_whole(file) as beside:
        pd.concat([*before, pd.DataFrame([row])]).to_csv(beside, index=False)


PARTS: dict[str, Callable[[Path], None]] = {
    "good": good, "silent": silent, "plates": plates, "goals": goals, "tables": tables}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=list(PARTS), default=list(PARTS))
    parser.add_argument("--out", type=Path, default=Path("runs/listening"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for part in options.parts:
        PARTS[part](options.out)


if __name__ == "__main__":
    main()
