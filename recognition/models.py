"""The two recognisers of the paper as whole models on run directories, and their file.

A saved model is JSON: numbers and names only, safe to load from a stranger, with a
version of its format and where it came from.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from analysis import RecordError, as_record, base_parameters
from analysis.features import BASE_PARAMETERS
from analysis.records import sample_rate_Hz
from analysis.runs import Run
from recognition.errors import NotRecognised, RecognitionError
from recognition.fusion import Fusion
from recognition.fusion_q import FusionQ
from recognition.strategy import Strategy

FORMAT = "coal-gangue mixing ratio"
VERSION = 1

#: The window of the paper: 0..0.04 s at 1.5e-4 s.
WINDOW_S = 0.04

#: The strategy as printed (a mean over whatever points are usable, degree by R^2) and
#: mended (every degree 2, since R^2 > 0.99 lets straight lines through a bent law; every
#: moment counts).
STRATEGIES = {
    "energy_fusion_printed": {"degree": None, "min_r2": 0.99, "least_share": 0.0, "judge": "mean"},
    "energy_fusion_mended": {"degree": 2, "least_share": 0.5, "judge": "truncated"},
}
METHODS = ("fusion_q", *STRATEGIES)


@dataclass
class Model:
    """The methods of the paper, fitted to the same runs at the same sample times."""

    rate_Hz: float
    n_samples: int
    fusion_q: FusionQ
    fusion: Fusion
    strategies: dict[str, Strategy]
    provenance: dict = field(default_factory=dict)

    @classmethod
    def fit(cls, runs: list[Run]) -> Model:
        """Fit to runs of known ratio."""
        if len({run.gangue_ratio for run in runs}) < 4:
            raise RecognitionError(f"{len(runs)} runs; needs at least 4 different mixing ratios")
        rate_Hz = runs[0].rate_Hz
        n_samples = min(run.t_s.size for run in runs)
        n_samples = min(n_samples, int(np.floor(WINDOW_S * rate_Hz * (1 + 1e-9))) + 1)
        model = cls(rate_Hz, n_samples, FusionQ(), Fusion("energy"), {})
        ratios = np.array([run.gangue_ratio for run in runs])
        tables = [model._window(run.signals, str(run.path)) for run in runs]
        model.fusion_q.fit(np.stack([model._parameters(table) for table in tables]), ratios)
        model.fusion.fit(tables)
        curves = np.stack([model.fusion.transform(table) for table in tables])
        model.strategies = {name: Strategy(**how).fit(curves, ratios) for name, how in STRATEGIES.items()}
        model.provenance = {"runs": [_origin(run) for run in runs]}
        return model

    def recognise(self, signals: pd.DataFrame, source: str = "record") -> dict[str, float | str]:
        """Mixing ratio by each method that the columns allow; a text where there is no answer.

        Raises RecognitionError where no method can be applied at all.
        """
        table = self._window(signals, source)
        answers = {"fusion_q": _answer(lambda: self.fusion_q.predict(self._parameters(table))[0])}
        try:
            curve = self.fusion.transform(table)
        except RecognitionError as reason:
            answers |= dict.fromkeys(self.strategies, f"not applicable: {reason}")
        else:
            answers |= {
                name: _answer(lambda s=s: s.recognise(curve).ratio) for name, s in self.strategies.items()
            }
        if all(isinstance(a, str) and a.startswith("not applicable") for a in answers.values()):
            raise RecognitionError(f"{source}: {'; '.join(dict.fromkeys(answers.values()))}")
        return answers

    def _parameters(self, table: pd.DataFrame) -> np.ndarray:
        if "a_m_s2" not in table.columns:
            raise RecognitionError("no column 'a_m_s2' in the record; needs it for Q")
        acceleration = table["a_m_s2"].to_numpy(dtype=float)
        return base_parameters(as_record(acceleration, self.rate_Hz, unit="m/s^2", name="a_m_s2"))

    def _window(self, signals: pd.DataFrame, source: str) -> pd.DataFrame:
        """The samples of the model's window; the record must have its sample rate."""
        if "t_s" not in signals.columns:
            raise RecordError(f"{source}: no column 't_s'; needs the time of each sample")
        rate_Hz = sample_rate_Hz(signals["t_s"].to_numpy(dtype=float), f"{source}: t_s")
        if not np.isclose(rate_Hz, self.rate_Hz, rtol=1e-3):
            raise RecordError(f"{source}: {rate_Hz:.6g} Hz; the model needs {self.rate_Hz:.6g} Hz")
        if len(signals) < self.n_samples:
            raise RecordError(
                f"{source}: {len(signals)} samples; the model needs {self.n_samples} from the impact on"
            )
        return signals.iloc[: self.n_samples]

    def save(self, path) -> None:
        """Write the model, whole or not at all."""
        path = Path(path)
        data = {
            "format": FORMAT,
            "version": VERSION,
            "provenance": self.provenance,
            "rate_Hz": self.rate_Hz,
            "n_samples": self.n_samples,
            "parameters": list(BASE_PARAMETERS),
            "fusion_q": self.fusion_q.to_dict(),
            "fusion": self.fusion.to_dict(),
            "strategies": {name: strategy.to_dict() for name, strategy in self.strategies.items()},
        }
        beside = path.with_name(path.name + ".part")
        beside.write_text(json.dumps(data, indent=1, allow_nan=False))
        beside.replace(path)

    @classmethod
    def load(cls, path) -> Model:
        """Read a saved model. RecognitionError, one line, for anything else."""
        path = Path(path)
        try:
            data = json.loads(path.read_text())
        except (OSError, ValueError) as error:
            raise RecognitionError(f"{path}: not a readable model ({error})") from None
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise RecognitionError(f"{path}: format is not {FORMAT!r}")
        if data.get("version") != VERSION:
            raise RecognitionError(f"{path}: version = {data.get('version')!r}; this program reads {VERSION}")
        if data.get("parameters") != list(BASE_PARAMETERS):
            raise RecognitionError(
                f"{path}: parameters differ from this program's {', '.join(BASE_PARAMETERS)}"
            )
        try:
            return cls(
                float(data["rate_Hz"]),
                int(data["n_samples"]),
                FusionQ.from_dict(data["fusion_q"]),
                Fusion.from_dict(data["fusion"]),
                {name: Strategy.from_dict(data["strategies"][name]) for name in STRATEGIES},
                data["provenance"],
            )
        except (KeyError, TypeError, ValueError) as error:
            raise RecognitionError(f"{path}: broken model ({type(error).__name__}: {error})") from None


def _answer(method: Callable[[], float]) -> float | str:
    try:
        return float(method())
    except NotRecognised as reason:
        return f"no answer: {reason}"
    except RecognitionError as reason:
        return f"not applicable: {reason}"


def _origin(run: Run) -> dict:
    keep = ("scene_hash", "deck_hash", "versions", "seeds")
    known = {key: run.info[key] for key in keep if key in run.info}
    return {"directory": run.path.name, "gangue_ratio": run.gangue_ratio, **known}


def leave_one_out(runs: list[Run]) -> list[dict[str, float | str]]:
    """Recognise each run by a model fitted to the runs of all other ratios.

    Returns one dict per run, as of `Model.recognise`. The ends (0 and 100 %) are then
    outside the training ratios: the answer is an extrapolation.
    """
    answers = []
    for held_out in runs:
        rest = [run for run in runs if run.gangue_ratio != held_out.gangue_ratio]
        answers.append(Model.fit(rest).recognise(held_out.signals, str(held_out.path)))
    return answers
