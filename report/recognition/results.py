"""Recognition of the mixing ratio from the runs: Q, Kalman filter, fusion, answers (Section V, Figures 24 to 38)."""

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from analysis.signals.features import BASE_PARAMETERS
from common.channels import RESPONSES
from common.process.processes import side_by_side
from recognition.estimation.answer import Answer
from recognition.estimation.errors import RecognitionError
from recognition.estimation.window import Window
from recognition.methods import METHODS
from recognition.models import Model, PreparedRuns
from recognition.paper.fusion import FUSIONS, Fusion, kalman_filter
from recognition.paper.q_parameter import FusionQ, PolynomialFit, fit_polynomial
from recognition.paper.strategy import Candidates, FusionPipeline
from report.signals import Signals
from report.sweep_results import SweepResults

FUSION_Q, FUSION_MODIFIED = "fusion_q", "energy_fusion_modified"  # methods of the paper

#: The paper's energy fusion in a few words, for the statement that compares it with Q.
FUSION_WORDS = {"energy_fusion_as_published": "as published", FUSION_MODIFIED: "modified"}

#: {name: as a reader sees it}, in order.
MODEL_METHODS = {name: entry.title for name, entry in METHODS.items()}

#: Those that evaluations found best, the best first.
LEADING_METHODS = ("arrangement_likelihood", "energies_sensors")

#: How the model that answers was trained. "Held out": on all other ratios.
TRAINED_ON_ALL, HELD_OUT = "trained on all", "that ratio held out"


class Recognition:
    """Answers of every method, and the steps of the paper's methods on the way to them. Raises RecognitionError for
    fewer than four different mixing ratios."""

    def __init__(self, results: SweepResults):
        self._results, self._runs, self._ratios = results, results.runs, results.ratios

    @cached_property
    def prepared(self) -> PreparedRuns:
        """What every model takes of the runs."""
        return PreparedRuns.of(self._runs)

    @cached_property
    def model(self) -> Model:
        """Of all runs."""
        return self.prepared.fit(range(len(self._runs)))

    @cached_property
    def _fusion_q(self) -> FusionQ:
        method = self.model.methods[FUSION_Q]
        assert isinstance(method, FusionQ)
        return method

    @cached_property
    def answers(self) -> dict[str, list[dict[str, Answer]]]:
        return {TRAINED_ON_ALL: self.by_all, HELD_OUT: self.held_out}

    @cached_property
    def by_all(self) -> list[dict[str, Answer]]:
        """Answers of `model` to each run."""
        return [self.prepared.answers_by(self.model, k) for k in range(len(self._runs))]

    @cached_property
    def held_out(self) -> list[dict[str, Answer]]:
        """Answers to each run by the other ratios."""
        return side_by_side(self.prepared.answers_without, len(self._runs))

    def errors_points(self, training: str, method: str) -> np.ndarray:
        """Return recognised less true ratio, in points, of the runs that a method answered, shape (answered,)."""
        rows = zip(self.answers[training], self._ratios, strict=True)
        return np.array([100 * (row[method].ratio - ratio) for row, ratio in rows if not row[method].reason])

    def leading_of(self, methods: Iterable[str]) -> str:
        """The method that answers most records held out; of equals the first."""
        return max(methods, key=lambda name: self.errors_points(HELD_OUT, name).size)

    @cached_property
    def _base(self) -> np.ndarray:
        """The eight base parameters of Q, shape (runs, 8)."""
        return np.column_stack([self._results.of(Signals).parameters[name] for name in BASE_PARAMETERS])

    @cached_property
    def standardised_base(self) -> tuple[np.ndarray, np.ndarray]:
        """The base parameters by Eq. 39, shape (runs, 8), and which of them fall with the ratio, shape (8,) of bool."""
        scaler = self._fusion_q.scaler_
        return scaler.transform(self._base), scaler.direction < 0

    @cached_property
    def q(self) -> np.ndarray:
        """The fused parameter Q of each run (Eq. 40), shape (runs,)."""
        return self._fusion_q.q_of(self._base)

    @property
    def q_fit(self) -> PolynomialFit:
        """The polynomial of Q that the model inverts."""
        return self._fusion_q.fit_

    @property
    def q_quadratic(self) -> PolynomialFit:
        """The quadratic through Q of the runs (Table 3)."""
        return fit_polynomial(self._ratios, self.q, 2)

    @cached_property
    def filtered(self) -> dict[str, np.ndarray]:
        """The six responses after the Kalman filter, in SI units, shape (runs, samples) each."""
        return {name: kalman_filter(self._results.sweep.stack(name)) for name in RESPONSES}

    @cached_property
    def _fusions(self) -> dict[str, Fusion]:
        return {kind: Fusion(kind).fit(self.fusion_inputs(kind)) for kind in FUSIONS}

    def fusion_inputs(self, kind: str) -> np.ndarray:
        """Return the responses that a fusion takes of each run, shape (runs, m, samples)."""
        return np.stack([Fusion(kind).prepare(run.signals) for run in self._runs])

    def normalised_inputs(self, kind: str) -> dict[str, np.ndarray]:
        """Return the same normalised by Eq. 41: {response: shape (runs, samples)}."""
        fusion = self._fusions[kind]
        values = fusion.normalised(self.fusion_inputs(kind))
        return {name: values[:, row] for row, name in enumerate(fusion.names)}

    @cached_property
    def fused(self) -> dict[str, np.ndarray]:
        """The four fusion parameters QQ, shape (runs, samples) each."""
        return {kind: fusion.transform(self.fusion_inputs(kind)) for kind, fusion in self._fusions.items()}

    def moment_fits(self, count: int, ratios: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Return `count` moments of the function space of the modified energy fusion, evenly chosen: time, QQ of the
        runs (runs,), and the function fitted to it, at `ratios` (n,)."""
        method = self.model.methods[FUSION_MODIFIED]
        assert isinstance(method, FusionPipeline)
        curves = method.transform(self.fusion_inputs("energy")[:, :, : self.model.window.n_samples])
        space, t_s = method.strategy.space_, self._runs[0].t_s
        chosen = np.linspace(0, space.moments.size - 1, count + 1).astype(int)[1:]
        return [(t_s[moment], curves[:, moment], space(np.full(ratios.size, k), ratios))
                for k, moment in zip(chosen, space.moments[chosen], strict=True)]

    def candidates(self, index: int) -> dict[str, Candidates]:
        """Candidates for run `index` by the paper's strategies, fitted to all other ratios, by the methods as a reader
        sees them. Raises RecognitionError where none can be fitted."""
        run = self._runs[index]
        others = [other for other in self._runs if other.gangue_ratio != run.gangue_ratio]
        window, ratios = Window.of(others), np.array([other.gangue_ratio for other in others])
        tables = [window.cut(one.signals, str(one.path)) for one in (*others, run)]
        scored, reasons = {}, []
        for name, label in MODEL_METHODS.items():
            method = METHODS[name].make()
            if not isinstance(method, FusionPipeline):
                continue
            *known, responses = [method.prepare(table) for table in tables]
            try:
                scored[label] = method.fit(known, ratios).strategy.candidates(method.transform(responses[0]))
            except RecognitionError as reason:
                reasons.append(str(reason))
        if not scored:
            raise RecognitionError("; ".join(dict.fromkeys(reasons)))
        return scored
