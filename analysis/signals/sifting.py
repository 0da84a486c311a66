"""PyEMD's sifting with a faster spline. The module is imported late, as PyEMD is slow to import.

PyEMD imports its drawings, and Matplotlib with them, with whatever is asked of it; only its module EMD is taken here.

The spline is the same curve as scipy's CubicSpline. A decomposition makes a hundred splines through some tens of
points, and scipy's preparation of each takes several times as long as its evaluation.
"""

import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType

import numpy as np

#: PyEMD takes its other splines from it, none of which `LeanEMD` uses. It takes a third of the time of a short record.
INTERPOLATION = "scipy.interpolate"


def _without_its_package(package: str, module: str) -> ModuleType:
    """Return a module of a package without what the package imports when it is imported itself, which is left to who
    imports it."""
    if package in sys.modules:
        return import_module(f"{package}.{module}")
    spec = importlib.util.find_spec(package)
    if spec is None:
        raise ModuleNotFoundError(f"No module named {package!r}", name=package)
    sys.modules[package] = importlib.util.module_from_spec(spec)  # not executed
    try:
        with _late(INTERPOLATION):
            return import_module(f"{package}.{module}")
    finally:
        for name in [name for name in sys.modules if f"{name}.".startswith(f"{package}.")]:
            del sys.modules[name]


@contextmanager
def _late(name: str) -> Iterator[None]:
    """Let what is taken from a module inside the block be imported when it is first called."""
    if name in sys.modules:
        yield
        return
    stand_in = ModuleType(name)
    stand_in.__getattr__ = lambda function: lambda *given, **named: getattr(  # type: ignore[method-assign]
        import_module(name), function)(*given, **named)
    sys.modules[name] = stand_in
    try:
        yield
    finally:
        del sys.modules[name]


EMD = _without_its_package("PyEMD", "EMD").EMD
#: As scipy.linalg.lapack has it, which takes longer to import than a short record to analyse.
dgtsv = _without_its_package("scipy.linalg", "_flapack").dgtsv


class LeanEMD(EMD):  # type: ignore[misc, valid-type]
    """PyEMD with `not_a_knot` for its cubic splines of four points and more, and one extremum where it finds two at
    one time: at either end of equal samples."""

    def find_extrema(self, T: np.ndarray, S: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return times and values of the maxima, the same of the minima, and the zero crossings."""
        top_t, top, bottom_t, bottom, zeros = super().find_extrema(T, S)
        tops, bottoms = (_apart(t, 0.5 * (T[1] - T[0])) for t in (top_t, bottom_t))
        return top_t[tops], top[tops], bottom_t[bottoms], bottom[bottoms], zeros

    def spline_points(self, T: np.ndarray, extrema: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the times of T between the extrema (2, n), times and values, and the spline through these there."""
        if self.spline_kind != "cubic" or extrema.shape[1] < 4:
            return super().spline_points(T, extrema)
        t = T[(T >= extrema[0, 0]) & (T <= extrema[0, -1])]
        return t, not_a_knot(extrema[0], extrema[1], t)


def _apart(t: np.ndarray, least: float) -> np.ndarray:
    """Which of the ascending times are later than the one before by more than this."""
    later = np.ones(len(t), bool)
    later[1:] = t[1:] - t[:-1] > least
    return later


def not_a_knot(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the values, at the ascending abscissae `at`, of the not-a-knot spline through at least four points (x, y).

    The slopes s obey h1 s0 + 2 (h0 + h1) s1 + h0 s2 = 3 (h1 d0 + h0 d1), h being the steps of the ascending x and d the
    slopes of the chords. The first and the last row demand that the third derivative is the same on both sides of the
    second and of the last but one knot.
    """
    h = x[1:] - x[:-1]
    d = (y[1:] - y[:-1]) / h
    n = len(x)
    low, middle, high, right = np.empty(n - 1), np.empty(n), np.empty(n - 1), np.empty(n)
    low[:-1], middle[1:-1], high[1:] = h[1:], 2 * (h[:-1] + h[1:]), h[:-1]
    right[1:-1] = 3 * (h[1:] * d[:-1] + h[:-1] * d[1:])
    middle[0], high[0] = h[1], h[0] + h[1]
    right[0] = ((h[0] + 2 * high[0]) * h[1] * d[0] + h[0] ** 2 * d[1]) / high[0]
    middle[-1], low[-1] = h[-2], h[-1] + h[-2]
    right[-1] = (h[-1] ** 2 * d[-2] + (2 * low[-1] + h[-1]) * h[-2] * d[-1]) / low[-1]
    s = dgtsv(low, middle, high, right, 1, 1, 1, 1)[3]
    k = np.searchsorted(x[1:-1], at, side="right")
    u = at - x[k]
    bend = (s[:-1] + s[1:] - 2 * d) / h
    return y[k] + u * (s[k] + u * ((d[k] - s[k]) / h[k] - bend[k] + u * (bend / h)[k]))
