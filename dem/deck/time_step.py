"""What a run counts in steps: the DEM time step with each limit that could set it, the co-step of the plate, and the
rows of its record."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common import hertz
from common.scene.error_laws import laws_of
from common.scene.plate import FlexiblePlate
from common.scene.scene import Scene
from common.tables import InputError
from dem.deck.contact import damping_ratio, elastic_damping_ratio, stiffest_face_N_m, stone_columns_N_m
from dem.stones.assembly import Assembly
from dem.stones.stone import Body, Stone, body_of, impact_speed_m_s, substances_of

# Of t0 = min sqrt(m r0/(E A)), if `bond_fraction` allows it. Stones that shatter at 6 m/s close their ledger to 1e-3 of
# the impact so; what is left goes with the square of the step.
BOND_FRACTION = 0.37
DAMPED_SHARE = 0.8       # of the limit of damped bonds, see `bond_fraction`
RAYLEIGH_FRACTION = 0.2  # of the Rayleigh time of the smallest sub-sphere, the usual share in DEM
CONTACT_STEPS = 400      # steps in the shortest contact with the plate: peak force and contact time to 1e-4
CO_STEPS_IN_CONTACT = 45           # of a whole stone with the plate
CO_STEPS_IN_FRAGMENT_CONTACT = 4   # of the smallest sub-sphere alone, docs/coupling.md
MESSAGE_COST = 0.15                # of one message and its answer, in DEM steps of the default scene
# The wall moves by prediction, so plate and contact must not react on each other within a co-step. With the mobility
# Phi of the plate at the stones (kg^-1) and the stiffness k and dashpot c of a contact: shares of 1/sqrt(k Phi) and
# 1/(c Phi). Measured: unstable from 0.36 of the second on, stable at 0.18.
STIFFNESS_SHARE = 0.2
DASHPOT_SHARE = 0.15
# Of 1/sqrt(k Phi) with all of a face. A cube of 64 mm that lands flat on the plate of the paper closes its ledger to
# 1.4e-4, 1e-3 and 6e-3 of the impact at 0.15, 0.3 and 0.6.
FACE_SHARE = 0.3
# While chips lie or hop on the plate one message serves several co-steps: as many as the limits above then allow, where
# the push is this share of a stone's peak force and nothing comes faster than this share of the impact; and never more
# than.
WEAK_FORCE_SHARE, WEAK_SPEED_SHARE, MOST_CO_STEPS = 1e-3, 0.1, 16
MOST_STEPS = 2**31 - 1     # that LIGGGHTS counts in one run
FAST_PER_SAMPLE = 30     # rows of the fast stream a sample: 200 kHz at 6667 Hz,
FAST_Hz = 200e3          # and of slower samples as many as give this
MOST_FAST_ROWS = 2_000_000  # a long run has fewer a sample,
LEAST_FAST_Hz = 25e3     # but so many before an anti-alias filter: of what folds back, it takes all up to 20 kHz


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


@dataclass(frozen=True)
class WeakContact:
    """At this push and speed one message serves `co_steps` co-steps; fewer above, more below, up to `most_co_steps`."""

    force_N: float
    speed_m_s: float
    co_steps: int
    most_co_steps: int


@dataclass(frozen=True)
class StepLimits:
    """The limits of the time step by name, as far as the plate's motion has no part in them, the longest co-step that
    resolves the contacts, the stones, t0 of the bonds, and the shortest contact of a whole stone."""

    limits_s: dict[str, float]
    co_step_s: float
    stones: tuple[Stone, ...]
    bond_time_s: float | None
    stone_contact_time_s: float
    face_stiffness_N_m: float = 0.0  # of the stiffest face that could press


def step_limits(scene: Scene, assembly: Assembly, file: str) -> StepLimits:
    """Find what limits the time step without the plate's motion. Raises InputError for what can be refused by that."""
    bond_time = bond_time_s(assembly)
    contact = subsphere_contact_time_s(assembly)
    stone_contact = stone_contact_time_s(assembly)
    limits = {"rayleigh": RAYLEIGH_FRACTION * rayleigh_time_s(assembly),
              "plate_contact": contact / CONTACT_STEPS}
    if bond_time is not None:
        least = min(one.bond.stiffness_ratio for one in assembly.substances)
        limits["bond"] = bond_fraction(scene.agglomerate.damping_ratio, least) * bond_time
        del limits["plate_contact"]  # the bonds carry the contact of an agglomerate
        if assembly.faces:
            limits["faces"] = face_fraction(assembly, scene.agglomerate.damping_ratio, least, bond_time) * bond_time
    co_step = min(stone_contact / CO_STEPS_IN_CONTACT, contact / CO_STEPS_IN_FRAGMENT_CONTACT)
    if scene.tolerance is not None:
        of_step, of_co_step, _ = scene.settings
        limits["tolerance"] = of_step * (stone_contact if bond_time is None else bond_time)
        co_step = min(co_step, of_co_step * stone_contact)
    _counted_steps(scene, _largest_step_s(scene, limits, file), scene.time.co_step or 1, file)
    return StepLimits(limits, co_step, assembly.stones, bond_time, stone_contact, stiffest_face_N_m(assembly))


def time_step(scene: Scene, limits: StepLimits, file: str, mobility_1_kg: float | None = None) -> TimeStep:
    """Choose the step and the co-step; `mobility_1_kg` is that of a flexible plate (plate_fem.impact).

    Raises InputError if the scene's own `time.time_step_s` or `time.co_step` is above a limit.
    """
    mutual = {} if mobility_1_kg is None else coupling_limits_s(scene, limits.stones, mobility_1_kg)
    if mobility_1_kg is not None and limits.face_stiffness_N_m > 0:
        mutual["coupling_faces"] = FACE_SHARE / np.sqrt(limits.face_stiffness_N_m * mobility_1_kg)
    limits_s = limits.limits_s | mutual
    wanted = _largest_step_s(scene, limits_s, file)
    co_step = _co_step(scene, wanted, limits.co_step_s, mutual, file)
    sample_steps, steps = _counted_steps(scene, wanted, co_step, file)
    return TimeStep(
        dt_s=scene.time.sample_interval_s / sample_steps, limits_s=limits_s, bond_time_s=limits.bond_time_s,
        co_step=co_step, fast_steps=sample_steps // fast_per_sample(scene), sample_steps=sample_steps, steps=steps)


def _largest_step_s(scene: Scene, limits_s: dict[str, float], file: str) -> float:
    """The scene's own time step, or the largest that the limits allow. Raises InputError."""
    for name, limit in limits_s.items():
        if not 0 < limit < np.inf:
            raise InputError(f"{file}: the limit {name} of the time step would be {limit:g} s: sizes, densities, "
                             "moduli and speed must be of magnitudes that double precision can hold")
    largest = min(limits_s.values())
    wanted = scene.time.time_step_s or largest
    if wanted > largest * (1 + 1e-12):
        name = min(limits_s, key=limits_s.__getitem__)
        raise InputError(f"{file}: time.time_step_s = {wanted:g}: must not be above {largest:.4g} s, the limit set by "
                         f"{name}")
    if not scene.time.duration_s / min(wanted, scene.time.sample_interval_s) <= MOST_STEPS:
        raise InputError(f"{file}: time.duration_s = {scene.time.duration_s:g}: must be at most {MOST_STEPS} steps of "
                         f"{min(wanted, scene.time.sample_interval_s):.3g} s")
    return wanted


def _counted_steps(scene: Scene, dt_s: float, co_step: int, file: str) -> tuple[int, int]:
    """DEM steps in a sample and in the run. Raises InputError."""
    if co_step > MOST_STEPS:  # and perhaps beyond what a float can hold
        raise InputError(f"{file}: time.co_step = {str(co_step)[:40]}: must be at most {MOST_STEPS}")
    sample_steps = _sample_steps(scene, dt_s, co_step)
    intervals = int(scene.time.duration_s / scene.time.sample_interval_s + 1e-9)  # 0.04 s: 266, thus 267 samples
    if intervals * sample_steps > MOST_STEPS:
        raise InputError(f"{file}: time.sample_interval_s = {scene.time.sample_interval_s:g}: leaves "
                         f"{intervals * sample_steps:.3g} steps; must leave at most {MOST_STEPS}")
    return sample_steps, intervals * sample_steps


def fast_per_sample(scene: Scene) -> int:
    """Rows of the fast stream a sample: the usual number, or as many as keep the file of a long run in bounds."""
    samples = scene.time.duration_s / scene.time.sample_interval_s
    least = math.ceil(scene.time.sample_interval_s * LEAST_FAST_Hz) if scene.time.anti_alias else 1
    usual = max(FAST_PER_SAMPLE, math.ceil(scene.time.sample_interval_s * FAST_Hz - 1e-6))
    return min(usual, max(least, int(MOST_FAST_ROWS / samples + 1e-9)))


def _sample_steps(scene: Scene, dt_s: float, co_step: int) -> int:
    """DEM steps in a sample, a whole number of co-steps in each row of the fast stream."""
    block = fast_per_sample(scene) * co_step
    return block * int(np.ceil(scene.time.sample_interval_s / dt_s / block - 1e-9))


def _co_step(scene: Scene, dt_s: float, resolved_s: float, mutual: dict[str, float], file: str) -> int:
    """DEM steps a co-step: what costs least among those no longer than `resolved_s`, which resolves the contacts, and
    the limits in `mutual`. A rigid plate gets no messages, and the forces on it are recorded every step."""
    wanted = scene.time.co_step
    if not mutual:
        return wanted or 1
    most = max(1, int(min(mutual.values()) / dt_s))
    if wanted is not None and wanted > most:
        raise InputError(f"{file}: time.co_step = {wanted}: must be at most {most} with a time step of {dt_s:.3g} s, "
                         f"the limit set by {min(mutual, key=mutual.__getitem__)}")
    longest_s = min(resolved_s, *mutual.values())

    def length_s(n: int) -> float:  # with the step that n leads to
        return n * scene.time.sample_interval_s / _sample_steps(scene, dt_s, n)

    at_most = max(1, int(2 * longest_s / dt_s))
    candidates = [n for n in range(max(1, at_most - 199), at_most + 1)  # of many the longest are as good as any
                  if length_s(n) <= longest_s] or [1]
    return wanted or min(candidates, key=lambda n: _sample_steps(scene, dt_s, n) * (1 + MESSAGE_COST / n))


def weak_contact(scene: Scene, assembly: Assembly, step: TimeStep) -> WeakContact | None:
    """When a contact is so weak that messages may be rarer. Only chips push so little for long. So a scene without
    bonds, or one that sets its co-step, has one message every co-step: None.

    The stiffness of a Hertz contact goes with the cube root of the force, and the limits of the co-step (1/sqrt(k),
    1/c) with the inverse sixth.
    """
    limits = [limit for name, limit in step.limits_s.items() if name in ("coupling_stiffness", "coupling_dashpot")]
    if not limits or not assembly.n_bonds or scene.time.co_step is not None:
        return None
    co_steps = int(min(limits) * WEAK_FORCE_SHARE ** (-1 / 6) / (step.co_step * step.dt_s))
    peak_N = min(body.peak_force_N for body in bodies_of(assembly))
    return WeakContact(WEAK_FORCE_SHARE * peak_N, WEAK_SPEED_SHARE * assembly.impact_speed_m_s,
                        min(max(1, co_steps), MOST_CO_STEPS), MOST_CO_STEPS)


def accuracy_settings(scene: Scene, assembly: Assembly, step: TimeStep) -> dict[str, float]:
    """The numerical settings of a run by their names in common/scene/error_laws.py, with the plate's frequency."""
    contact = stone_contact_time_s(assembly)
    settings = [step.dt_s / (contact if step.bond_time_s is None else step.bond_time_s)]
    if isinstance(scene.plate, FlexiblePlate) and scene.plate.max_frequency_Hz is not None:
        settings += [step.co_step * step.dt_s / contact, 1 / (scene.plate.max_frequency_Hz * contact)]
    return dict(zip(laws_of(assembly.n_bonds > 0), settings, strict=False))  # of a rigid plate the first alone


def bond_time_s(assembly: Assembly) -> float | None:
    """t0 = min over bonds of sqrt(m r0/(E A)), m the lighter end; None without bonds."""
    if assembly.n_bonds == 0:
        return None
    modulus = np.array([one.bond.youngs_modulus_Pa for one in assembly.substances])[assembly.bond_substance]
    mass = np.minimum(assembly.mass_kg[assembly.bond_first], assembly.mass_kg[assembly.bond_second])
    length = np.linalg.norm(assembly.bond_vector_m, axis=1)
    return float(np.sqrt(mass * length / (modulus * np.pi * assembly.bond_radius_m**2)).min())


def undamped_limit(stiffness_ratio: float) -> float:
    """Largest stable step over t0 of undamped bonds in a random packing, k_n/k_s = `stiffness_ratio`.

    2/(w t0) with the highest frequency w of the network; stretch and shear add to w^2 as 3.5 + 29.5 k_s/k_n. Fitted to
    `highest_frequency_rad_s` of stones of 200 to 2000 sub-spheres at ratios of 1 to 10, within 8 %.
    """
    return float(2 / np.sqrt(3.5 + 29.5 / stiffness_ratio))


def bond_fraction(damping_ratio: float, stiffness_ratio: float) -> float:
    """The step over t0. Leapfrog with the damping force at the velocity half a step back is stable while
    (w dt)^2 + 2 w^2 tau dt < 4; here tau = 2 zeta t0 and w = 2/(a t0), a the undamped limit, so
    dt/t0 < sqrt(4 zeta^2 + a^2) - 2 zeta."""
    return min(BOND_FRACTION, DAMPED_SHARE * _damped_limit(damping_ratio, undamped_limit(stiffness_ratio)))


def _damped_limit(damping_ratio: float, undamped: float) -> float:
    return float(np.hypot(2 * damping_ratio, undamped) - 2 * damping_ratio)


def face_fraction(assembly: Assembly, damping_ratio: float, stiffness_ratio: float, bond_time_s: float) -> float:
    """As `bond_fraction` where columns behind faces press: the highest w^2 grows by no more than the largest k/m of a
    column and its sub-sphere (Weyl's inequality)."""
    start = np.cumsum([0, *assembly.sizes])
    grows = max(
        (stone_columns_N_m(assembly, k) / assembly.mass_kg[start[k] + columns.sub_sphere]).max(initial=0.0)
        for k, columns in enumerate(assembly.faces) if columns is not None)
    undamped = 2 / np.hypot(2 / undamped_limit(stiffness_ratio), np.sqrt(grows) * bond_time_s)
    return DAMPED_SHARE * _damped_limit(damping_ratio, float(undamped))


def rayleigh_time_s(assembly: Assembly) -> float:
    """pi R sqrt(rho/G)/(0.1631 nu + 0.8766), the least of all sub-spheres (Thornton and Randall 1988)."""
    materials = [substance.material for substance in assembly.substances]
    nu, youngs_modulus = np.array([(m.poisson_ratio, m.youngs_modulus_Pa) for m in materials])[assembly.substance].T
    density = assembly.mass_kg / (4 / 3 * np.pi * assembly.radius_m**3)
    slowness = np.sqrt(density / (youngs_modulus / (2 * (1 + nu))))
    return float((np.pi * assembly.radius_m * slowness / (0.1631 * nu + 0.8766)).min())


def subsphere_contact_time_s(assembly: Assembly) -> float:
    """Duration of the shortest Hertz contact of a sub-sphere with the plate."""
    modulus = np.array([substance.modulus_on_plate_Pa for substance in assembly.substances])[assembly.substance]
    stiffness = hertz.stiffness_N_m32(modulus, assembly.radius_m)
    speed = assembly.impact_speed_m_s
    depth = hertz.largest_approach_m(stiffness, assembly.mass_kg, speed)
    return float(hertz.contact_time_s(depth, speed).min())


def stone_contact_time_s(assembly: Assembly) -> float:
    """Duration of the shortest Hertz contact of a whole stone with the plate."""
    return min(body.contact_time_s for body in bodies_of(assembly))


def contact_time_of_any_s(scene: Scene, stones: Sequence[Stone]) -> float:
    """As `stone_contact_time_s`, were each stone of any material of the scene: the ratios of a sweep have one plate."""
    bodies = {body_of(one, impact_speed_m_s(one, scene.gravity_vector_m_s2)) for one in _of_any(scene, stones)}
    return min(body.contact_time_s for body in bodies)


def _of_any(scene: Scene, stones: Sequence[Stone]) -> list[Stone]:
    """Each stone of each material of the scene."""
    return [stone.made_of(one) for one in substances_of(scene).values() for stone in stones]


def bodies_of(assembly: Assembly) -> set[Body]:
    """The stones as far as they differ in contact with the plate."""
    return {body_of(stone, impact_speed_m_s(stone, assembly.gravity_m_s2)) for stone in assembly.stones}


def coupling_limits_s(scene: Scene, stones: Sequence[Stone], mobility_1_kg: float) -> dict[str, float]:
    """Limits of the co-step from the mutual reaction of plate and contact, each stone taken as one Hertz sphere at its
    largest approach, which is stiffer than the agglomerate. Each could be of any material of the scene, so that the
    ratios of a sweep have one co-step."""
    limits = {"coupling_stiffness": np.inf, "coupling_dashpot": np.inf}
    for body in {body_of(one, max(one.speed_m_s, 1e-3)) for one in _of_any(scene, stones)}:
        stiffness = 1.5 * body.stiffness_N_m32 * np.sqrt(body.depth_m)
        ratio = (damping_ratio if scene.has_smooth_contact else elastic_damping_ratio)(body.restitution)
        dashpot = 2 * np.sqrt(5 / 6) * ratio * np.sqrt(4 / 3 * stiffness * body.mass_kg)
        limits["coupling_stiffness"] = min(limits["coupling_stiffness"],
                                           STIFFNESS_SHARE / np.sqrt(stiffness * mobility_1_kg))
        if dashpot > 0:
            limits["coupling_dashpot"] = min(limits["coupling_dashpot"], DASHPOT_SHARE / (dashpot * mobility_1_kg))
    return {name: limit for name, limit in limits.items() if np.isfinite(limit)}
