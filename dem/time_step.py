"""The DEM time step with each limit that could set it, and the co-step of the plate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dem.assembly import Assembly
from dem.scene import Scene
from plate_fem.tables import InputError

BOND_FRACTION = 0.3      # of t0 = min sqrt(m r0/(E A)); undamped bonds are stable to 0.466 t0 (docs/bonds.md)
RAYLEIGH_FRACTION = 0.2  # of the Rayleigh time of the smallest sub-sphere, the usual share in DEM
CONTACT_STEPS = 400      # steps in the shortest contact with the plate: peak force and contact time to 1e-4
CO_STEPS_IN_CONTACT = 45
FAST_PER_SAMPLE = 30     # rows of the fast stream a sample: 200 kHz at 6667 Hz


@dataclass(frozen=True)
class TimeStep:
    """`dt_s`, the limits that were met by name, and the whole numbers of steps that fit together:
    sample = samples_fast x fast, fast = whole number of co-steps of `co_step` DEM steps."""

    dt_s: float
    limits_s: dict[str, float]
    bond_time_s: float | None  # t0
    co_step: int
    fast_steps: int
    sample_steps: int
    steps: int


def time_step(scene: Scene, assembly: Assembly, file: str) -> TimeStep:
    """Choose the step. Raises InputError if the scene's own `time.time_step_s` is above a limit."""
    bond_time = bond_time_s(scene, assembly)
    contact = contact_time_s(scene, assembly)
    limits = {"rayleigh": RAYLEIGH_FRACTION * rayleigh_time_s(scene, assembly),
              "plate_contact": contact / CONTACT_STEPS}
    if bond_time is not None:
        limits["bond"] = BOND_FRACTION * bond_time
        del limits["plate_contact"]  # the bonds carry the contact of an agglomerate
    largest = min(limits.values())
    wanted = scene.time.time_step_s or largest
    if wanted > largest * (1 + 1e-12):
        name = min(limits, key=limits.get)
        raise InputError(f"{file}: time.time_step_s = {wanted:g}: must not be above {largest:.4g} s, the limit set by "
                         f"{name}")
    co_step = scene.time.co_step or (
        1 if scene.plate.model == "rigid" else max(1, int(contact / CO_STEPS_IN_CONTACT / wanted)))
    block = FAST_PER_SAMPLE * co_step
    sample_steps = block * int(np.ceil(scene.time.sample_interval_s / wanted / block - 1e-9))
    intervals = int(scene.time.duration_s / scene.time.sample_interval_s + 1e-9)  # 0.04 s: 266, thus 267 samples
    return TimeStep(
        dt_s=scene.time.sample_interval_s / sample_steps, limits_s=limits, bond_time_s=bond_time, co_step=co_step,
        fast_steps=sample_steps // FAST_PER_SAMPLE, sample_steps=sample_steps, steps=intervals * sample_steps)


def bond_time_s(scene: Scene, assembly: Assembly) -> float | None:
    """t0 = min over bonds of sqrt(m r0/(E A)), m the lighter end; None without bonds."""
    if assembly.n_bonds == 0:
        return None
    modulus = np.array([scene.materials[name].bond.youngs_modulus_Pa for name in assembly.materials])
    modulus = modulus[assembly.bond_material]
    mass = np.minimum(assembly.mass_kg[assembly.bond_first], assembly.mass_kg[assembly.bond_second])
    length = np.linalg.norm(assembly.bond_vector_m, axis=1)
    return float(np.sqrt(mass * length / (modulus * np.pi * assembly.bond_radius_m**2)).min())


def rayleigh_time_s(scene: Scene, assembly: Assembly) -> float:
    """pi R sqrt(rho/G)/(0.1631 nu + 0.8766), the least of all sub-spheres (Thornton and Randall 1988)."""
    times = []
    for k, name in enumerate(assembly.materials):
        here = assembly.material == k
        m = scene.materials[name]
        shear_modulus = m.youngs_modulus_Pa / (2 * (1 + m.poisson_ratio))
        density = assembly.mass_kg[here] / (4 / 3 * np.pi * assembly.radius_m[here] ** 3)
        times.append((np.pi * assembly.radius_m[here] * np.sqrt(density / shear_modulus)
                      / (0.1631 * m.poisson_ratio + 0.8766)).min())
    return float(min(times))


def contact_time_s(scene: Scene, assembly: Assembly) -> float:
    """Duration of the shortest Hertz contact of a sub-sphere with the plate, 2.9432 delta/v with
    delta = (5 m v^2/(4 K))^(2/5) (paper, Eqs. 2, 3, 8). Stones that start at rest are taken to arrive by gravity."""
    speed = max(scene.stones.speed_m_s, np.sqrt(2 * scene.time.gravity_m_s2 * scene.stones.gap_m), 1e-3)
    plate = (1 - scene.plate.poisson_ratio**2) / scene.plate.youngs_modulus_Pa
    times = []
    for k, name in enumerate(assembly.materials):
        here = assembly.material == k
        m = scene.materials[name]
        modulus = 1 / ((1 - m.poisson_ratio**2) / m.youngs_modulus_Pa + plate)
        stiffness = 4 / 3 * np.sqrt(assembly.radius_m[here]) * modulus
        depth = (5 * assembly.mass_kg[here] * speed**2 / (4 * stiffness)) ** 0.4
        times.append((2.9432 * depth / speed).min())
    return float(min(times))
