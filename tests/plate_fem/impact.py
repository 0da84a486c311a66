"""Elastic sphere on a plate of modes, integrated together by DOP853: a reference without co-steps."""

import numpy as np
from scipy.integrate import solve_ivp


def impact(modes, places_m, mass_kg, stiffness, speed_m_s, duration_s):
    """Spheres with Hertz contact F = stiffness d^1.5 fall on undamped modes at places (k, 2) together.

    Returns (peak of the total force N, rebound speeds (k,) m/s, contact time s, plate energy J at the end).
    """
    shape = modes.shape_at(places_m)
    omega_squared = (2 * np.pi * modes.frequency_Hz) ** 2
    n, k = len(omega_squared), len(shape)

    def force(y):
        return stiffness * np.clip(shape @ y[:n] - y[2 * n : 2 * n + k], 0, None) ** 1.5

    def slope(t, y):
        f = force(y)
        return np.concatenate([y[n : 2 * n], -f @ shape - omega_squared * y[:n], y[2 * n + k :], f / mass_kg])

    start = np.concatenate([np.zeros(2 * n + k), np.full(k, -speed_m_s)])
    solution = solve_ivp(slope, (0, duration_s), start, method="DOP853", rtol=1e-9, atol=1e-13, max_step=2e-6)
    forces = np.array([force(y) for y in solution.y.T]).sum(axis=1)
    end = solution.y[:, -1]
    energy = 0.5 * np.sum(end[n : 2 * n] ** 2 + omega_squared * end[:n] ** 2)
    return forces.max(), end[2 * n + k :], solution.t[forces > 0].max(), energy
