"""What `recognise` makes of records that nothing was fitted to or chosen by.

`dataset` is that of scenes/dataset.toml, on which the model is trained (without what varies, as far as a record does not
tell it); `held_out` that of scenes/dataset_held_out.toml, of other seeds and packings.

- *own plate*: records as they are and with 20 dB of noise, beginning anywhere within 0.3 ms of the impact;
- *tapped plates*: the same forces through plates that are not that of the training: another theory, 1 % thinner, modes
  scattered by 1 to 3 %, a solid. Four taps with 20 dB of noise taught `recognise --plate` each plate up to 12.5 kHz. With
  all sensors, and with accelerometers alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from common.channels import RODS
from lab.known_truth import other_plates
from lab.recognition.differences import (
    Sources,
    beginning,
    exact_plate,
    judged,
    on_plate,
    other_theory,
    solid,
)
from lab.streams.known_streams import learnt_by_taps
from lab.study import Row
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


def recognise_held_out(out: Path, dataset: str = "runs/dataset", held_out: str = "runs/held_out") -> Iterator[Row]:
    """Each record at each noise."""
    data, held = read_dataset(dataset), read_dataset(held_out)
    model = cache(lambda *families: trained(data, families))
    for family, families in (("clean", RINGS), ("damping", (*RINGS, "damping")), ("speed", (*RINGS, "speed"))):
        sources = Sources([held.runs[k] for k in held.of(family)], np.random.default_rng(7))
        records = beginning(lambda rng: int(rng.integers(-60, 61)))(sources)
        for seed, (record, ratio) in enumerate(records):
            for noise in NOISES_dB:
                yield Row({"plate": "own", "records": family, "noise_dB": noise, "record": seed}, partial(
                    lambda families, *rest, ratio: {"true": ratio, **answered(model(*families), *rest)},
                    families, record, noise, seed, ratio=ratio))
    there = cache(lambda name: model(*RINGS).on_plate(tapped(name, out)))
    for name in PLATES:
        sources = Sources([held.runs[k] for k in held.of("clean")], np.random.default_rng(7))
        for seed, (record, ratio) in enumerate(on_plate(lambda _, name=name: PLATES[name]())(sources)):  # type: ignore[misc]
            for sensors in ("all", "accelerometers"):
                kept = [c for c in record.columns.astype(str) if sensors == "all" or not c.startswith(RODS)]
                for noise in NOISES_dB:
                    yield Row({"plate": name, "records": f"ring, {sensors}", "noise_dB": noise, "record": seed}, partial(
                        lambda name, *rest, ratio: {"true": ratio, **answered(there(name), *rest)},
                        name, record[kept], noise, seed, ratio=ratio))


def recognise_held_out_table(rows: pd.DataFrame, out: Path) -> pd.DataFrame:
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
