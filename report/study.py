"""Everything the report and its claims need of one sweep, computed once and when asked for."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import cast

import numpy as np
import pandas as pd

from analysis import RecordError, Sweep, breakage
from analysis.emd import Decomposition, decompose
from analysis.emd_rules import RuleCost, compare_rules
from analysis.features import BASE_PARAMETERS, TIME_PARAMETERS, time_features
from analysis.hilbert import marginal_spectrum
from analysis.readers import read_table
from analysis.real_plate import (
    amplitude_at_peak,
    contact_stress_map_Pa,
    hertz_contacts,
    modes_of,
    nodal_at,
    particle_forces_N,
    static_compliance_m_N,
    surface_von_mises_Pa,
)
from analysis.runs import RESPONSES
from analysis.setup import Setup, setup_of
from analysis.theory import STATES, beam_compliance, materials_in_order, peak, total_force_N
from recognition.estimation.answer import Answer
from recognition.estimation.window import Window
from recognition.models import Model, leave_one_out
from recognition.paper.fusion import FUSIONS, Fusion
from recognition.paper.kalman import kalman_filter
from recognition.paper.q_parameter import FusionQ

#: Of evaluation.csv, what the report shows.
EVALUATION_COLUMNS = ("method", "held_out", "noise_db", "n", "mean_abs_error_points", "p95_points", "worst_points",
                      "bias_points", "coverage_90", "case", "answered", "flagged")


class Study:
    """A sweep with its theory, features, breakage and recognition.

    `signals` of each run are those of the paper's window; the fast stream and the breakage are of the whole run.
    Arrays over the runs are in order of the ratio. A part that the runs do not hold raises
    RecordError (one line) when asked for.
    """

    def __init__(self, sweep: Sweep):
        window = Window.of(sweep.runs)
        self.runs = [replace(run, signals=window.cut(run.signals, str(run.path))) for run in sweep.runs]
        self.sweep = replace(sweep, runs=self.runs)
        self.ratios = sweep.ratios

    @property
    def t_s(self) -> np.ndarray:
        return self.runs[0].t_s

    def run_at(self, ratio: float):
        """The run of a ratio; RecordError if it is missing."""
        for run in self.runs:
            if abs(run.gangue_ratio - ratio) < 1e-6:
                return run
        raise RecordError(f"{self.sweep.path}: no run of {ratio:.0%} gangue")

    def nearest(self, ratio: float):
        """The run whose ratio is nearest to one."""
        return min(self.runs, key=lambda run: abs(run.gangue_ratio - ratio))

    def place_3(self) -> tuple[int, int]:
        """Runs in which place 3 holds coal and gangue, of ratios as near to each other as there are."""
        third = [run.materials[2] if len(run.materials) > 2 else None for run in self.runs]
        if "coal" not in third or "gangue" not in third:
            raise RecordError(f"{self.sweep.path}: place 3 is never coal or never gangue in these runs")
        return len(third) - 1 - third[::-1].index("coal"), third.index("gangue")

    # ------------------------------------------------------------------ theory

    @cached_property
    def setup(self) -> Setup:
        return setup_of(self.runs[0])

    def beam_compliance_m_N(self, x_m) -> np.ndarray:
        """Of the paper's beam at distances x_m from the plate's centre along the axis A-B."""
        s = self.setup
        return beam_compliance(
            np.asarray(x_m) + s.support_length_m / 2,
            s.support_length_m,
            s.support_width_m,
            s.thickness_m,
            s.plate,
        )

    def single_peaks_N(self, x_m: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
        """Figure 9: {rock: {state: peak force at each x_m}}."""
        s, compliance = self.setup, self.beam_compliance_m_N(x_m)
        return {
            name: {
                key: np.array([self._peak_N(state, name, c) for c in compliance])
                for key, state in STATES.items()
            }
            for name in s.rocks
        }

    def _peak_N(self, state, name: str, compliance: float) -> float:
        s = self.setup
        return peak(
            state,
            s.rocks[name],
            radius_m=s.radius_m,
            speed_m_s=s.speed_m_s,
            plate=s.plate,
            restitution=s.restitution[name],
            compliance_m_N=compliance,
        ).force_N

    @cached_property
    def theory_counts(self) -> np.ndarray:
        return np.arange(len(self.setup.places_m) + 1)

    def theory_totals_N(self, compliance_m_N: np.ndarray) -> dict[str, np.ndarray]:
        """Figure 10: total force of each state for 0, 1, ... gangue spheres in the scene's order."""
        return {
            key: np.array([self._total_N(state, t, compliance_m_N) for t in self.theory_counts])
            for key, state in STATES.items()
        }

    def _total_N(self, state, gangue_count: int, compliance_m_N: np.ndarray) -> float:
        s = self.setup
        names = materials_in_order(gangue_count, s.gangue_order)
        restitutions = [s.restitution[name] for name in names]
        how = {"radius_m": s.radius_m, "speed_m_s": s.speed_m_s, "plate": s.plate}
        return total_force_N(state, [s.rocks[name] for name in names], compliance_m_N, restitutions, **how)

    @cached_property
    def beam_totals_N(self) -> dict[str, np.ndarray]:
        return self.theory_totals_N(self.beam_compliance_m_N(self.setup.places_m[:, 0]))

    @cached_property
    def modes(self) -> list:
        """Modes of each run's plate; runs may differ, where their number follows from the contact time."""
        found = {}
        for run in self.runs:
            if (key := _plate_key(run)) not in found:
                found[key] = modes_of(run)
        return [found[_plate_key(run)] for run in self.runs]

    @property
    def plate_modes(self):
        return self.modes[0]

    @cached_property
    def real_plate_totals_N(self) -> dict[str, np.ndarray]:
        return self.theory_totals_N(static_compliance_m_N(self.plate_modes, self.setup.places_m))

    @cached_property
    def stress_Pa(self) -> list[np.ndarray]:
        """Von Mises stress at the nodes of each run's modes when the total force is largest."""
        pairs = zip(self.modes, self.amplitude_at_peak, strict=True)
        return [surface_von_mises_Pa(modes, amplitude) for modes, amplitude in pairs]

    def stress_at_Pa(self, points_m: np.ndarray) -> np.ndarray:
        """The same at points (k, 2), shape (runs, k): not at the nodes, so that areas do not depend on the mesh."""
        pairs = zip(self.modes, self.stress_Pa, strict=True)
        return np.stack([nodal_at(modes, field, points_m) for modes, field in pairs])

    @cached_property
    def amplitude_at_peak(self) -> list[np.ndarray]:
        """Modal amplitudes of the plate when the total force is largest, of each run."""
        return [amplitude_at_peak(modes, run) for modes, run in zip(self.modes, self.runs, strict=True)]

    def contact_stress_Pa(self, number: int, offset_m: np.ndarray) -> list[np.ndarray]:
        """Von Mises stress about one contact, its Hertz field included, at the same instant, of each run."""
        maps = []
        for run, modes, amplitude in zip(self.runs, self.modes, self.amplitude_at_peak, strict=True):
            force_N = particle_forces_N(run)[1]
            contacts = hertz_contacts(run, force_N[np.argmax(force_N.sum(axis=1))])
            nu = self.setup.plate.poisson_ratio
            maps.append(contact_stress_map_Pa(modes, amplitude, contacts, number, nu, offset_m))
        return maps

    @cached_property
    def contact_pressure_Pa(self) -> np.ndarray:
        """Largest Hertz pressure under each particle as a whole sphere, shape (runs, count)."""
        rows = [hertz_contacts(run, particle_forces_N(run)[1].max(axis=0)) for run in self.runs]
        return np.array([[contact.peak_pressure_Pa for contact in row] for row in rows])

    @cached_property
    def _stress_below_Pa(self) -> np.ndarray:
        """Stress at points 2.5 mm apart below the particles, shape (runs, points)."""
        s, step_m = self.setup, 0.0025
        offsets = np.arange(-s.radius_m, s.radius_m + step_m / 2, step_m)
        disc = np.array([(x, y) for x in offsets for y in offsets if np.hypot(x, y) <= s.radius_m])
        return self.stress_at_Pa((s.places_m[:, None] + disc).reshape(-1, 2))

    @property
    def stress_mean_Pa(self) -> np.ndarray:
        """Mean stress below the particles, shape (runs,)."""
        return self._stress_below_Pa.mean(axis=1)

    @property
    def high_stress_share(self) -> np.ndarray:
        """Share of the area below the particles above 0.8 of the highest stress of any run, shape (runs,)."""
        return (self._stress_below_Pa > 0.8 * self._stress_below_Pa.max()).mean(axis=1)

    # ---------------------------------------------------------------- breakage

    @cached_property
    def networks(self) -> list[breakage.Network]:
        return [breakage.read_network(run) for run in self.runs]

    @cached_property
    def first_collision_end_s(self) -> np.ndarray:
        """Shape (runs, count)."""
        return np.stack([breakage.first_collision_end_s(run) for run in self.runs])

    @cached_property
    def area_first_m2(self) -> np.ndarray:
        """Crack area of each agglomerate after its first collision, shape (runs, count)."""
        ends = self.first_collision_end_s
        return np.stack([breakage.broken_area_m2(run, end) for run, end in zip(self.runs, ends, strict=True)])

    @cached_property
    def area_end_m2(self) -> np.ndarray:
        return np.stack([breakage.broken_area_m2(run) for run in self.runs])

    @cached_property
    def is_gangue(self) -> np.ndarray:
        """Shape (runs, count) of bool."""
        return np.array([[name == "gangue" for name in run.materials] for run in self.runs])

    def per_stone(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Mean over the coal and over the gangue agglomerates of each run, NaN where a run has none."""
        means = {}
        for name, chosen in (("coal", ~self.is_gangue), ("gangue", self.is_gangue)):
            count = chosen.sum(axis=1)
            with np.errstate(invalid="ignore"):
                means[name] = np.where(chosen, values, 0.0).sum(axis=1) / count
        return means

    # ------------------------------------------------------------------ signals

    @cached_property
    def peaks(self) -> dict[str, np.ndarray]:
        """Largest absolute value of the six responses and the total force, from the fast stream."""
        return {name: self.sweep.peaks(name) for name in (*RESPONSES, "force_N")}

    @cached_property
    def two_way(self) -> dict[str, np.ndarray]:
        """Largest and smallest value of u, v and a, shape (runs, 2) each, from the fast stream."""
        return {n: np.array([run.extremes(n) for run in self.runs]) for n in ("u_m", "v_m_s", "a_m_s2")}

    @cached_property
    def decompositions(self) -> list[Decomposition]:
        return [decompose(run.record("a_m_s2")) for run in self.runs]

    @cached_property
    def parameters(self) -> dict[str, np.ndarray]:
        """The parameters of Figure 23 of each run's acceleration, shape (runs,) each; IMF energies apart."""
        rows = [{f.name: f.value for f in time_features(run.record("a_m_s2"))} for run in self.runs]
        table = {name: np.array([row[name] for row in rows]) for name in TIME_PARAMETERS}
        energy = [marginal_spectrum(d, kind="energy").total for d in self.decompositions]
        return table | {"marginal_spectrum_energy": np.array(energy)}

    @cached_property
    def imf_energies(self) -> np.ndarray:
        """Shape (runs, most IMFs); 0 where a run has fewer."""
        most = max(len(d.imfs) for d in self.decompositions)
        return np.stack([np.pad(d.energies, (0, most - len(d.imfs))) for d in self.decompositions])

    @cached_property
    def rule_costs(self) -> list[RuleCost]:
        """Error and time of the EMD stopping rules; on a known signal, not on the runs."""
        return [cost for samples in (267, 4000, 20000) for cost in compare_rules(samples, repeats=2)]

    # -------------------------------------------------------------- recognition

    @cached_property
    def model(self) -> Model:
        return Model.fit(self.runs)

    @cached_property
    def base(self) -> np.ndarray:
        """The eight base parameters of Q, shape (runs, 8)."""
        return np.column_stack([self.parameters[name] for name in BASE_PARAMETERS])

    @cached_property
    def fusion_q(self) -> FusionQ:
        return cast(FusionQ, self.model.methods["fusion_q"])

    @cached_property
    def q(self) -> np.ndarray:
        return self.fusion_q.transform(self.base)

    @cached_property
    def answers(self) -> dict[str, list[dict[str, Answer]]]:
        return {
            "trained on all": [self.model.recognise(run.signals, str(run.path)) for run in self.runs],
            "that ratio held out": leave_one_out(self.runs),
        }

    def errors_points(self, trained: str, method: str) -> np.ndarray:
        """Recognised less true ratio in points of the runs that were answered."""
        rows = zip(self.answers[trained], self.ratios, strict=True)
        return np.array(
            [100 * (row[method].ratio - ratio) for row, ratio in rows if not row[method].reason]
        )

    @cached_property
    def evaluation(self) -> pd.DataFrame:
        """evaluation.csv of the data set beside the sweep. RecordError if there is none."""
        path = self.sweep.path.resolve().parent / "dataset" / "evaluation.csv"
        if not path.is_file():
            raise RecordError(f"{path}: no such file; `make dataset` writes it")
        table = read_table(path)
        missing = [name for name in EVALUATION_COLUMNS if name not in table.columns]
        if missing:
            raise RecordError(f"{path}: no column {missing[0]!r}; needs {', '.join(EVALUATION_COLUMNS)}")
        return table

    @cached_property
    def filtered(self) -> dict[str, np.ndarray]:
        """The six responses after the Kalman filter, shape (runs, samples) each."""
        return {name: kalman_filter(self.sweep.stack(name)) for name in RESPONSES}

    @cached_property
    def fusions(self) -> dict[str, Fusion]:
        return {kind: Fusion(kind).fit(self.responses(kind)) for kind in FUSIONS}

    def responses(self, kind: str) -> np.ndarray:
        """What a fusion takes of each run, shape (runs, m, samples)."""
        return np.stack([Fusion(kind).prepare(run.signals) for run in self.runs])

    @cached_property
    def fused(self) -> dict[str, np.ndarray]:
        """The four fusion parameters, shape (runs, samples) each."""
        return {kind: fusion.transform(self.responses(kind)) for kind, fusion in self.fusions.items()}


def _plate_key(run) -> str:
    return repr((run.info.get("scene", {}).get("plate"), run.info.get("n_modes")))
