"""All that the page's view shows of one run, packed as one JSON object a run."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from analysis import Run
from analysis.sweep.breakage import Network
from common.scene.plate import wall_box_m
from report.drawing.lines import envelope
from report.film.packing import LARGEST, OUTSIDE, pack, pack_moving, quantised
from report.film.pictures import EARLY, IMPACT, Film, Series, choose, instants, read_film
from report.film.still import largest_force_s
from report.missing import MissingResult

QUANTUM_M = (2e-5, 5e-5)  # of positions, at most a fiftieth of a sub-sphere; finer where stones stay near
FEW = 40  # pictures
CURVE_POINTS = 900  # about the pixels of a curve's width

#: Of all films of a page, some half of it; what did not fit is named in the page.
BUDGET_BYTES = 6_500_000


@dataclass(frozen=True)
class Reel:
    """The packed film of one run. key: in the page. label: the ratio. json: for templates/film.js."""

    key: str
    label: str
    json: str


@dataclass(frozen=True)
class Films:
    """The reels of a page, shown: number of the one shown first, still: the picture that stands in its place, left_out:
    what the page does not hold and why."""

    reels: list[Reel]
    shown: int
    still: str
    left_out: list[str]


def pack_films(run: Run, network: Network, share: float, wanted: tuple[Series, ...]) -> str:
    """Pack a run into its share of the budget, 0..1, with fewer pictures where they are too many, and the first of the
    `wanted` series alone where even few of all are. Raises one of MISSING_RESULT."""
    for some in dict.fromkeys((wanted, wanted[:1])):
        if packed := _packed(run, network, share * BUDGET_BYTES, some):
            return packed
    raise MissingResult("the page would be too large")


def _packed(run: Run, network: Network, room: float, wanted: tuple[Series, ...]) -> str:
    """Of many pictures a few are packed first, as that costs least; then twice as many, which take less than twice the
    room."""
    if len(instants(run.path)) <= FEW and len(all_of_them := pack_run(run, network, wanted)) <= room:
        return all_of_them
    packed, taken = "", 8
    for fewer in (8, 4, 2, 1):
        if packed and fewer > 1 and 2 * len(packed) * taken / fewer <= room:
            continue  # twice as many as these are sure to fit
        text = pack_run(run, network, tuple(replace(series, most=series.most // fewer) for series in wanted))
        if len(text) > room:
            break
        packed, taken = text, fewer
    return packed


def films_of(labels: Sequence[str], packed: Sequence[tuple[str, str] | Exception], main: int) -> Films:
    """The films of a page from that of each run (`pack_films`) and its still picture, or why it has none."""
    left_out = [f"{label}: {one}" for label, one in zip(labels, packed, strict=True) if isinstance(one, Exception)]
    found = {k: one for k, one in enumerate(packed) if not isinstance(one, Exception)}
    reels = [Reel(f"film-{k}", labels[k], film) for k, (film, _) in found.items()]
    return Films(reels, list(found).index(main) if main in found else 0, found[main][1] if main in found else "",
                 left_out)


def pack_run(run: Run, network: Network, wanted: tuple[Series, ...]) -> str:
    """Pack one run: bodies, bonds, and each series that has pictures. Raises MissingResult if none has two."""
    found, peak_s = instants(run.path), largest_force_s(run)
    if found:  # the whole run, wanted last, is no longer than some others
        wanted = tuple(s for s in wanted if s.until_s <= found[-1].t_s or s is wanted[-1])
    if IMPACT.until_s < peak_s < EARLY.until_s:  # of stones that come one after the other
        wanted = tuple(replace(s, until_s=peak_s + IMPACT.until_s) if s.key == IMPACT.key else s for s in wanted)
    chosen = {s: some for s in wanted if len(some := choose(found, s)) > 1}
    if not chosen:
        raise MissingResult("the run has fewer than two pictures")
    times_s = {instant.t_s for some in chosen.values() for instant in some}
    shown = [instant for instant in found if instant.t_s in times_s]  # each is read once
    number, film = {instant.t_s: k for k, instant in enumerate(shown)}, read_film(shown, network)
    reach_m = float(np.nanmax(np.abs(film.centre_m)))
    quantum_m = float(np.clip(reach_m / LARGEST, *QUANTUM_M))
    content: dict[str, Any] = {
        "quantum": quantum_m,
        "ratio": run.gangue_ratio,
        "bodies": _bodies(run, network),
        "plate": _plate(run, film),
        "series": [_series(run, s, film.at([number[one.t_s] for one in some]), quantum_m)
                   for s, some in chosen.items()],
    }
    return json.dumps(content, separators=(",", ":"))


def _bodies(run: Run, network: Network) -> dict[str, Any]:
    gangue = np.array([name == "gangue" for name in run.materials])
    broken_s = np.full(network.first.size, np.inf)
    shear = np.zeros(network.first.size, dtype=bool)
    if len(run.breakage):
        bond = run.breakage["bond"].to_numpy(dtype=int) - 1
        broken_s[bond] = run.breakage["t_s"]
        shear[bond] = run.breakage["mode"] == "shear"
    return {
        "radius": pack(network.radius_m, "<f4"),
        "gangue": pack(gangue[network.agglomerate - 1], "u1"),
        "stone": pack(network.agglomerate - 1, "<u2"),
        "first": pack(network.first, "<u4"),
        "second": pack(network.second, "<u4"),
        "brokenAt": pack(broken_s, "<f4"),
        "shear": pack(shear, "u1"),
    }


def _plate(run: Run, film: Film) -> dict[str, Any]:
    plate = run.scene.plate
    return {
        "size": plate.size_m,
        "thickness": plate.thickness_m,
        "tilt": np.radians(plate.tilt_deg),
        "rods": [rod.as_json() for rod in plate.rods or []],
        "walls": [wall_box_m(edge, plate.size_m, height)
                  for edge, height in plate.wall_height_m.items()] if plate.size_m else [],
        "node": pack(film.node_m, "<f4"),
        "quad": pack(film.quad, "<u4"),
    }


def _scaled(values: np.ndarray) -> tuple[str, float]:
    """Pack values over time in parts of their largest. Returns text and quantum."""
    largest = float(np.abs(values).max()) if values.size else 0.0
    quantum = largest / LARGEST if largest > 0 else 1.0
    return pack_moving(quantised(values, quantum)), quantum


def _series(run: Run, series: Series, film: Film, quantum_m: float) -> dict[str, Any]:
    end_s = float(film.t_s[-1])
    position = quantised(np.nan_to_num(film.centre_m, nan=np.inf), quantum_m)
    position[(position == OUTSIDE).any(axis=-1)] = OUTSIDE
    deflection, deflection_quantum = _scaled(film.deflection_m)
    stress_Pa = film.stress_Pa if film.stress_Pa.size else np.zeros(1)
    stress_quantum = max(float(stress_Pa.max()), 1.0) / 511  # an eighth bit more than a colour can show
    return {
        "key": series.key,
        "title": series.title,
        "end": end_s,
        "t": pack(film.t_s, "<f4"),
        "position": pack_moving(position),
        "deflection": deflection,
        "deflectionQuantum": deflection_quantum,
        "stress": pack_moving(quantised(film.stress_Pa, stress_quantum)),
        "stressQuantum": stress_quantum,
        # The end of the colour scale is exceeded for a moment at a few nodes, mostly those at the rods.
        "stressShown": max(float(np.quantile(stress_Pa, 0.998)), 1.0),
        "curves": {name: _curve(run, column, end_s)
                   for name, column in (("force", "force_N"), ("acceleration", "a_m_s2")) if column in run.signals},
    }


def _curve(run: Run, column: str, end_s: float) -> dict[str, str]:
    """Pack one signal up to a time."""
    t_s = run.finest["t_s"].to_numpy()
    until = t_s <= end_s
    times, values = envelope(t_s[until], run.finest[column].to_numpy()[until], CURVE_POINTS)
    return {"t": pack(times, "<f4"), "value": pack(values, "<f4")}
