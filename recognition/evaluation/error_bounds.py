"""What no recogniser can know: the least error that noise and the scatter between runs leave.

With x = m(theta) + e + n as in recognition/regression/ratio_posterior.py the information on theta is I = J (S + s^2)^-1 J^T, J the slopes
of m (Cramer and Rao); a nuisance that is not told is in the inverse of all of I. The mean absolute error of a normally
distributed estimate is sqrt(2/pi) of its standard error.

For stones that fall on known places the probability of each ratio is known (recognition/physics/arrangement_likelihood.py), and so is the least
error: that of its mean, over records drawn from the model itself.

Beside it what the simulation alone knows, the stones' impulse itself, says of runs that were held out: it has no noise, and
neither places nor the plate are in it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from analysis import RecordError
from recognition.channels import LIKELIHOOD_CHANNELS, Channels
from recognition.errors import RecognitionError
from recognition.evaluation.cross_validation import FOLDS, LEAST_FOLDS, write_whole
from recognition.evaluation.dataset import FAST_TIMES, DataSet
from recognition.physics.arrangement_likelihood import StoneNumbers, Stones
from recognition.regression.ratio_likelihood import RatioLikelihood
from recognition.regression.ratio_posterior import RatioPosterior, basis_slopes

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


STONES = "stones"
DRAWS = 400
UNKNOWN_M = (0.0, 0.01, 0.025)  # the last is a stone's radius
PLACED = 10


def stones_error_points(numbers: StoneNumbers, noise: np.ndarray, seed: int = 0) -> float:
    """Mean absolute error over DRAWS records of the model itself, all ratios and speeds equally likely; noise (channels,):
    standard deviation of the sensors' noise."""
    rng, n = np.random.default_rng(seed), numbers.stones
    variance = np.repeat(numbers.rest**2 + (noise / numbers.scale) ** 2, numbers.samples)
    root = np.linalg.cholesky(numbers.scatter + np.diag(variance))
    errors = []
    for _ in range(DRAWS):
        count, speed_m_s = rng.integers(n + 1), rng.uniform(numbers.low_m_s, numbers.high_m_s)
        which = np.append(1.0, rng.permutation(n) < count)
        x = (numbers.mean_at(speed_m_s) @ which + root @ rng.standard_normal(len(root))).reshape(len(noise), -1)
        record = np.column_stack([x * numbers.scale[:, None], noise])
        errors.append(numbers.estimate(record).ratio - count / n)
    return float(100 * np.abs(errors).mean())


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
        rows += _by_stones(data, name, chosen, noises_db)
    rows += _by_told_places(data, noises_db)
    return pd.DataFrame(rows)


def _by_stones(data: DataSet, name: str, chosen: np.ndarray, noises_db) -> list[dict]:
    """At the records' own rate, and at six times that."""
    from recognition.physics.arrangement_fit import fit_numbers  # late: it needs the simulation's plate model

    rows: list[dict] = []
    groups, lessons = data.table["group"].to_numpy()[chosen], [data.lessons[k] for k in chosen]
    for channels, times in ((STONES, 1), (f"{STONES}, {FAST_TIMES} times the rate", FAST_TIMES)):
        row = {"setting": name, "channels": channels, "runs": len(chosen)}
        try:
            records = [(data.signals if times == 1 else data.fast)[k] for k in chosen]
            X = np.stack([Stones().prepare(signals) for signals in records])
            numbers = fit_numbers(X, [one and replace(one, sample_s=one.sample_s / times) for one in lessons], groups)
        except (RecordError, RecognitionError) as reason:
            rows.append(row | {"reason": str(reason)})
            continue
        rows += [row | {"noise_db": db, "least_points": stones_error_points(numbers, noise)}
                 for db, noise in _noises(records, noises_db).items()]
    return rows


def _by_told_places(data: DataSet, noises_db) -> list[dict]:
    """Stones anywhere on the plate, if every place were told to within UNKNOWN_M: the forces are those of stones on the
    circle, the mean is over PLACED runs."""
    from recognition.physics.arrangement_fit import (  # late: it needs the simulation's plate model
        learn,
        numbers_on,
    )

    circle, free = data.of(*SETTINGS["arrangement, packing"][0]), data.of("free")[:PLACED]
    if not (circle.size and free.size):
        return []
    try:
        records = [data.signals[k] for k in circle]
        X, groups = np.stack([Stones().prepare(one) for one in records]), data.table["group"].to_numpy()[circle]
        learnt, _ = learn(X, [data.lessons[k] for k in circle], groups)
    except (RecordError, RecognitionError) as reason:
        return [{"setting": "free positions", "channels": f"{STONES}, places told", "runs": len(free), "reason": str(reason)}]
    rows, noises = [], _noises(records, noises_db)
    for unknown_m in UNKNOWN_M:
        row = {"setting": "free positions", "channels": f"{STONES}, places told to {1000 * unknown_m:g} mm", "runs": len(free)}
        numbers = [numbers_on(learnt, data.lessons[k], unknown_m) for k in free if data.lessons[k] is not None]
        rows += [row | {"noise_db": db, "least_points": np.mean([stones_error_points(one, noise) for one in numbers])}
                 for db, noise in noises.items() if numbers]
    return rows


def _noises(records: list[pd.DataFrame], noises_db) -> dict[float | None, np.ndarray]:
    """Standard deviations (channels,), each so far below the records' mean rms."""
    rms = np.sqrt(np.mean([np.mean(Channels("plate").prepare(one) ** 2, axis=1) for one in records], axis=0))
    return {db: rms * (0.0 if db is None else 10 ** (-db / 20)) for db in noises_db}


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
