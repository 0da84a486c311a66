"""Ribs below a plate, against the beam that both make."""

import numpy as np
import pytest
from plates import STEEL

from common.scene.plate import FlexiblePlate
from common.tables import InputError, check
from plate_fem.modes import plate_modes

LENGTH_m, WIDTH_m, THICKNESS_m, RIB_m = 1.0, 0.08, 0.006, (0.008, 0.02)
ALONG = (0.0, *RIB_m)
ROD = {"diameter_m": 0.01, "length_m": 0.1, "density_kg_m3": 0.1, "youngs_modulus_Pa": 1e4}  # holds nearly nothing


def strip(ribs, **changes):
    """A narrow plate on rods that hold nearly nothing."""
    rods = [{"place_m": [x, y], **ROD} for x in (-0.45, 0.45) for y in (-0.03, 0.03)]
    table = {"size_m": [LENGTH_m, WIDTH_m], "thickness_m": THICKNESS_m, "rods": rods, "ribs_m": ribs,
             "max_frequency_Hz": 400.0, "damping_ratio": 0.0, **STEEL} | changes
    return check(FlexiblePlate, table, "scene.toml", "plate")


def beam_Hz(sections):
    """The first of a free beam (Euler) of rectangles (width, height, height of its middle)."""
    width, height, z = np.array(sections).T
    area = width * height
    axis = (area @ z) / area.sum()
    second_moment = np.sum(area * (height**2 / 12 + (z - axis) ** 2))
    stiffness, mass = STEEL["youngs_modulus_Pa"] * second_moment, STEEL["density_kg_m3"] * area.sum()
    return (4.73004 / LENGTH_m) ** 2 * np.sqrt(stiffness / mass) / (2 * np.pi)


def bending_Hz(modes):
    """Of modes that are even along and across the strip and bend it along its length."""
    x = np.linspace(-LENGTH_m / 2, LENGTH_m / 2, 41)
    ends = [modes.shape_at(np.column_stack([x, np.full(41, y)])) for y in (-0.039, 0.039)]
    kept = [k for k in range(len(modes.frequency_Hz)) if modes.frequency_Hz[k] > 20
            and np.mean(ends[0][:, k] ** 2) * modes.mass_kg > 0.3  # a mode of the plate, not of a rod
            and np.allclose(ends[0][:, k], ends[1][:, k], atol=0.1 * abs(ends[0][:, k]).max())
            and ends[0][0, k] * ends[0][20, k] < 0 < ends[0][0, k] * ends[0][-1, k]]
    return modes.frequency_Hz[kept]


@pytest.mark.slow
@pytest.mark.parametrize("theory", ["kirchhoff", "mindlin"])
def test_plate_and_rib_bend_about_their_common_axis(theory):
    plate = strip({"x": [ALONG]}, theory=theory)
    found = bending_Hz(plate_modes(plate))[0]
    middle = -(THICKNESS_m + RIB_m[1]) / 2
    sections = [(WIDTH_m, THICKNESS_m, 0.0), (*RIB_m, middle)]
    assert found == pytest.approx(beam_Hz(sections), rel=0.01)
    assert found > 1.5 * beam_Hz(sections[:1])  # of the plate alone


@pytest.mark.slow
def test_mass_and_centre_hold_the_ribs():
    modes = plate_modes(strip({"x": [(0.02, *RIB_m)], "y": [[-0.2, 0.01, 0.01]]}))
    volume = LENGTH_m * WIDTH_m * THICKNESS_m + LENGTH_m * np.prod(RIB_m) + WIDTH_m * 1e-4
    assert modes.mass_kg == pytest.approx(STEEL["density_kg_m3"] * volume, rel=1e-9)
    # Momentum is that of the whole mass: the unit fields of lift and tilt are nearly modes of a plate so loosely held.
    rigid = np.argsort(modes.frequency_Hz)[:6]
    heave = modes.mean_shape[rigid] @ modes.mean_shape[rigid] * modes.mass_kg
    assert heave == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
def test_ribs_that_are_no_mirror_images_give_the_same_as_ribs_that_are():
    """The four blocks of even and odd unknowns, beside one block."""
    twins, moved = (((0.016, *RIB_m), (y, *RIB_m)) for y in (-0.016, -0.016 * (1 + 1e-6)))
    one, other = (plate_modes(strip({"x": ribs})).frequency_Hz[:12] for ribs in (twins, moved))
    assert one[6:] == pytest.approx(other[6:], rel=1e-4)


@pytest.mark.parametrize(("ribs", "changes", "said"), [
    ({"x": [ALONG]}, {"rods": []}, "plate.ribs_m = '1 ribs': needs a plate with free edges on rods"),
    ({"x": [(0.05, *RIB_m)]}, {}, "plate.ribs_m.x.0 = (0.05, 0.008, 0.02): its place must be from -0.036 to 0.036"),
    ({"x": [(0.03, *RIB_m)]}, {}, "plate.ribs_m.x.0 = (0.03, 0.008, 0.02): must leave room for rods.1"),
    ({"x": [(0.0, 0.02, 0.008)]}, {}, "plate.ribs_m.x.0 = (0.0, 0.02, 0.008): must be at least as high"),
    ({"x": [ALONG], "y": [(x, *RIB_m) for x in (0.1, 0.105)]}, {},
     "plate.ribs_m.y.1 = (0.105, 0.008, 0.02): must not overlap"),
    ({"x": [(0.0, "0.008", 0.02)]}, {}, "plate.ribs_m.x.0.1 = '0.008': must be a valid number"),
    ({"x": [[0.0, 0.008]]}, {}, "plate.ribs_m.x.0.2 is missing"),
    ({"z": [ALONG]}, {}, "plate.ribs_m.z = [(0.0, 0.008, 0.02)]: must be 'x' or 'y'"),
    ({}, {"ribs_by": []}, "plate.ribs_by = []: unknown key; allowed here"),
])  # fmt: skip
def test_ribs_that_cannot_be_are_refused(ribs, changes, said):
    with pytest.raises(InputError) as error:
        strip(ribs, **changes)
    assert said in str(error.value)
