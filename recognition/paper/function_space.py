"""The function space of Section V-B-3: at each moment a fitted function QQ(beta).

Forms, as the paper offers them; all but the polynomial are a + b g(beta; c), with c found
by least squares:

    polynomial   a0 + a1 beta + ... , of a given degree, or the lowest that reaches R^2
    exponential  g = exp(c beta)
    logarithmic  g = ln(beta + c),      c >= 0.1
    power        g = (beta + 0.1)^c     ("nonlinear fitting"); 0.1 keeps beta = -0.05 inside
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recognition.estimation.arrays import Booleans, Floats, Integers
from recognition.estimation.errors import RecognitionError

POLYNOMIAL, EXPONENTIAL, LOGARITHMIC, POWER = FORMS = ("polynomial", "exponential", "logarithmic", "power")

SHIFT = 0.1

# QQ runs from 0 to 1; moments at which the training runs differ by less carry nothing.
FLAT = 1e-9


def _shape(form: str, beta: Floats, c: Floats) -> Floats:
    """g(beta; c) of the three forms that are not polynomials."""
    if form == EXPONENTIAL:
        return np.exp(c * beta)
    if form == LOGARITHMIC:
        return np.log(beta + c)
    return (beta + SHIFT) ** c


#: Where c is looked for. Near 0 an exponential, at large c a logarithm is a straight line.
BRACKETS = {EXPONENTIAL: (-8.0, 8.0), LOGARITHMIC: (SHIFT, 20.0), POWER: (0.1, 6.0)}
SCAN = 60
GOLDEN = (5**0.5 - 1) / 2
GOLDEN_STEPS = 40


@dataclass(frozen=True)
class Fits:
    """One form fitted to k moments. parameters (k, p): lowest power first, or a, b, c; r2, r2_adjusted (k,)."""

    form: str
    parameters: Floats
    r2: Floats
    r2_adjusted: Floats


def fit_form(form: str, ratios: Floats, values: Floats) -> Fits:
    """Fit a + b g(beta; c) to every column of values, shape (n, k).

    a and b by linear least squares for each c; c by a scan and golden section about its best.
    """
    scan = np.linspace(*BRACKETS[form], SCAN)
    scan = scan[np.abs(scan) > 1e-9]  # exp(0 beta) is no function of beta
    middle = values.mean(axis=0)
    off = values - middle
    squares = np.stack([_regress(form, ratios, off, np.array([c]))[2] for c in scan])
    best = np.argmin(squares, axis=0)
    low, high = scan[np.maximum(best - 1, 0)], scan[np.minimum(best + 1, scan.size - 1)]
    for _ in range(GOLDEN_STEPS):
        width = GOLDEN * (high - low)
        left_better = _regress(form, ratios, off, high - width)[2] < _regress(form, ratios, off, low + width)[2]
        low, high = np.where(left_better, low, high - width), np.where(left_better, low + width, high)
    c = 0.5 * (low + high)
    g, b, squares = _regress(form, ratios, off, c)
    return _fits(form, np.column_stack([middle - b * g, b, c]), squares, values, 3)


def _regress(form: str, ratios: Floats, off: Floats, c: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean of g, b and the sum of squared residuals of each column for given c, one for each or for all; off (n, k):
    the values less their mean."""
    g = _shape(form, ratios[:, None], c[None, :])
    middle = g.mean(axis=0)
    g_off = g - middle
    b = np.sum(g_off * off, axis=0) / np.sum(g_off**2, axis=0)
    return middle, b, np.sum((off - b * g_off) ** 2, axis=0)


def fit_polynomials(degree: int, ratios: Floats, values: Floats) -> Fits:
    """A polynomial of one degree for every column of values, shape (n, k), by least squares."""
    coefficients = np.polynomial.polynomial.polyfit(ratios, values, degree).astype(float)
    fitted = np.polynomial.polynomial.polyval(ratios, coefficients).T
    return _fits(POLYNOMIAL, coefficients.T, np.sum((values - fitted) ** 2, axis=0), values, degree + 1)


def _fits(form: str, parameters: Floats, squares: Floats, values: Floats, count: int) -> Fits:
    r2 = 1.0 - squares / np.sum((values - values.mean(axis=0)) ** 2, axis=0)
    spare = values.shape[0] - count
    return Fits(form, parameters, r2, 1.0 - (1.0 - r2) * (values.shape[0] - 1) / spare)


@dataclass(frozen=True)
class FunctionSpace:
    """Functions of k moments of curves that have n_moments. moments (k,): index of each in a curve; form (k,): index in
    FORMS; parameters (k, p), padded with 0. ValueError for arrays that do not fit together."""

    n_moments: int
    moments: Integers
    form: Integers
    parameters: Floats

    def __post_init__(self) -> None:
        if not (self.parameters.ndim == 2 and self.moments.shape == self.form.shape == self.parameters.shape[:1]):
            raise ValueError("moments, form and parameters are not of one length")
        if self.moments.size == 0 or self.moments.min() < 0 or self.moments.max() >= self.n_moments:
            raise ValueError(f"moments lie outside 0..{self.n_moments - 1}")
        if self.form.min() < 0 or self.form.max() >= len(FORMS):
            raise ValueError(f"forms lie outside 0..{len(FORMS) - 1}")

    @cached_property
    def _kinds(self) -> Integers:
        """The forms that there are."""
        return np.unique(self.form)

    def __call__(self, k: Integers, beta: Floats) -> Floats:
        """Value of function number k at beta, elementwise after broadcasting."""
        if self._kinds.size == 1:
            return np.broadcast_to(self._of(int(self._kinds[0]), k, beta), np.broadcast_shapes(k.shape, beta.shape))
        k, beta = np.broadcast_arrays(k, beta)
        out = np.empty(k.shape)
        for kind in self._kinds:
            chosen = self.form[k] == kind
            out[chosen] = self._of(int(kind), k[chosen], beta[chosen])
        return out

    def _of(self, kind: int, k: Integers, beta: Floats) -> Floats:
        p = self.parameters
        if FORMS[kind] != POLYNOMIAL:
            return p[k, 0] + p[k, 1] * _shape(FORMS[kind], beta, p[k, 2])
        value = p[k, -1]
        for power in range(p.shape[1] - 2, -1, -1):
            value = value * beta + p[k, power]
        return value


@dataclass(frozen=True)
class Rule:
    """How each moment gets its function.

    forms: those tried; of several the best adjusted R^2 wins. degree: of the polynomial, or
    None for the paper's rule: the lowest degree with R^2 >= min_r2, at most max_degree. A
    moment whose best R^2 is below min_r2, or at which all runs agree, has no function.

    >>> ratios = np.linspace(0, 1, 6)
    >>> space = Rule(degree=2).fit(np.column_stack([ratios, ratios**2]), ratios)
    >>> space(np.array([0, 1]), np.array([0.5, 0.5])).round(6).tolist()
    [0.5, 0.25]
    """

    forms: tuple[str, ...] = (POLYNOMIAL,)
    degree: int | None = None
    min_r2: float = 0.99
    max_degree: int = 4

    def __post_init__(self) -> None:
        if not self.forms or not set(self.forms) <= set(FORMS):
            raise RecognitionError(f"forms = {list(self.forms)}; choose among {', '.join(FORMS)}")

    def fit(self, curves: Floats, ratios: Floats) -> FunctionSpace:
        """curves: shape (n, K); ratios: shape (n,). RecognitionError if no moment has a function."""
        top = self._top_degree(np.unique(ratios).size)
        moments = np.flatnonzero(np.ptp(curves, axis=0) >= FLAT)
        chosen = Chosen(moments.size)
        for form in self.forms:
            chosen.take(self._fit_one(form, ratios, curves[:, moments], top))
        if not chosen.found.any():
            raise RecognitionError(f"no moment has a {' or '.join(self.forms)} fit with R^2 >= {self.min_r2:g}")
        found = chosen.found
        used = np.flatnonzero(chosen.parameters[found].any(axis=0)).max() + 1
        return FunctionSpace(curves.shape[1], moments[found], chosen.form[found], chosen.parameters[found, :used])

    def _top_degree(self, ratios: int) -> int:
        # One ratio more than coefficients, else R^2 = 1 says nothing.
        wanted = self.max_degree if self.degree is None else self.degree
        top = min(wanted, ratios - 2)
        needed = 1 if self.degree is None else self.degree
        if self.forms != (POLYNOMIAL,):
            needed = max(needed, 2)  # a, b and c
        if top < needed:
            raise RecognitionError(f"{ratios} mixing ratios; this rule needs at least {needed + 2}")
        return top

    def _fit_one(self, form: str, ratios: Floats, values: Floats, top: int) -> Chosen:
        """The fits of one form that count, each moment's."""
        own = Chosen(values.shape[1])
        if form != POLYNOMIAL:
            fits = fit_form(form, ratios, values)
            own.fill(fits, fits.r2 >= self.min_r2)
        elif self.degree is not None:
            own.fill(fit_polynomials(self.degree, ratios, values), np.ones(values.shape[1], dtype=bool))
        else:
            for degree in range(1, top + 1):
                fits = fit_polynomials(degree, ratios, values)
                own.fill(fits, ~own.found & (fits.r2 >= self.min_r2))
        return own


class Chosen:
    """The fit chosen so far for each of k moments; NaN adjusted R^2 where there is none."""

    def __init__(self, count: int) -> None:
        self.form = np.zeros(count, dtype=int)
        self.parameters = np.zeros((count, 1))
        self.r2_adjusted = np.full(count, np.nan)

    @property
    def found(self) -> Booleans:
        return np.isfinite(self.r2_adjusted)

    def fill(self, fits: Fits, where: Booleans) -> None:
        """Take these fits at some moments."""
        self._widen(fits.parameters.shape[1])
        self.form[where] = FORMS.index(fits.form)
        self.parameters[where] = 0.0
        self.parameters[where, : fits.parameters.shape[1]] = fits.parameters[where]
        self.r2_adjusted[where] = fits.r2_adjusted[where]

    def take(self, other: Chosen) -> None:
        """Take another choice wherever its adjusted R^2 is better."""
        self._widen(other.parameters.shape[1])
        better = other.found & ~(self.r2_adjusted >= other.r2_adjusted)
        self.form[better] = other.form[better]
        self.parameters[better] = 0.0
        self.parameters[better, : other.parameters.shape[1]] = other.parameters[better]
        self.r2_adjusted[better] = other.r2_adjusted[better]

    def _widen(self, width: int) -> None:
        self.parameters = np.pad(self.parameters, ((0, 0), (0, max(0, width - self.parameters.shape[1]))))
