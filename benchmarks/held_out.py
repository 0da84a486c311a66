"""What `recognise` makes of records that nothing was fitted to or chosen by, for docs/recognition.md.

    python -m benchmarks.held_out DATASET HELD_OUT [--out runs/held_out]

DATASET is that of scenes/dataset.toml, on which the model is trained (without what varies, as far as a record does not
tell it); HELD_OUT that of scenes/dataset_held_out.toml, of other seeds and packings. Writes held_out.csv, a row a record;
plates that it has are not tried again. --plate NAME tries one alone:

- *own plate*: records as they are and with 20 dB of noise, beginning anywhere within 0.3 ms of the impact;
- *tapped plates*: the same forces through plates that are not that of the training: another theory, 1 % thinner, modes
  scattered by 1 to 3 %, a solid. Four taps with 20 dB of noise taught `recognise --plate` each plate up to 12.5 kHz. With
  all sensors, and with accelerometers alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.known_streams import learnt_by_taps
from benchmarks.silent_errors import (
    Sources,
    beginning,
    exact_plate,
    judged,
    on_plate,
    other_theory,
    solid,
)
from recognition.evaluation import other_plates
from recognition.evaluation.cross_validation import RINGS
from recognition.evaluation.dataset import CONDITIONS, DataSet, read_dataset
from recognition.models import Model
from recognition.plate.plate_model import PlateModel

NOISES_dB = (None, 20.0)
WRONG_points = 5.0


def scattered(by: float) -> PlateModel:
    return other_plates.scattered(exact_plate(), by, np.random.default_rng([100, round(1000 * by)]))


PLATES: dict[str, Callable[[], PlateModel]] = {
    "that of the training": exact_plate,
    "1 % thinner": partial(exact_plate, 0.99),
    "another theory": other_theory,
    "modes scattered by 1 %": partial(scattered, 0.01),
    "modes scattered by 3 %": partial(scattered, 0.03),
    "a solid": solid,
}


def tapped(name: str, out: Path) -> PlateModel:
    """What taps teach of a plate; kept in a file."""
    file = out / f"plate_{name.replace(' ', '_').replace('%', 'percent')}.json"
    return learnt_by_taps(PLATES[name](), file, np.random.default_rng([200, len(name)]))


def answered(model: Model, record: pd.DataFrame, noise_dB: float | None, seed: int) -> dict[str, object]:
    """The ratio that `recognise` gives with its interval, or why it gives none."""
    found = judged(model, record, noise_dB, np.random.default_rng([seed, int(noise_dB or 0)]))
    if isinstance(found, str):
        return {"refused": found}
    name, answer = found
    return {"refused": None, "method": name, "ratio": answer.ratio, "low": answer.low, "high": answer.high,
            "warned": bool(answer.warning)}


def trained(data: DataSet, families: tuple[str, ...]) -> Model:
    chosen = data.of(*families)
    table = data.table.iloc[chosen]
    return Model.fit([data.runs[k] for k in chosen], table["kin"].to_numpy(), table[list(CONDITIONS)])


def on_own_plate(data: DataSet, held: DataSet) -> Iterator[dict[str, object]]:
    for family, families in (("ring", RINGS), ("damping", (*RINGS, "damping")), ("speed", (*RINGS, "speed"))):
        model = trained(data, families)
        runs = [held.runs[k] for k in held.of(family)]
        rng = np.random.default_rng(7)
        for seed, (record, ratio) in enumerate(beginning(lambda rng: int(rng.integers(-60, 61)))(Sources(runs, rng))):
            for noise in NOISES_dB:
                yield {"plate": "own", "records": family, "noise_dB": noise, "true": ratio,
                       **answered(model, record, noise, seed)}


def on_tapped_plate(data: DataSet, held: DataSet, out: Path, name: str) -> Iterator[dict[str, object]]:
    there, runs = trained(data, RINGS).on_plate(tapped(name, out)), [held.runs[k] for k in held.of("ring")]
    records = on_plate(lambda _: PLATES[name]())(Sources(runs, np.random.default_rng(7)))
    for seed, (record, ratio) in enumerate(records):
        for sensors in ("all", "accelerometers"):
            kept = [c for c in record.columns.astype(str) if sensors == "all" or not c.startswith("rod_")]
            for noise in NOISES_dB:
                yield {"plate": name, "records": f"ring, {sensors}", "noise_dB": noise, "true": ratio,
                       **answered(there, record[kept], noise, seed)}


def report(rows: pd.DataFrame) -> pd.DataFrame:
    """Errors in points of what is answered."""
    rows = rows.assign(error=100 * (rows["ratio"] - rows["true"]).abs(),
                       inside=(rows["low"] - 1e-9 <= rows["true"]) & (rows["true"] <= rows["high"] + 1e-9))
    found = []
    for key, group in rows.fillna({"noise_dB": np.inf, "warned": 0}).groupby(["plate", "records", "noise_dB"], sort=False):
        told = group[group["refused"].isna()]
        found.append({**dict(zip(("plate", "records", "noise_dB"), key, strict=True)), "of": len(group),
                      "answered": len(told), "mean": told["error"].mean(), "p95": told["error"].quantile(0.95),
                      "worst": told["error"].max(), "warned": int(told["warned"].sum()),
                      "wrong": int((told["error"] > WRONG_points).sum()),
                      "silently_wrong": int(((told["error"] > WRONG_points) & (told["warned"] == 0)).sum()),
                      "covers": told["inside"].mean()})
    return pd.DataFrame(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("held_out", type=Path)
    parser.add_argument("--out", type=Path, default=Path("runs/held_out"))
    parser.add_argument("--plate", action="append", choices=("own", *PLATES), help="one only; may be given several times")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    data, held = read_dataset(options.dataset), read_dataset(options.held_out)
    file = options.out / "held_out.csv"
    rows = pd.read_csv(file) if file.is_file() else pd.DataFrame({"plate": []})
    for name in options.plate or ("own", *PLATES):
        if name not in set(rows["plate"]):
            part = on_own_plate(data, held) if name == "own" else on_tapped_plate(data, held, options.out, name)
            rows = pd.concat([rows, pd.DataFrame(part)], ignore_index=True)
            rows.to_csv(file, index=False)
    print(report(rows).to_string(index=False, float_format=lambda x: f"{x:.2f}"), flush=True)


if __name__ == "__main__":
    main()
