"""The report of a sweep: one HTML file with everything inside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import jinja2
import numpy as np
from scipy.stats import spearmanr

from analysis import Sweep, base_parameters, read_sweep
from recognition import figures
from recognition.models import Model, leave_one_out

TEMPLATES = Path(__file__).resolve().parent.parent / "templates"

METHOD_NAMES = {
    "fusion_q": "Q polynomial",
    "energy_fusion_printed": "energy fusion as printed",
    "energy_fusion_mended": "energy fusion, mended",
}


@dataclass(frozen=True)
class Picture:
    key: str
    title: str
    caption: str
    uri: str


@dataclass(frozen=True)
class Rise:
    """Does a quantity rise with the ratio? falls_at: pairs of neighbouring ratios where it falls."""

    name: str
    spearman: float
    falls_at: list[tuple[float, float]]
    change: float

    @property
    def verdict(self) -> str:
        if self.spearman >= 0.9:
            return "rises" if not self.falls_at else "rises as a whole"
        return "rises weakly" if self.spearman >= 0.5 else "does not rise"


def rise(name: str, ratios: np.ndarray, values: np.ndarray) -> Rise:
    """Spearman's rank correlation with the ratio, the steps that fall, and last over first value."""
    steps = np.flatnonzero(np.diff(values) < 0)
    falls = [(float(ratios[i]), float(ratios[i + 1])) for i in steps]
    return Rise(name, float(spearmanr(ratios, values).statistic), falls, float(values[-1] / values[0]))


def write_report(directory) -> Path:
    """Write report.html into a directory of runs, whole or not at all; returns its path.

    Raises RecordError or RecognitionError, one line, where the runs cannot be used.
    """
    sweep = read_sweep(directory)
    html = render(sweep)
    out = Path(directory) / "report.html"
    beside = out.with_name("report.html.part")
    beside.write_text(html, encoding="utf-8")
    beside.replace(out)
    return out


def render(sweep: Sweep) -> str:
    model = Model.fit(sweep.runs)
    answers = {
        "trained on all": [model.recognise(run.signals, str(run.path)) for run in sweep.runs],
        "that ratio held out": leave_one_out(sweep.runs),
    }
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=True, undefined=jinja2.StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return environment.get_template("report.html.j2").render(
        sweep=sweep,
        pictures=plate_pictures(sweep) + ratio_pictures(sweep) + recognition_pictures(sweep, model, answers),
        rises=rises(sweep),
        answers=answers,
        methods=METHOD_NAMES,
        errors=error_table(sweep, answers),
        rows=run_rows(sweep),
        assumptions=assumptions(sweep),
    )


def plate_pictures(sweep: Sweep) -> list[Picture]:
    t_s, ratios = sweep.runs[0].t_s, sweep.ratios
    motion = [("displacement, µm", 1e6 * sweep.stack("u_m")), ("velocity, m/s", sweep.stack("v_m_s"))]
    motion.append(("acceleration, m/s²", sweep.stack("a_m_s2")))
    energy = [(f"{name}, J", sweep.stack(f"{name}_J")) for name in ("kinetic", "internal", "total")]
    return [
        _picture("motion", "Motion of the plate", "Centre of mass of the plate, each ratio one curve (Figure 16 a-c).",
                 figures.curves(t_s, motion, ratios)),
        _picture("energy", "Energy of the plate", "Kinetic, internal and total energy (Figure 16 d-f).",
                 figures.curves(t_s, energy, ratios)),
        _picture("force", "Total contact force", "Force of all agglomerates on the plate (Figure 18). At 6667 Hz a"
                 " contact has about 1.5 samples; maxima below come from the fast stream.",
                 figures.curves(t_s, [("force, kN", 1e-3 * sweep.stack("force_N"))], ratios)),
    ]  # fmt: skip


def ratio_pictures(sweep: Sweep) -> list[Picture]:
    peaks = [
        ("peak total force, kN", {"force": 1e-3 * sweep.peaks("force_N")}),
        ("peak displacement, µm", {"displacement": 1e6 * sweep.peaks("u_m")}),
        ("peak velocity, m/s", {"velocity": sweep.peaks("v_m_s")}),
        ("peak acceleration, m/s²", {"acceleration": sweep.peaks("a_m_s2")}),
        ("peak kinetic energy, J", {"energy": sweep.peaks("kinetic_J")}),
        ("peak total energy, J", {"energy": sweep.peaks("total_J")}),
    ]
    broken = [
        ("broken bonds", broken_by_material(sweep)),
        ("broken bonds per agglomerate", broken_by_material(sweep, per_agglomerate=True)),
    ]
    return [
        _picture("maxima", "Maxima against the mixing ratio", "Largest absolute values in 0..0.04 s (Figure 19).",
                 figures.against_ratio(sweep.ratios, peaks)),
        _picture("breakage", "Breakage against the mixing ratio", "Bonds broken by the end of each run (Figure 15).",
                 figures.against_ratio(sweep.ratios, broken)),
    ]  # fmt: skip


def recognition_pictures(sweep: Sweep, model: Model, answers: dict) -> list[Picture]:
    q = model.fusion_q.transform(np.stack([base_parameters(run.record("a_m_s2")) for run in sweep.runs]))
    fit = model.fusion_q.fit_
    note = " ".join(f"{c:+.4f}β^{p}" if p else f"{c:.4f}" for p, c in enumerate(fit.coefficients))
    note = f"Q = {note}, R² {fit.r2:.4f}".replace("β^1", "β").replace("β^2", "β²")
    n = model.n_samples
    qq = np.stack([model.fusion.transform(run.signals.iloc[:n]) for run in sweep.runs])
    series = {
        f"{METHOD_NAMES[method]}, {trained}": [_number(answer[method]) for answer in found]
        for trained, found in answers.items()
        for method in METHOD_NAMES
    }
    return [
        _picture("q", "Fused parameter Q", "Eight standardised parameters of the acceleration, equal weights"
                 " (Figure 24).", figures.q_against_ratio(sweep.ratios, q, fit.coefficients, note)),
        _picture("fusion", "Energy fusion", "The three energies, normalised over all ratios and fused by a Kalman"
                 " filter (Figure 33).",
                 figures.curves(sweep.runs[0].t_s[:n], [("fusion parameter QQ", qq)], sweep.ratios)),
        _picture("recognised", "Recognised mixing ratio", "Filled: model trained on all these runs. Open: the run's"
                 " own ratio held out of the training.", figures.recognised(sweep.ratios, series)),
    ]  # fmt: skip


def broken_by_material(sweep: Sweep, *, per_agglomerate: bool = False) -> dict[str, np.ndarray]:
    """Broken bonds of coal and of gangue in each run; not finite where a run has none of it."""
    totals = {}
    for material in ("coal", "gangue"):
        counts = []
        for run in sweep.runs:
            own = [
                broken
                for name, broken in zip(run.materials, run.info["n_bonds_broken_by_agglomerate"], strict=True)
                if name == material
            ]
            counts.append(sum(own) / len(own) if per_agglomerate and own else sum(own) if own else np.nan)
        totals[material] = np.array(counts, dtype=float)
    return totals


def rises(sweep: Sweep) -> list[Rise]:
    rms = np.array([np.sqrt(np.mean(run.record("a_m_s2").values ** 2)) for run in sweep.runs])
    return [
        rise("peak total force", sweep.ratios, sweep.peaks("force_N")),
        rise("peak kinetic energy of the plate", sweep.ratios, sweep.peaks("kinetic_J")),
        rise("RMS of the plate's acceleration", sweep.ratios, rms),
    ]


def error_table(sweep: Sweep, answers: dict) -> list[dict]:
    """Mean and worst error in points of mixing ratio, per method and training."""
    table = []
    for trained, found in answers.items():
        for method, name in METHOD_NAMES.items():
            values = [_number(answer[method]) for answer in found]
            errors = [100 * abs(v - r) for v, r in zip(values, sweep.ratios, strict=True) if v is not None]
            table.append({
                "method": name,
                "trained": trained,
                "answered": len(errors),
                "of": len(values),
                "mean": f"{np.mean(errors):.2f}" if errors else "-",
                "worst": f"{np.max(errors):.2f}" if errors else "-",
            })  # fmt: skip
    return table


def run_rows(sweep: Sweep) -> list[dict]:
    return [
        {
            "ratio": f"{run.gangue_ratio:.0%}",
            "particles": run.info.get("n_particles"),
            "bonds": run.info.get("n_bonds"),
            "broken": run.info.get("n_bonds_broken"),
            "force_kN": 1e-3 * run.peak("force_N"),
            "kinetic_J": run.peak("kinetic_J"),
            "rms": float(np.sqrt(np.mean(run.record("a_m_s2").values ** 2))),
            "wall_s": sum(run.info.get("wall_time_s", {}).values()),
        }
        for run in sweep.runs
    ]


def assumptions(sweep: Sweep) -> list[str]:
    """The scene's assumptions as lines, each once, in order."""
    lines: dict[str, None] = {}
    for run in sweep.runs:
        found = run.info.get("assumptions", [])
        found = [f"{key}: {value}" for key, value in found.items()] if isinstance(found, dict) else found
        lines.update(dict.fromkeys(str(line) for line in found))
    return list(lines)


def _number(answer: float | str) -> float | None:
    return answer if isinstance(answer, float) else None


def _picture(key: str, title: str, caption: str, figure) -> Picture:
    return Picture(key, title, caption, figures.to_svg_uri(figure, key))
