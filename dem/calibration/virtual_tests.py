"""Virtual laboratory tests in LIGGGHTS: compression of a cylinder, also under a confining pressure, its direct tension,
and the Brazilian test, a disc that is pressed across its diameter until it splits.

Specimens are random dense packings with bonds as in a stone. The platens are frictionless: the sub-spheres at each
one keep a constant speed along the axis and are free across it (fix setforce), as in
`dem.stones.bonds.network_stiffness`. Stress follows the laboratory's formulas:

    compression  sigma = P/(pi R^2)
    Brazilian    sigma_t = (sin(2 alpha)/alpha - 1) 2 P/(pi D L)

The second is the tension at the centre of a disc loaded over arcs of 2 alpha (G. Hondros, Aust. J. Appl. Sci. 10 (1959)
243); the 2 P/(pi D L) of the ISRM's suggested method is its limit for alpha -> 0. Narrow arcs crush: with 2 alpha = 20
degrees only 13 sub-spheres of a disc of 1266 are held, these break off first, and strengths scatter by 15 % from seed
to seed; with 30 degrees the disc splits from its middle (5 %).

In direct tension the grips hold all sub-spheres within GRIP mean diameters of the ends. The confining pressure acts on
the sub-spheres at the cylinder's side, each with a share that goes with its radius squared, as a constant force towards
the axis after a ramp.

The specimen starts in the motion of homogeneous strain, so that no wave starts at the platens.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from common.files.rows import write_rows
from dem.coupling.launch import engine_error, engine_running
from dem.deck.render import template
from dem.deck.time_step import bond_fraction
from dem.stones.assembly import CONTACT_RADIUS_RATIO
from dem.stones.bonds import PLATEN_GAP, Bonds, bond_network
from dem.stones.packing import CylinderContainer, Packing, pack
from dem.stones.stone import flaw_factors

TRANSITS = 100          # of a sound wave through the specimen while it is strained by `failure_strain`
STEP_SHARE = 0.3        # the time step over min sqrt(m r0/(E A)) of the bonds, at most; less where they are damped more
AVERAGE_STEPS = 50      # over which a recorded load is averaged
CHECKS = 200            # looks at the load, at most; 20 of them up to `failure_strain`
CONFINED_CHECKS = 40    # where the load need not fall: up to twice that strain
LOADED_HALF_ANGLE_rad = np.radians(15.0)  # alpha of the Brazilian test
GRIP = 1.5              # mean diameters
DROP = 0.15             # of the load at which a disc has split
# Of the largest load: below, a test ends. Compression may rise again; a disc that has split, and a specimen that is
# pulled apart over the opening that its crack energy needs, are at their end.
ENDS = {"compression": 0.5, "Brazilian": 1 - 2 * DROP, "tension": 1 - 2 * DROP}
STARTED = 0.1           # of the largest load: below, it may tremble
CONFINING_RAMP = 0.3    # of the time to the failure that is expected


@dataclass(frozen=True)
class Rock:
    """What the bonds and the contacts of a specimen are made of, SI units."""

    density_kg_m3: float
    contact_modulus_Pa: float
    contact_poisson_ratio: float
    restitution: float
    friction: float
    bond_modulus_Pa: float
    stiffness_ratio: float
    tensile_strength_Pa: float
    shear_strength_Pa: float
    tan_friction: float
    damping_ratio: float
    volumetric_ratio: float = 0.0
    pressure_strengthening: float = 0.0
    fracture_energy_J_m2: float | None = None  # None: bonds snap
    flaw_modulus: float | None = None
    flaw_length_m: float | None = None


@dataclass(frozen=True)
class Specimen:
    """A bonded cylinder and the axis (0, 1, 2) along which it is pressed; `lower` and `upper` (n,) bool are held."""

    kind: str
    packing: Packing
    bonds: Bonds
    axis: int
    lower: np.ndarray
    upper: np.ndarray
    seed: int = 0  # of its flaws

    def strength_factors(self, rock: Rock) -> np.ndarray:
        """(bonds,), as in a stone."""
        place_m = self.packing.center_m[self.bonds.first] + self.bonds.vector_m / 2
        return flaw_factors(rock.flaw_modulus, rock.flaw_length_m, self.seed, place_m)

    @property
    def is_pulled(self) -> bool:
        """Does it stand in grips?"""
        return self.kind in ("tension", "fracture")

    @property
    def loaded_area_m2(self) -> float:
        """P over this is the stress of the test."""
        cylinder = self.packing.container
        assert isinstance(cylinder, CylinderContainer)
        if self.axis == 2:
            return np.pi * cylinder.radius_m**2
        arcs = np.sin(2 * LOADED_HALF_ANGLE_rad) / LOADED_HALF_ANGLE_rad - 1
        return np.pi * cylinder.radius_m * cylinder.length_m / arcs

    @property
    def half_size_m(self) -> float:
        """Half of the height along the axis."""
        return float(self.packing.container.half_size_m[self.axis])


@dataclass(frozen=True)
class LoadHistory:
    """`strain` (k,) of the platens' approach over the height, `stress_Pa` (k,), positive as loaded. `splits`: what
    counts is the first peak, since the halves of a disc that has split may carry more."""

    strain: np.ndarray
    stress_Pa: np.ndarray
    splits: bool = False

    @property
    def strength_Pa(self) -> float:
        """The largest stress, or that before the first fall by DROP."""
        peak = np.maximum.accumulate(self.stress_Pa)
        fallen = (self.stress_Pa < (1 - DROP) * peak) & (peak > STARTED * peak[-1])
        return float(peak[fallen.argmax()] if self.splits and fallen.any() else peak[-1])

    @property
    def has_failed(self) -> bool:
        """Has the load fallen after its peak?"""
        return bool(self.stress_Pa[-1] < 0.9 * self.stress_Pa.max())


def compression_specimen(radius_m: float, count: int, seed: int) -> Specimen:
    """Cylinder of height 4 `radius_m` (slenderness 2) pressed along its axis; `count` sub-spheres."""
    packing = pack(CylinderContainer(radius_m, 4 * radius_m), count, seed)
    z, reach = packing.center_m[:, 2], (1 + PLATEN_GAP) * packing.radius_m
    return Specimen("compression", packing, bond_network(packing), 2, lower=z - reach < -2 * radius_m,
                    upper=z + reach > 2 * radius_m, seed=seed)


def brazilian_specimen(radius_m: float, count: int, seed: int) -> Specimen:
    """Disc as thick as `radius_m`, pressed along x. Held is what touches the rim within the loaded
    arcs."""
    packing = pack(CylinderContainer(radius_m, radius_m), count, seed)
    x, y, _ = packing.center_m.T
    at_rim = np.hypot(x, y) + (1 + PLATEN_GAP) * packing.radius_m > radius_m
    near = at_rim & (np.abs(y) < radius_m * np.sin(LOADED_HALF_ANGLE_rad))
    return Specimen("Brazilian", packing, bond_network(packing), 0, near & (x < 0), near & (x > 0), seed)


def tension_specimen(compressed: Specimen) -> Specimen:
    """The cylinder of a compression test in grips."""
    z, radius = compressed.packing.center_m[:, 2], compressed.packing.radius_m
    reach = compressed.half_size_m - GRIP * 2 * radius.mean()
    return replace(compressed, kind="tension", lower=z < -reach, upper=z > reach)


def strength_test(directory: Path, specimen: Specimen, rock: Rock, failure_strain: float,
                  confining_Pa: float = 0.0) -> LoadHistory:
    """Press, or pull a specimen for tension, until the load has fallen to ENDS of its peak.

    `failure_strain` is where that is expected; it sets the speed. `confining_Pa` acts on the side of a cylinder, which
    is pressed up to twice that strain. Raises RuntimeError if the engine fails or a specimen without it still holds at
    ten times that strain.
    """
    record = run_test(directory, specimen, rock, failure_strain, CONFINED_CHECKS if confining_Pa else CHECKS,
                      ENDS[specimen.kind], confining_Pa)
    if not record.has_failed and not confining_Pa:  # a confined specimen may flow
        raise RuntimeError(f"{directory}: the specimen did not fail within 10 times the strain {failure_strain:g}")
    return record


def run_test(directory: Path, specimen: Specimen, rock: Rock, strain: float, checks: int = CHECKS, until: float = 0.5,
             confining_Pa: float = 0.0, dumped: bool = False) -> LoadHistory:
    """Press a specimen at the speed that reaches `strain` after TRANSITS transits of a sound wave, for `checks`
    twentieths of that time, or until the load is below the share `until` of its peak. `dumped`: the positions of its
    sub-spheres are written. Raises RuntimeError if the engine fails."""
    directory.mkdir(parents=True, exist_ok=True)
    mass = _mass_kg(specimen, rock)
    bond_time = _bond_time_s(specimen, rock, mass)
    height = 2 * specimen.half_size_m
    time = TRANSITS * height * np.sqrt(rock.density_kg_m3 / rock.bond_modulus_Pa)
    step = min(STEP_SHARE, bond_fraction(rock.damping_ratio, rock.stiffness_ratio)) * bond_time
    check_steps = AVERAGE_STEPS * int(np.ceil(time / (20 * AVERAGE_STEPS * step)))
    dt = time / (20 * check_steps)
    speed = (-0.5 if specimen.is_pulled else 0.5) * strain * height / time  # of each platen
    _write(directory, specimen, mass, specimen.strength_factors(rock))
    axis = specimen.axis
    (directory / "deck.liggghts").write_text(template("virtual_test.liggghts.j2").render(
        **vars(rock), volumetric_modulus_Pa=rock.volumetric_ratio * rock.bond_modulus_Pa,
        confining=_confining(specimen, confining_Pa, check_steps), pulled=specimen.is_pulled, until=until,
        kind=specimen.kind, name=directory.name, dt_s=repr(float(dt)),
        skin_m=0.9 * 2 * (1 / CONTACT_RADIUS_RATIO - 1) * CONTACT_RADIUS_RATIO * specimen.packing.radius_m.min(),
        youngs_modulus_Pa=rock.contact_modulus_Pa, poisson_ratio=rock.contact_poisson_ratio,
        damping_time_s=2 * rock.damping_ratio * bond_time,
        axis="xyz"[axis], column=axis + 1, held=" ".join("0.0" if k == axis else "NULL" for k in range(3)),
        speed_m_s=speed, half_size_m=specimen.half_size_m, average_steps=AVERAGE_STEPS, check_steps=check_steps,
        checks=checks, dump_steps=check_steps if dumped else None))
    _engine(directory)
    step, load = np.loadtxt(directory / "load.txt", ndmin=2).T
    middle = step - 0.5 * (AVERAGE_STEPS - 1)  # of the steps that were averaged
    if not np.all(np.isfinite(load)):
        raise RuntimeError(f"{directory}: a load is no number")
    return LoadHistory(middle * dt * 2 * abs(speed) / height, load / specimen.loaded_area_m2,
                       splits=specimen.kind == "Brazilian")


def _confining(specimen: Specimen, confining_Pa: float, check_steps: int) -> dict[str, float] | None:
    """Of the pressure on the side: the radius beyond which it finds centres, force over their radius squared, steps."""
    if not confining_Pa:
        return None
    radius, cylinder = specimen.packing.radius_m, specimen.packing.container
    assert isinstance(cylinder, CylinderContainer)
    inner = cylinder.radius_m - (1 + PLATEN_GAP) * radius.max()
    side = np.hypot(*specimen.packing.center_m[:, :2].T) > inner
    force = confining_Pa * 2 * np.pi * cylinder.radius_m * cylinder.length_m
    return {"inner_radius_m": float(inner), "steps": round(CONFINING_RAMP * 20 * check_steps),
            "force_N_m2": float(force / ((CONTACT_RADIUS_RATIO * radius[side]) ** 2).sum())}


def _engine(directory: Path) -> None:
    for name in ("events.csv", "load.txt"):
        (directory / name).unlink(missing_ok=True)
    with engine_running(directory) as engine:
        code = engine.wait()
    if code != 0 or "end of test" not in (directory / "engine.out").read_text(errors="replace"):
        raise RuntimeError(f"{directory}: LIGGGHTS stopped: {engine_error(directory)}")


def _mass_kg(specimen: Specimen, rock: Rock) -> np.ndarray:
    """Of each sub-sphere, so that the specimen has the rock's density."""
    volume = specimen.packing.radius_m**3
    return rock.density_kg_m3 * specimen.packing.container.volume_m3 * volume / volume.sum()


def _bond_time_s(specimen: Specimen, rock: Rock, mass_kg: np.ndarray) -> float:
    bonds = specimen.bonds
    mass = np.minimum(mass_kg[bonds.first], mass_kg[bonds.second])
    return float(np.sqrt(mass * bonds.length_m / (rock.bond_modulus_Pa * bonds.area_m2)).min())


def _write(directory: Path, specimen: Specimen, mass_kg: np.ndarray, strength_factor: np.ndarray) -> None:
    """atoms.data, bonds.txt and agglomerates.txt."""
    packing, bonds = specimen.packing, specimen.bonds
    radius = CONTACT_RADIUS_RATIO * packing.radius_m
    n = len(radius)
    box = "".join(f"{-1.5 * h} {1.5 * h} {c}lo {c}hi\n" for h, c in zip(packing.container.half_size_m, "xyz"))
    columns = np.column_stack([np.arange(1, n + 1), 1 + specimen.lower + 2 * specimen.upper, 2 * radius,
                               mass_kg / (4 / 3 * np.pi * radius**3), packing.center_m])
    with open(directory / "atoms.data", "wb") as out:
        write_rows(out, columns, f"{specimen.kind}\n\n{n} atoms\n3 atom types\n\n{box}\nAtoms\n\n")
    columns = np.column_stack([bonds.first + 1, bonds.second + 1, np.ones(len(bonds)), bonds.vector_m, bonds.radius_m,
                               strength_factor])
    with open(directory / "bonds.txt", "wb") as out:
        write_rows(out, columns)
    (directory / "agglomerates.txt").write_text(f"{n}\n")
