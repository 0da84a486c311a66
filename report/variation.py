"""How breakage and response differ from stone to stone: over the stones of a sweep, and over draws of stones that vary,
which are a data set beside the sweep."""

import numpy as np

from analysis import Run, read_run
from analysis.signals.features import rms
from analysis.sweep import breakage
from common.scene.stones import KINDS
from recognition.estimation.window import WINDOW_S
from report.breakage import Breakage
from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.tables import Cells, table
from report.verdicts import spearman

BESIDE = "natural"
PLAN = "scenes/dataset_natural.toml"


@table("table-one-stone", "Breakage of one stone",
       "Mean and standard deviation of all stones. Below a fragment size of 2.3 sub-spheres, what breaks depends on "
       "the number of sub-spheres; near the critical speed, at which stones fall apart, on the single stone.")
def one_stone(results: SweepResults) -> Cells:
    rows, found = [], results.of(Breakage)
    area_cm2 = 1e4 * found.area_end_m2
    for kind in results.kinds:
        chosen = results.is_of(kind)
        rows.append([kind, str(chosen.sum()), _with_deviation(area_cm2[chosen]),
                     _with_deviation(found.largest_share[chosen]),
                     _span(results, chosen, "fragment_size_over_subsphere"),
                     _span(results, chosen, "speed_over_critical")])
    return ["", "stones", "crack area, cm²", "largest fragment", "fragment size over sub-sphere",
            "speed over critical speed"], rows


def _span(results: SweepResults, chosen: np.ndarray, key: str) -> str:
    """Least and largest of a list by stone in run.json."""
    given = [getattr(run.summary, key) or [None] * len(run.materials) for run in results.runs]
    values = np.array(given, dtype=float)[chosen]
    known = values[np.isfinite(values)]
    return " to ".join(dict.fromkeys((f"{known.min():.2g}", f"{known.max():.2g}"))) if known.size else "-"


def quantities(run: Run) -> dict[str, float]:
    """What is compared of a run, over the paper's window; NaN where it has no stone of a kind."""
    area_cm2 = 1e4 * breakage.broken_area_m2(run, WINDOW_S)
    own = {kind: area_cm2[np.array(run.materials) == kind] for kind in KINDS}
    of_one = {kind: float(area.mean()) if area.size else np.nan for kind, area in own.items()}
    return {
        "crack area of all stones, cm²": float(area_cm2.sum()),
        "crack area of one coal, cm²": of_one["coal"],
        "crack area of one gangue, cm²": of_one["gangue"],
        "peak total force, kN": 1e-3 * run.peak("force_N"),
        "peak kinetic energy of the plate, J": run.peak("kinetic_J"),
        "RMS of the plate's acceleration, m/s²": rms(run.record("a_m_s2").values[run.t_s <= WINDOW_S])}


@table("table-varying", "What natural scatter makes of it",
       f"Beside each figure of this sweep those of stones that vary, with another coal ({PLAN}): mean and standard "
       "deviation over draws, in the paper's window.")
def varying(results: SweepResults) -> Cells:
    """Of each quantity the value of the run nearest to 50 % and the rank correlation with the ratio: of the
    sweep, and of the runs beside it whose stones vary. Raises MissingResult where there are none."""
    runs = _runs_beside(results)
    ratios = np.array([run.gangue_ratio for run in runs])
    half = results.index_nearest(0.5)
    near = np.flatnonzero(np.abs(ratios - results.ratios[half]) < 0.05)
    rows, here, there = [], [quantities(run) for run in results.runs], [quantities(run) for run in runs]
    for name in here[half]:
        own, beside = (np.array([one[name] for one in every]) for every in (here, there))
        rows.append([name, f"{own[half]:.3g}", _with_deviation(beside[near]), _rank(results.ratios, own),
                     _rank(ratios, beside)])
    count = f"{len(near)} draws"
    return ["", f"{results.ratios[half]:.0%}: this sweep", f"{results.ratios[half]:.0%}: {count}",
            "Spearman with the ratio: this sweep", f"Spearman: {len(runs)} runs"], rows


def _runs_beside(results: SweepResults) -> list[Run]:
    directory = results.sweep.path.resolve().parent / BESIDE
    runs = [read_run(path) for path in sorted(directory.glob("*/*/ratio_*")) if (path / "run.json").is_file()]
    if not runs:
        raise MissingResult(f"no runs in {BESIDE} beside this directory; `make natural` makes those of runs/paper")
    return runs


def _rank(ratios: np.ndarray, values: np.ndarray) -> str:
    known = np.isfinite(values)
    return f"{spearman(ratios[known], values[known]):.2f}" if known.sum() > 2 else "-"


def _with_deviation(values: np.ndarray) -> str:
    known = values[np.isfinite(values)]
    if known.size < 2:
        return f"{known[0]:.3g}" if known.size else "-"
    rounding = np.ptp(known) <= 1e-12 * np.abs(known).max()
    return f"{known.mean():.3g} ± {0.0 if rounding else known.std(ddof=1):.2g}"
