"""All that the page's view shows of one run, packed as one JSON object a run."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis import Run
from analysis.sweep.breakage import Network
from common.run_summary import RecordedPlate
from common.scene.plate import wall_box_m
from report.drawing.lines import envelope
from report.film.packing import LARGEST, OUTSIDE, pack, pack_moving, quantised
from report.film.pictures import SERIES, Film, Series, choose, instants, read_film
from report.missing import MissingResult
from report.sweep_results import SweepResults

QUANTUM_M = 2e-5  # of positions: a hundredth of a sub-sphere; the box of 16-bit numbers is then 1.3 m wide
CURVE_POINTS = 900  # about the pixels of a curve's width

#: No page above 15 MB: the film takes at most this much; what did not fit is named in the page.
BUDGET_BYTES = 6_500_000


@dataclass(frozen=True)
class Reel:
    """The packed film of one run. key: in the page. label: the ratio. json: for templates/film.js."""

    key: str
    label: str
    json: str


@dataclass(frozen=True)
class Films:
    """The reels of a sweep, shown: number of the one shown first, left_out: what the page does not hold and why."""

    reels: list[Reel]
    shown: int
    left_out: list[str]


def pack_films(results: SweepResults, index: int) -> str:
    """Pack run `index`: the one nearest to 50 % in full, of all others the impact. Raises one of MISSING_RESULT."""
    run, main = results.runs[index], results.index_nearest(0.5)
    return pack_run(run, results.breakage.networks[index], SERIES if index == main else SERIES[:1])


def films_of(results: SweepResults, packed: list[str | Exception]) -> Films:
    """The films of a page from those of each run (`pack_films`), or why it has none: the one nearest to 50 % first, and
    the others as far as the budget goes."""
    main = results.index_nearest(0.5)
    order = [main, *(k for k in range(len(results.runs)) if k != main)]
    reels, left_out, spent = {}, [], 0
    for index in order:
        label, text = f"{100 * results.runs[index].gangue_ratio:.0f} %", packed[index]
        if isinstance(text, Exception):
            left_out.append(f"{label}: {text}")
            continue
        if spent + len(text) > BUDGET_BYTES:
            left_out.append(f"{label}: the page would be too large")
            continue
        spent += len(text)
        reels[index] = Reel(f"film-{index}", label, text)
    chosen = sorted(reels)
    return Films([reels[k] for k in chosen], chosen.index(main) if main in reels else 0, left_out)


def pack_run(run: Run, network: Network, wanted: tuple[Series, ...]) -> str:
    """Pack one run: bodies, bonds, and each series that has pictures. Raises MissingResult if none has two."""
    found = instants(run.path)
    series = {s.key: choose(found, s) for s in wanted}
    played = [s for s in wanted if len(series[s.key]) > 1]
    if not played:
        most = f"{1e3 * found[1].t_s:g} ms between them" if len(found) > 1 else "one alone"
        raise MissingResult(f"no two pictures inside the {wanted[-1].title} ({most})")
    films = {s.key: read_film(series[s.key]) for s in played}
    first = films[played[0].key]
    if len(first.radius_m) != len(network.radius_m):
        raise MissingResult(f"the pictures show {len(first.radius_m)} sub-spheres, the deck {len(network.radius_m)}")
    content: dict[str, Any] = {
        "quantum": QUANTUM_M,
        "ratio": run.gangue_ratio,
        "bodies": _bodies(run, network, first),
        "plate": _plate(run, first),
        "series": [_series(run, s, films[s.key]) for s in played],
    }
    return json.dumps(content, separators=(",", ":"))


def _bodies(run: Run, network: Network, film: Film) -> dict[str, Any]:
    gangue = np.array([name == "gangue" for name in run.materials])
    broken_s = np.full(network.first.size, np.inf)
    shear = np.zeros(network.first.size, dtype=bool)
    if len(run.breakage):
        bond = run.breakage["bond"].to_numpy(dtype=int) - 1
        broken_s[bond] = run.breakage["t_s"]
        shear[bond] = run.breakage["mode"] == "shear"
    return {
        "radius": pack(film.radius_m, "<f4"),
        "gangue": pack(gangue[network.agglomerate - 1], "u1"),
        "stone": pack(network.agglomerate - 1, "<u2"),
        "first": pack(network.first, "<u4"),
        "second": pack(network.second, "<u4"),
        "brokenAt": pack(broken_s, "<f4"),
        "shear": pack(shear, "u1"),
    }


def _plate(run: Run, film: Film) -> dict[str, Any]:
    plate = run.scene.plate
    rods = plate.rods or []
    return {
        "length": plate.length_m,
        "width": plate.width_m,
        "thickness": plate.thickness_m,
        "rods": [rod.as_json() for rod in rods],
        "walls": _wall_boxes_m(plate),
        "node": pack(film.node_m, "<f4"),
        "quad": pack(film.quad, "<u4"),
    }


def _wall_boxes_m(plate: RecordedPlate) -> list[tuple[float, ...]]:
    if plate.walls is None or plate.length_m is None or plate.width_m is None:
        return []
    return [wall_box_m(edge, plate.length_m, plate.width_m, plate.walls.height_m) for edge in plate.walls.edges]


def _scaled(values: np.ndarray) -> tuple[str, float]:
    """Pack values over time in parts of their largest. Returns text and quantum."""
    largest = float(np.abs(values).max()) if values.size else 0.0
    quantum = largest / LARGEST if largest > 0 else 1.0
    return pack_moving(quantised(values, quantum)), quantum


def _series(run: Run, series: Series, film: Film) -> dict[str, Any]:
    end_s = float(film.t_s[-1])
    position = quantised(film.centre_m, QUANTUM_M)
    position[(position == OUTSIDE).any(axis=-1)] = OUTSIDE
    deflection, deflection_quantum = _scaled(film.deflection_m)
    # An eighth bit more than a colour can show.
    stress_quantum = max(float(film.stress_Pa.max()), 1.0) / 511 if film.stress_Pa.size else 1.0
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
        "stressShown": _stress_shown_Pa(film),
        "force": _curve(run, "force_N", end_s),
        "acceleration": _curve(run, "a_m_s2", end_s),
    }


def _stress_shown_Pa(film: Film) -> float:
    """Return the end of the colour scale: exceeded for a moment at a few nodes, mostly those at the rods."""
    return max(float(np.quantile(film.stress_Pa, 0.998)), 1.0) if film.stress_Pa.size else 1.0


def _curve(run: Run, column: str, end_s: float) -> dict[str, str]:
    """Pack one signal up to a time, from the fast stream where it is kept."""
    table = run.fast if run.fast is not None else run.signals
    t_s = table["t_s"].to_numpy()
    until = t_s <= end_s
    times, values = envelope(t_s[until], table[column].to_numpy()[until], CURVE_POINTS)
    return {"t": pack(times, "<f4"), "value": pack(values, "<f4")}
