"""What no recogniser can know: the least error that noise and the scatter between runs leave.

With x = m(theta) + e + n as in recognition/posterior.py the information on theta is I = J (S + s^2)^-1 J^T, J the slopes
of m (Cramer and Rao); a nuisance that is not told is in the inverse of all of I. The mean absolute error of a normally
distributed estimate is sqrt(2/pi) of its standard error.

Beside it what the simulation alone knows, the stones' impulse itself, says of runs that were held out: it has no noise, and
neither places nor the plate are in it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from recognition.channels import LIKELIHOOD_CHANNELS, Channels
from recognition.dataset import DataSet
from recognition.errors import RecognitionError
from recognition.evaluation import FOLDS, LEAST_FOLDS, write_whole
from recognition.likelihood import RatioLikelihood
from recognition.posterior import RatioPosterior, basis_slopes

#: name -> families that show the scatter, and conditions that are not told.
SETTINGS = {
    "packing": (("paper", "packing"), ()),
    "arrangement, packing": (("paper", "packing", "ring"), ()),
    "damping untold": (("damping",), ("damping_ratio",)),
    "speed untold": (("speed",), ("speed_m_s",)),
    "free positions": (("free",), ()),
    "arrival, strengths, places scatter": (("scatter",), ()),
    "everything varies": (("all",), ("speed_m_s", "damping_ratio")),
}


def least_error_points(model: RatioPosterior, noise_db: float | None, scatter: bool) -> float:
    """Mean over the ratios, the nuisances in the middle of their ranges, in points of mixing ratio.

    scatter: with e, else noise alone; noise_db: below each channel's rms in training, None for none. The least error is
    0 without either.
    """
    noise2 = 0.0 if noise_db is None else 10 ** (-noise_db / 10)
    variance = noise2 + (model.variance if scatter else 0.0 * model.variance)
    if not np.all(variance > 0):
        return 0.0
    half = 50 * (model.high - model.low)[0]
    errors = []
    for ratio in np.linspace(-1, 1, 11):
        slope = basis_slopes(np.concatenate([[ratio], np.zeros(len(model.low) - 1)]), model.powers) @ model.coefficients
        errors.append(half * np.sqrt(np.linalg.inv((slope / variance) @ slope.T)[0, 0]))
    return float(np.sqrt(2 / np.pi) * np.mean(errors))


TRUE_IMPULSE = "true impulse"


def true_impulse_errors_points(impulse_N_s: np.ndarray, ratios: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Errors (runs,) of a quadratic in the impulse, groups held out. RecognitionError for fewer than three groups."""
    count = np.unique(groups).size
    if count < LEAST_FOLDS:
        raise RecognitionError(f"{count} groups; needs at least {LEAST_FOLDS}")
    law = make_pipeline(PolynomialFeatures(2), StandardScaler(), LinearRegression())
    found = cross_val_predict(law, impulse_N_s[:, None], ratios, groups=groups, cv=GroupKFold(min(FOLDS, count)))
    return 100 * (found - ratios)


def bounds(data: DataSet, noises_db=(None, 40.0, 20.0)) -> pd.DataFrame:
    """A row a setting, set of channels and noise: noise_points (of noise alone), least_points (with the scatter), or the
    reason why they cannot be had; and a row of TRUE_IMPULSE, without noise: mean and worst error. Settings of which the data
    set has no run are left out."""
    rows = []
    for name, (families, conditions) in SETTINGS.items():
        chosen = data.of(*families)
        if not chosen.size:
            continue
        nuisance = data.table[list(conditions)].to_numpy()[chosen] if conditions else None
        rows.append({"setting": name, "channels": TRUE_IMPULSE, "runs": len(chosen), **_by_true_impulse(data, chosen)})
        for kind in LIKELIHOOD_CHANNELS:
            try:
                X = np.stack([Channels(kind).prepare(data.signals[k]) for k in chosen])
                model = RatioLikelihood().fit(X, data.ratios[chosen], nuisance=nuisance).posterior_
            except RecognitionError as reason:
                rows.append({"setting": name, "channels": kind, "runs": len(chosen), "reason": str(reason)})
                continue
            rows += [{"setting": name, "channels": kind, "noise_db": noise_db, "runs": len(chosen),
                      "noise_points": least_error_points(model, noise_db, False),
                      "least_points": least_error_points(model, noise_db, True)} for noise_db in noises_db]
    return pd.DataFrame(rows)


def _by_true_impulse(data: DataSet, chosen: np.ndarray) -> dict:
    try:
        impulse = np.array([float(data.runs[k].info["impulse_N_s"]) for k in chosen])
        error = true_impulse_errors_points(impulse, data.ratios[chosen], data.table["group"].to_numpy()[chosen])
    except (KeyError, TypeError):
        return {"reason": "a run.json has no impulse_N_s"}
    except RecognitionError as reason:
        return {"reason": str(reason)}
    return {"least_points": np.abs(error).mean(), "worst_points": np.abs(error).max()}


def write_bounds(data: DataSet, directory) -> Path:
    """Bounds of a data set; writes bounds.csv and returns its path."""
    return write_whole(bounds(data), Path(directory) / "bounds.csv")
