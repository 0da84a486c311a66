"""The function space of Section V-B-3: at each moment a fitted function QQ(beta).

Forms, as the paper offers them; all but the polynomial are a + b g(beta; c), with c found
by least squares:

    polynomial   a0 + a1 beta + ... , of a given degree, or the lowest that reaches R^2
    exponential  g = exp(c beta)
    logarithmic  g = ln(beta + c),      c >= 0.1
    power        g = (beta + 0.1)^c     ("nonlinear fitting"); 0.1 keeps beta = -0.05 inside
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from recognition.errors import RecognitionError
from recognition.least_squares import adjusted_r2, fit_polynomial, r2

POLYNOMIAL, EXPONENTIAL, LOGARITHMIC, POWER = FORMS = ("polynomial", "exponential", "logarithmic", "power")

SHIFT = 0.1

# QQ runs from 0 to 1; moments at which the training runs differ by less carry nothing.
FLAT = 1e-9


def _shape(form: str, beta, c):
    """g(beta; c) of the three forms that are not polynomials."""
    if form == EXPONENTIAL:
        return np.exp(c * beta)
    if form == LOGARITHMIC:
        return np.log(beta + c)
    return (beta + SHIFT) ** c


#: Where c is looked for. Near 0 an exponential, at large c a logarithm is a straight line.
BRACKETS = {EXPONENTIAL: (-8.0, 8.0), LOGARITHMIC: (SHIFT, 20.0), POWER: (0.1, 6.0)}


@dataclass(frozen=True)
class MomentFit:
    """A fitted function of one moment; parameters: lowest power first, or a, b, c."""

    form: str
    parameters: np.ndarray
    r2: float
    r2_adjusted: float


def fit_form(form: str, ratios: np.ndarray, values: np.ndarray) -> MomentFit:
    """Fit a + b g(beta; c): a and b by linear least squares for each c, c by bounded search."""

    def solve(c):
        design = np.column_stack([np.ones_like(ratios), _shape(form, ratios, c)])
        ab, *_ = np.linalg.lstsq(design, values, rcond=None)
        return ab, float(np.sum((values - design @ ab) ** 2))

    # From several starts: the error in c may have two valleys about the straight line.
    edges = np.linspace(*BRACKETS[form], 5)
    found = [
        minimize_scalar(lambda c: solve(c)[1], bounds=pair, method="bounded")
        for pair in itertools.pairwise(edges)
    ]
    c = float(min(found, key=lambda f: f.fun).x)
    ab, _ = solve(c)
    fitted = ab[0] + ab[1] * _shape(form, ratios, c)
    return MomentFit(form, np.array([*ab, c]), r2(values, fitted), adjusted_r2(values, fitted, 3))


@dataclass(frozen=True)
class FunctionSpace:
    """Functions of k moments. moments (k,): index of each in a curve; form (k,): index in FORMS;
    parameters (k, p), padded with 0."""

    moments: np.ndarray
    form: np.ndarray
    parameters: np.ndarray

    def __call__(self, k: np.ndarray, beta: np.ndarray) -> np.ndarray:
        """Value of function number k at beta, elementwise after broadcasting."""
        k, beta = np.broadcast_arrays(k, beta)
        kinds = np.unique(self.form)
        if kinds.size == 1:
            return self._of(int(kinds[0]), k, beta)
        out = np.empty(k.shape)
        for kind in kinds:
            chosen = self.form[k] == kind
            out[chosen] = self._of(int(kind), k[chosen], beta[chosen])
        return out

    def _of(self, kind: int, k: np.ndarray, beta: np.ndarray) -> np.ndarray:
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
    """

    forms: tuple[str, ...] = (POLYNOMIAL,)
    degree: int | None = None
    min_r2: float = 0.99
    max_degree: int = 4

    def fit(self, curves: np.ndarray, ratios: np.ndarray) -> FunctionSpace:
        """curves: shape (n, K); ratios: shape (n,). RecognitionError if no moment has a function."""
        unknown = [form for form in self.forms if form not in FORMS]
        if unknown or not self.forms:
            raise RecognitionError(f"forms = {list(self.forms)}; choose among {', '.join(FORMS)}")
        top = self._top_degree(np.unique(ratios).size)
        found = {k: self._fit_moment(ratios, values, top) for k, values in enumerate(curves.T)}
        found = {k: fit for k, fit in found.items() if fit is not None}
        if not found:
            raise RecognitionError(
                f"no moment has a {' or '.join(self.forms)} fit with R^2 >= {self.min_r2:g}"
            )
        width = max(fit.parameters.size for fit in found.values())
        return FunctionSpace(
            np.array(list(found)),
            np.array([FORMS.index(fit.form) for fit in found.values()]),
            np.stack([np.pad(fit.parameters, (0, width - fit.parameters.size)) for fit in found.values()]),
        )

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

    def _fit_moment(self, ratios, values, top) -> MomentFit | None:
        if np.ptp(values) < FLAT:
            return None
        fits = [fit for form in self.forms if (fit := self._try(form, ratios, values, top)) is not None]
        return max(fits, key=lambda fit: fit.r2_adjusted) if fits else None

    def _try(self, form, ratios, values, top) -> MomentFit | None:
        if form != POLYNOMIAL:
            fit = fit_form(form, ratios, values)
            return fit if fit.r2 >= self.min_r2 else None
        for degree in range(1, top + 1) if self.degree is None else [self.degree]:
            fit = fit_polynomial(ratios, values, degree)
            if fit.r2 >= self.min_r2 or self.degree is not None:
                return MomentFit(POLYNOMIAL, fit.coefficients, fit.r2, fit.r2_adjusted)
        return None
