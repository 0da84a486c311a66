"""Mean and covariance of the record of a volley, for each number of gangue stones in it.

A record is x = sum_i J_i r(place_i, delay_i) + e, with impulses J by material and responses r = sum_k phi_k(place) a_k.
Places and delays of stones are independent draws, so that

    mean = (sum J_i) E[r],    covariance = (sum E[J_i^2]) E[r r'] - (sum E[J_i]^2) E[r] E[r]'

with the expectations over places and delays. To this come what the taps left unknown of the plate, impulses that
differ by a factor common to all stones, and the noise of the sensors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.plate.plate_model import PlateModel
from recognition.stream.forces import StoneForces
from recognition.volley.responses import DELAY_STEP_S, SPREAD_S, HIGHEST_Hz, Responses, Stones

#: How far from the plate's centre stones fall, as shares of its half sides: all are tried, as nobody knows.
REACHES = (0.4, 0.6, 0.8, 1.0)
#: Impulse of a stone of a volley in m v, of coal and of gangue, where stones fall as near as on the paper's circle and
#: anywhere: of ten stones at 3 m/s in the families `ring` and `free` of scenes/dataset.toml. Alone a stone pushes up to
#: 7 % more: here others move the plate away from it, the more the nearer they are.
NEAR_SHARE, FAR_SHARE = np.array([1.774, 1.693]), np.array([1.816, 1.762])
COMMON_SD, OWN_SD = 0.02, 0.02  # relative, of the impulses of all stones together and of each alone
PHASES = 2  # of an arrival within a sample
PLACES = 41  # along a side, over which shapes are averaged
BEYOND = 4  # counts of gangue below none and above all, by which impulses of other stones are noticed
PATCHES = 3.0  # parts of a plate over which the error of a shape is independent
LOST = 1e-4  # of the largest direction: smaller ones of the basis are left out


@dataclass(frozen=True)
class Sums:
    """gangue (k,): numbers of gangue stones; basis (r, c n): orthonormal, of all that stones can make of channels that
    are divided by their noise; mean (h, k, r) and covariance (h, k, r, r) in it, without noise, for each
    of REACHES and then of the phases."""

    gangue: Floats
    basis: Floats
    mean: Floats
    covariance: Floats
    samples: int

    @classmethod
    def of(cls, plate: PlateModel, sensors: tuple[int, ...], stones: Stones, forces: StoneForces,
           noise: Floats) -> Sums:
        plate = plate.below(HIGHEST_Hz)
        width = round(SPREAD_S / DELAY_STEP_S) + 1
        a = Responses.of(plate, stones, forces, width + PHASES - 1)
        seen = plate.sensor_shape[list(sensors)] / noise[:, None]

        def observed(motion: Floats) -> Floats:  # (m, n) -> (m, c n)
            return (seen.T[:, :, None] * motion[:, None, :]).reshape(len(motion), -1)

        delayed = [observed(motion) for motion in a.delayed]
        slopes = [observed(motion) * sd[:, None] for motion, sd in
                  ((a.by_frequency, plate.frequency_sd), (a.by_damping, plate.damping_sd))]
        basis = _basis(np.vstack([*delayed, *slopes]))
        error = plate.shape_sd * plate.rms_shape
        middle = a.delayed[len(delayed) // 2]
        at_sensors = [_alone(middle, c, noise) * error[:, None] for c in range(len(noise))]
        doubt = np.array([rows @ basis.T for rows in [*slopes, *at_sensors]])
        at_places = (delayed[len(delayed) // 2] * error[:, None]) @ basis.T
        projected = np.array([rows @ basis.T for rows in delayed])
        gangue = np.arange(-BEYOND, stones.count + BEYOND + 1.0)
        number = np.column_stack([stones.count - gangue, gangue])
        found = [_moments(projected[p:p + width], _over_places(plate, stones.radius_m, reach),
                          number @ impulses(stones, forces, reach),
                          np.clip(number, 0, stones.count) @ impulses(stones, forces, reach) ** 2, doubt, at_places)
                 for reach in REACHES for p in range(PHASES)]
        mean, covariance = (np.array(values) for values in zip(*found, strict=True))
        return cls(gangue, basis, mean, covariance, middle.shape[-1])


def impulses(stones: Stones, forces: StoneForces, reach: float) -> Floats:
    """(2,): of a stone of coal and of gangue, N s, of a volley that reaches so far."""
    far = (reach - REACHES[0]) / (REACHES[-1] - REACHES[0])
    mass = 4 / 3 * np.pi * stones.radius_m**3 * forces.density_kg_m3
    return np.asarray((NEAR_SHARE + far * (FAR_SHARE - NEAR_SHARE)) * mass * stones.speed_m_s)


def _moments(delayed: Floats, places: tuple[Floats, Floats], total: Floats, squares: Floats, doubt: Floats,
             at_places: Floats) -> tuple[Floats, Floats]:
    """Mean (k, r) and covariance (k, r, r) of stones with sums `total` (k,) of their impulses and `squares` (k,) of the
    squares, whose delays are those of `delayed` (delays, m, r)."""
    shape, square = places
    weight = np.where(np.isin(np.arange(len(delayed)), (0, len(delayed) - 1)), 0.5, 1.0) / (len(delayed) - 1)
    response = np.einsum("d,dmr,m->r", weight, delayed, shape, optimize=True)
    power = np.einsum("d,dmr,mn,dns->rs", weight, delayed, square, delayed, optimize=True)
    own = (1 + OWN_SD**2) * power - np.outer(response, response)
    own += _weighted(doubt, square.diagonal() - shape**2)
    common = COMMON_SD**2 * np.outer(response, response) + at_places.T @ at_places / PATCHES
    common += _weighted(doubt, shape**2)
    return total[:, None] * response, squares[:, None, None] * own + (total**2)[:, None, None] * common


def _weighted(doubt: Floats, weight: Floats) -> Floats:
    """(r, r): covariance of rows (kind, m, r) whose variances are weights (m,)."""
    rows = (doubt * np.sqrt(np.maximum(weight, 0.0))[:, None]).reshape(-1, doubt.shape[-1])
    return np.asarray(rows.T @ rows)


def _over_places(plate: PlateModel, radius_m: float, reach: float) -> tuple[Floats, Floats]:
    """Mean (m,) and mean product (m, m) of the shapes over places, up to a share `reach` of those on the plate."""
    middles = reach * (2 * (np.arange(PLACES) + 0.5) / PLACES - 1)
    weights = [along(middles * (lines[-1] - radius_m))
               for along, lines in zip(plate._splines, (plate.lines_x_m, plate.lines_y_m), strict=True)]
    shape = np.einsum("ai,bj,ijm->abm", *weights, plate.grid_shape, optimize=True).reshape(PLACES**2, -1)
    return shape.mean(axis=0), shape.T @ shape / len(shape)


def _basis(rows: Floats) -> Floats:
    """(r, columns): orthonormal, of the space that rows span."""
    square, directions = np.linalg.eigh(rows @ rows.T)
    kept = square > LOST**2 * square[-1]
    return np.asarray((directions[:, kept] / np.sqrt(square[kept])).T @ rows)


def _alone(motion: Floats, channel: int, noise: Floats) -> Floats:
    """(m, c n): motions (m, n) of modes in one channel, as an error of their shapes at its sensor makes them."""
    out = np.zeros((len(motion), len(noise), motion.shape[-1]))
    out[:, channel] = motion / noise[channel]
    return out.reshape(len(motion), -1)
