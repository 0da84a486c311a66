"""Rows of bonded sub-spheres against the theory of beams and rods."""

import numpy as np
import pytest
from decks import bond_line, chain, deck, frames, run_engine, write_files
from scipy.optimize import brentq

E, RATIO, SPACING, BOND_RADIUS = 5e9, 2.0, 2e-3, 1e-3
AREA, INERTIA = np.pi * BOND_RADIUS**2, np.pi * BOND_RADIUS**4 / 4
K_N = E * AREA / SPACING


@pytest.mark.slow
def test_cantilever_deflects_and_swings_like_timoshenkos_beam(tmp_path):
    """A load put on the tip at once: it swings about the static deflection with the first frequency, both within 1 %."""
    n, load = 30, 1e-4
    body = chain(n, SPACING)
    write_files(tmp_path, body)
    mass = body.mass_kg[0]
    length = (n - 1) * SPACING
    # Timoshenko: bending and shear, kappa G A = k_s l.
    deflection = load * length**3 / (3 * E * INERTIA) + load * (n - 1) * RATIO / K_N
    # The outermost sphere brings half a cell of mass more than the beam that ends at its centre.
    tip_mass = 0.5 / (n - 1)
    beta = brentq(lambda b: 1 + np.cos(b) * np.cosh(b)
                  + tip_mass * b * (np.cos(b) * np.sinh(b) - np.sin(b) * np.cosh(b)), 1.0, 1.9)
    omega = beta**2 * np.sqrt(E * INERTIA / (mass / SPACING * length**4))
    dt = 0.25 * np.sqrt(mass / K_N)
    every = 100
    steps = int(4 * 2 * np.pi / omega / dt / every) * every
    lines = f"group held id 1\ngroup tip id {n}\nfix hold held freeze\nfix load tip addforce 0 {load} 0\n"
    run_engine(tmp_path, deck(dt, steps, every, lines, bond_line(E, RATIO)))
    f = frames(tmp_path)
    y, t = f.x[:, -1, 1], f.step * dt
    falling = np.flatnonzero((y[:-1] > deflection) & (y[1:] <= deflection))
    crossing = [t[k] + (y[k] - deflection) / (y[k] - y[k + 1]) * (t[k + 1] - t[k]) for k in falling]
    periods = np.diff(crossing)
    assert 2 * np.pi / periods.mean() == pytest.approx(omega, rel=1e-2)
    whole = (t >= crossing[0]) & (t < crossing[-1])
    assert y[whole].mean() == pytest.approx(deflection, rel=1e-2)


def test_longitudinal_waves_run_at_the_speed_of_a_rod(tmp_path):
    """A smooth pulse: its centre moves at sqrt(E A/(mass per length)), within 2 %."""
    n = 400
    body = chain(n, SPACING)
    write_files(tmp_path, body)
    mass = body.mass_kg[0]
    speed = np.sqrt(E * AREA * SPACING / mass)
    x = body.center_m[:, 0]
    pulse = 1e-3 * np.exp(-((x - 0.2) / 0.02) ** 2)
    # A wave that runs to the right only: v = -c du/dx, so the positions start strained.
    body.center_m[:, 0] += np.cumsum(-pulse / speed) * SPACING
    lines = "".join(f"set atom {k + 1} vx {float(v)!r}\n" for k, v in enumerate(pulse))
    reference = chain(n, SPACING)
    write_files(tmp_path, reference)  # bonds undeformed, then the strained positions
    bonds = (tmp_path / "bonds.txt").read_text()
    write_files(tmp_path, body)
    (tmp_path / "bonds.txt").write_text(bonds)
    dt = 0.25 * np.sqrt(mass / K_N)
    steps = int(0.4 / speed / dt / 10) * 10
    run_engine(tmp_path, deck(dt, steps, steps // 10, bonds=bond_line(E, RATIO), velocity=lines))
    f = frames(tmp_path)
    v = f.v[:, :, 0]
    centre = (v**2 @ x) / (v**2).sum(axis=1)
    assert (centre[-1] - centre[0]) / ((f.step[-1] - f.step[0]) * dt) == pytest.approx(speed, rel=2e-2)
