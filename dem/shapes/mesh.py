"""Closed surfaces of triangles that need not be convex: what is inside, how far the surface is, and what is refused."""

from __future__ import annotations

import numpy as np

BLOCK = 1 << 20  # pairs of a point and a triangle that are looked at together
LEAST_CLEARANCE = 1e-9  # of the size
TINY = 1e-300  # in place of zero, for triangles and sides of no extent


def winding_number(point: np.ndarray, corner: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """How often a closed surface goes round each point (n, 3): 1 inside, 0 outside. The sum of the solid angles of its
    triangles over 4 pi, each by A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125."""
    turns = np.empty(len(point))
    for here in _blocks(len(point), len(triangle)):
        a, b, c = (corner[triangle[:, k]] - point[here, None] for k in range(3))
        la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
        over = np.einsum("ptk,ptk->pt", a, np.cross(b, c))
        under = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
        turns[here] = np.arctan2(over, under).sum(axis=1) / (2 * np.pi)
    return turns


def nearest_points(point: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """The nearest point (m, 3) of each triangle a, b, c (m, 3) to each `point` (m, 3): that of the plane where it lies
    in the triangle, else the nearest one of its sides."""
    normal = np.cross(b - a, c - a)
    foot = point - (_dot(point - a, normal) / np.maximum(_dot(normal, normal), TINY))[:, None] * normal
    on_sides = [_on_side(point, p, q) for p, q in ((a, b), (b, c), (c, a))]
    away = np.stack([((point - at) ** 2).sum(axis=1) for at in on_sides])
    best = np.stack(on_sides)[away.argmin(axis=0), np.arange(len(point))]
    inside = np.all([_dot(np.cross(q - p, foot - p), normal) >= 0 for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return np.where(inside[:, None], foot, best)


def _on_side(point: np.ndarray, p: np.ndarray, q: np.ndarray) -> np.ndarray:
    share = np.clip(_dot(point - p, q - p) / np.maximum(_dot(q - p, q - p), TINY), 0, 1)
    return p + share[:, None] * (q - p)


def fault_of(corner: np.ndarray, triangle: np.ndarray) -> str | None:
    """Why a surface of triangles bounds no solid, or None: each side must belong to two triangles that are turned the
    same way, and no triangle may cut another one."""
    sides = np.vstack([triangle[:, [0, 1]], triangle[:, [1, 2]], triangle[:, [2, 0]]])
    if np.any(np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)[1] != 2):
        return "must hold a closed surface: an edge does not belong to two triangles"
    if len(np.unique(sides, axis=0)) < len(sides):
        return "must hold a closed surface whose triangles are all turned the same way"
    cut = _first_cut(corner, triangle, sides[sides[:, 0] < sides[:, 1]])
    if cut is not None:
        return "must not cut itself, as it does at (" + ", ".join(f"{x:.4g}" for x in cut) + ")"
    return None


def _first_cut(corner: np.ndarray, triangle: np.ndarray, side: np.ndarray) -> np.ndarray | None:
    """A point (3,) where a side passes through a triangle of which it has no corner."""
    size = np.ptp(corner, axis=0).max()
    low, high = corner[triangle].min(axis=1), corner[triangle].max(axis=1)
    a, normal = corner[triangle[:, 0]], np.cross(corner[triangle[:, 1]] - corner[triangle[:, 0]],
                                                 corner[triangle[:, 2]] - corner[triangle[:, 0]])
    for here in _blocks(len(side), len(triangle)):
        p, q = corner[side[here, 0]], corner[side[here, 1]]
        near = np.all((np.minimum(p, q)[:, None] <= high) & (np.maximum(p, q)[:, None] >= low), axis=2)
        near &= ~(side[here, None, :, None] == triangle[None, :, None, :]).any(axis=(2, 3))
        k, t = np.nonzero(near)
        start, end = (_dot(end[k] - a[t], normal[t]) for end in (p, q))
        least = LEAST_CLEARANCE * size * np.linalg.norm(normal[t], axis=1)
        through = (np.minimum(start, end) < -least) & (np.maximum(start, end) > least)
        k, t, share = k[through], t[through], (start / np.where(through, start - end, 1.0))[through]
        at = p[k] + share[:, None] * (q[k] - p[k])
        miss = np.linalg.norm(at - nearest_points(at, *(corner[triangle[t, m]] for m in range(3))), axis=1)
        if np.any(miss < LEAST_CLEARANCE * size):
            found: np.ndarray = at[miss.argmin()]
            return found
    return None


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(axis=-1)


def _blocks(rows: int, columns: int) -> list[slice]:
    step = max(1, BLOCK // max(1, columns))
    return [slice(k, k + step) for k in range(0, rows, step)]
