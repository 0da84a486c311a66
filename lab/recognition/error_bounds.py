"""The least error that noise and the scatter between runs leave to any method.

By the law of a record x = m(theta) + e + n (recognition/regression/ratio_law.py) the information on theta is I = J (S +
s^2)^-1 J^T, J the slopes of m (Cramer and Rao); the inverse of all of I counts the conditions that are unknown too. The
mean absolute error of a normally distributed estimate is sqrt(2/pi) times its standard error.

For stones that fall on known places the probability of each ratio is known
(recognition/physics/arrangement_likelihood.py), and so is the least error: that of the median of this probability, over
records drawn from the model itself.

Beside these stands the error of a regression on the true impulse of the stones, which only the simulation knows, on
runs that were held out. The impulse has no noise and depends neither on the places nor on the plate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from analysis import RecordError
from recognition.estimation.arrays import Floats, Integers
from recognition.estimation.errors import RecognitionError
from recognition.estimation.window import channels_of
from recognition.evaluation.cross_validation import FOLDS, LEAST_FOLDS, Noises
from recognition.evaluation.dataset import DataSet
from recognition.physics.arrangement_fit import PlateRecord, fit_model, force_statistics, model_on
from recognition.physics.arrangement_likelihood import ArrangementModel
from recognition.physics.arrangement_method import ArrangementLikelihood
from recognition.regression.ratio_law import RatioLaw, basis_slopes, fit_law

#: name -> families that show the scatter, and conditions that are unknown.
SETTINGS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "arrangement, packing": (("paper", "clean"), ()),
    "damping unknown": (("damping",), ("damping_ratio",)),
    "speed unknown": (("speed",), ("speed_m_s",)),
    "free positions": (("free",), ()),
    "stones": (("stones",), ()),
    "natural": (("natural",), ()),
}
NOISES_DB = (None, 40.0, 20.0)

#: Channels of the bounds by the ratio alone.
LAW_CHANNELS = ("centre", "accelerometers", "rods", "all")

ARRANGEMENTS = "arrangement likelihood"
DRAWS = 400
PLACE_DEVIATIONS_M = (0.0, 0.01, 0.025)  # the last is a stone's radius
PLACED_RUNS = 10

TRUE_IMPULSE = "true impulse"

COLUMNS = ["setting", "channels", "runs", "noise_db", "noise_points", "least_points", "worst_points", "reason"]
Rows = list[dict[str, Any]]


def least_error_points(law: RatioLaw, noise_db: float | None, scatter: bool) -> float:
    """Mean absolute error in points of ratio, averaged over the ratios, conditions unknown and in the middle of their
    ranges.

    scatter: of other arrangements, packings; noise_db: below each channel's rms in training, None for none. The least
    error is 0 without either.
    """
    noise2 = 0.0 if noise_db is None else 10 ** (-noise_db / 10)
    variance = noise2 + (law.variance if scatter else 0.0 * law.variance)
    if not np.all(variance > 0):
        return 0.0
    half = 50 * (law.high - law.low)[0]
    errors = []
    for ratio in np.linspace(-1, 1, 11):
        slope = basis_slopes(np.concatenate([[ratio], np.zeros(len(law.low) - 1)]), law.powers) @ law.coefficients
        errors.append(half * np.sqrt(np.linalg.inv((slope / variance) @ slope.T)[0, 0]))
    return float(np.sqrt(2 / np.pi) * np.mean(errors))


def arrangement_error_points(model: ArrangementModel, noise: Floats, seed: int = 0) -> float:
    """Mean absolute error over DRAWS records of the model itself, all ratios and speeds equally likely and the moment
    of the impact known; noise (channels,): standard deviation of the sensors' noise. The answer is the median of the
    posterior, which no other answer to records of this model passes (Bayes' risk of the absolute error)."""
    rng, n = np.random.default_rng(seed), model.stones
    variance = np.repeat(model.residual**2 + (noise / model.scale) ** 2, model.samples)
    root = np.linalg.cholesky(model.law_at(0.0).covariance + np.diag(variance))
    errors = []
    for _ in range(DRAWS):
        count, speed_m_s = rng.integers(n + 1), rng.uniform(model.low_m_s, model.high_m_s)
        which = np.append(1.0, rng.permutation(n) < count)
        x = (model.mean_at(speed_m_s) @ which + root @ rng.standard_normal(len(root))).reshape(len(noise), -1)
        errors.append(model.estimate(x * model.scale[:, None], noise, arrival_s=0.0).median - count / n)
    return float(100 * np.abs(errors).mean())


def true_impulse_errors_points(impulse_N_s: Floats, ratios: Floats, groups: NDArray[Any]) -> Floats:
    """Errors (runs,) of a quadratic in the impulse, groups held out. RecognitionError for fewer than three groups."""
    count = np.unique(groups).size
    if count < LEAST_FOLDS:
        raise RecognitionError(f"{count} groups; needs at least {LEAST_FOLDS}")
    law = make_pipeline(PolynomialFeatures(2), StandardScaler(), LinearRegression())
    found = cross_val_predict(law, impulse_N_s[:, None], ratios, groups=groups, cv=GroupKFold(min(FOLDS, count)))
    return 100 * (found - ratios)


def bounds(data: DataSet, noises_db: Noises = NOISES_DB) -> pd.DataFrame:
    """A row a setting, set of channels and noise: noise_points (of noise alone), least_points (with the scatter), or
    the reason why they cannot be had; and a row of TRUE_IMPULSE, without noise: mean and worst error. Settings of which
    the data set has no run are left out."""
    rows: Rows = []
    for name, (families, conditions) in SETTINGS.items():
        chosen = data.of(*families)
        if not chosen.size:
            continue
        row = {"setting": name, "runs": len(chosen)}
        rows.append(row | {"channels": TRUE_IMPULSE} | _by_true_impulse(data, chosen))
        rows += [row | more for more in _by_law(data, chosen, conditions, noises_db)]
        rows += [row | more for more in _by_arrangements(data, chosen, noises_db)]
    rows += _by_known_places(data, noises_db)
    return pd.DataFrame(rows, columns=COLUMNS)


def _or_reason(row: dict[str, Any], rows: Callable[[], Rows]) -> Rows:
    """Rows that complete `row`, or the row with the reason why there are none."""
    try:
        return [row | one for one in rows()]
    except (RecordError, RecognitionError) as reason:
        return [row | {"reason": str(reason)}]


def _by_law(data: DataSet, chosen: Integers, conditions: tuple[str, ...],
            noises_db: Noises) -> Iterator[dict[str, Any]]:
    nuisance = data.table[list(conditions)].to_numpy()[chosen] if conditions else None

    def rows(kind: str) -> Rows:
        X = np.stack([channels_of(data.signals[k], kind) for k in chosen])
        law = fit_law(X, data.ratios[chosen], nuisance)
        return [{"noise_db": noise_db, "noise_points": least_error_points(law, noise_db, False),
                 "least_points": least_error_points(law, noise_db, True)} for noise_db in noises_db]

    for kind in LAW_CHANNELS:
        yield from _or_reason({"channels": kind}, partial(rows, kind))


def _by_arrangements(data: DataSet, chosen: Integers, noises_db: Noises) -> Iterator[dict[str, Any]]:
    def rows() -> Rows:
        signals = [data.signals[k] for k in chosen]
        model = fit_model(_plate_records(data, chosen), data.table["kin"].to_numpy()[chosen])
        return [{"noise_db": db, "least_points": arrangement_error_points(model, noise)}
                for db, noise in _noises(signals, noises_db).items()]

    yield from _or_reason({"channels": ARRANGEMENTS}, rows)


def _by_known_places(data: DataSet, noises_db: Noises) -> Rows:
    """Stones anywhere on the plate, if every place were known to within each of PLACE_DEVIATIONS_M: the forces are
    those of stones on the circle, the mean is over PLACED_RUNS runs."""
    circle, free = data.of(*SETTINGS["arrangement, packing"][0]), data.of("free")[:PLACED_RUNS]
    if not (circle.size and free.size):
        return []
    row = {"setting": "free positions", "runs": len(free)}

    def rows() -> Rows:
        statistics, _ = force_statistics(_plate_records(data, circle), data.table["kin"].to_numpy()[circle])
        noises = _noises([data.signals[k] for k in circle], noises_db)
        forces = [one.force_record for one in _plate_records(data, free) if one.force_record is not None]
        found = []
        for deviation_m in PLACE_DEVIATIONS_M:
            channels = {"channels": f"{ARRANGEMENTS}, places known to {1000 * deviation_m:g} mm"}
            models = [model_on(statistics, one, deviation_m) for one in forces]
            for db, noise in noises.items() if models else ():
                errors = [arrangement_error_points(model, noise) for model in models]
                found.append(channels | {"noise_db": db, "least_points": np.mean(errors)})
        return found

    return _or_reason(row | {"channels": f"{ARRANGEMENTS}, places known"}, rows)


def _plate_records(data: DataSet, chosen: Integers) -> list[PlateRecord]:
    """Raises RecordError, RecognitionError."""
    return [ArrangementLikelihood().prepare(data.signals[k], data.runs[k]) for k in chosen]


def _noises(records: list[pd.DataFrame], noises_db: Noises) -> dict[float | None, Floats]:
    """Standard deviations (channels,), each so far below the records' mean rms."""
    rms = np.sqrt(np.mean([np.mean(channels_of(one, "plate") ** 2, axis=1) for one in records], axis=0))
    return {db: rms * (0.0 if db is None else 10 ** (-db / 20)) for db in noises_db}


def _by_true_impulse(data: DataSet, chosen: Integers) -> dict[str, Any]:
    try:
        impulses = [data.runs[k].summary.impulse_N_s for k in chosen]
        if None in impulses:
            return {"reason": "a run.json has no impulse_N_s"}
        impulse = np.array(impulses, dtype=float)
        error = true_impulse_errors_points(impulse, data.ratios[chosen], data.table["kin"].to_numpy()[chosen])
    except RecognitionError as reason:
        return {"reason": str(reason)}
    return {"least_points": np.abs(error).mean(), "worst_points": np.abs(error).max()}
