"""The rectangular mesh and its bicubic Hermite element for scikit-fem, which is slow to import."""

from __future__ import annotations

from typing import Any

import numpy as np
import skfem

from plate_fem.hermite import cubic


class RectangleBFS(skfem.ElementQuadBFS):
    """Bogner-Fox-Schmit element on axis-parallel rectangles, evaluated in the coordinates of each cell.

    scikit-fem's own uses powers of the global coordinates, whose round-off grows like (side / cell)^6.
    """

    def gbasis(self, mapping: Any, X: np.ndarray, i: int, tind: np.ndarray | None = None) -> tuple[Any]:
        """Return basis function i of each cell with its first two derivatives; scikit-fem calls this."""
        p, t = mapping.mesh.p, mapping.mesh.t if tind is None else mapping.mesh.t[:, tind]
        corner, kind = divmod(i, 4)  # corners counter-clockwise from lower left; kinds u, u_x, u_y, u_xy
        number = (2 * (corner in (1, 2)) + kind % 2, 2 * (corner in (2, 3)) + kind // 2)
        h = (p[:, t[2]] - p[:, t[0]])[:, :, None]
        fx, fy = ([cubic(number[a], X[a], h[a], order) for order in range(3)] for a in (0, 1))
        mixed = fx[1] * fy[1]
        field = skfem.element.DiscreteField(
            value=fx[0] * fy[0],
            grad=np.array([fx[1] * fy[0], fx[0] * fy[1]]),
            hess=np.array([[fx[2] * fy[0], mixed], [mixed, fx[0] * fy[2]]]),
        )
        return (field,)


def quad_mesh(lines_x_m: np.ndarray, lines_y_m: np.ndarray) -> skfem.MeshQuad:
    """Return the scikit-fem mesh of the grid; node (i, j) has number i * len(lines_y_m) + j."""
    x, y = np.meshgrid(lines_x_m, lines_y_m, indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    return skfem.MeshQuad(np.vstack([x.ravel(), y.ravel()]), np.vstack([c.ravel() for c in corners]))
