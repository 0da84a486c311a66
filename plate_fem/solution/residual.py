"""Static compliance of the modes left out, as a few more modes (residual vectors).

Far below its frequency a mode answers statically: shape^2 / omega^2 times the force. The static deflection under a
unit load at each given point, less what the kept modes give, holds exactly what the modes left out would add. Made
orthogonal (Ritz), these deflections are further modes that move like the others (Dickens, Nakagawa and Wittbrodt
1997, Comput. Struct. 62:985).

A load may also be a unit displacement of a rod's foot. By Maxwell and Betti the deflection under it at a place is the
share of a force there that the rod bears. With these deflections among the modes, each rod bears its exact share of
a steady force anywhere on the plate. All feet lifted together lift the plate as a rigid body, which is then a motion of
the modes too: the force on the plate less that on the rods is its change of momentum, at any time.

In Kirchhoff's theory the load is a point force. In Mindlin's the deflection under a point force is infinite, and the
load acts on a disc. A plate under a point force at its top moves there by the indentation of a half-space, which
contact laws count, and by a remainder. For an infinite elastic layer, loaded with wavenumber k, the remainder is
U(k) = 2 (1 - nu^2) / (E k) * [(sinh x cosh x + x) / (sinh^2 x - x^2) - 1], x = k t. Beyond a cut-off k t of 0.4 to 1.6
a disc of radius 1.4 t gives a Mindlin plate the compliance of this integral within 16 % (nu = 0.3).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from plate_fem.solution.eigen import solve_static
from plate_fem.solution.model import PlateModel

LOAD_RADIUS = 1.4  # times the thickness


def residual_modes(model: PlateModel, kept: sp.csc_array, loads: sp.csr_array) -> tuple[np.ndarray, np.ndarray]:
    """Return omega^2 (m,) in 1/s^2 and vectors (n, m) of the residual modes for loads, sparse (k, n), with m <= k.

    `kept`, sparse (n, p), holds the mass-normalised modes of the model that are kept. A load at a point is a row of
    elements.rods.load_rows times model.expansion; the displacement of a rod's foot is a row of model.rod_force. Raises
    RuntimeError where a load has no response.
    """
    projected = loads.T.toarray() - model.mass @ (kept @ (loads @ kept).toarray().T)
    response = solve_static(model.parts, projected)
    response -= kept @ (kept.T @ (model.mass @ response))
    squares = np.einsum("ij,ij->j", response, model.mass @ response)
    if not (squares > 0).all():  # a number that is none, too
        raise RuntimeError("the static response to a load is nothing that can be told from rounding")
    response /= np.sqrt(squares)
    size, directions = np.linalg.eigh(response.T @ (model.mass @ response))
    independent = size > 1e-8  # loads at one place, or mirrored ones on a held edge, have one response
    basis = response @ (directions[:, independent] / np.sqrt(size[independent]))
    omega_squared, combination = scipy.linalg.eigh(basis.T @ (model.stiffness @ basis))
    return omega_squared, basis @ combination
