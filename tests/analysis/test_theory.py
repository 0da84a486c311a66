import itertools
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import beta

from analysis import RecordError, read_run
from analysis.theory import contact_states as theory
from analysis.theory.contact_states import COAL, GANGUE, PLATE, STATES, peak_force_N
from analysis.theory.impact import DAMPING, Spring, force_history
from common import hertz
from tests.analysis import synthetic

L_M, B_M, H_M, R_M, V_M_S = 0.4, 0.4, 0.02, 0.025, 3.0
ORDER = [2, 10, 5, 7, 3, 9, 4, 8, 1, 6]
ROCKS = {"coal": COAL, "gangue": GANGUE}


# Independently checked numbers of Hertz impact on a rigid wall at 3 m/s (Table 1 of the paper).
@pytest.mark.parametrize(
    ("rock", "mass_kg", "stiffness", "deformation_um", "force_N", "time_us"),
    [(COAL, 0.09032, 1.1575e9, 238.4, 4261.6, 233.9), (GANGUE, 0.15708, 2.1763e9, 231.1, 7646.3, 226.7)],
)
def test_hertz_table(rock, mass_kg, stiffness, deformation_um, force_N, time_us):
    m, k = theory.sphere_mass_kg(rock, R_M), theory.contact_stiffness(rock, R_M)
    assert m == pytest.approx(mass_kg, rel=1e-4)
    assert k == pytest.approx(stiffness, rel=1e-4)
    assert 1e6 * theory.max_deformation_m(k, m, V_M_S) == pytest.approx(deformation_um, rel=3e-4)
    assert peak_force_N(STATES["PH"], rock) == pytest.approx(force_N, rel=2e-5)
    history = force_history("hertz", k, m, V_M_S)
    assert history.peak_force_N == pytest.approx(force_N, rel=2e-5)
    assert 1e6 * history.duration_s == pytest.approx(time_us, rel=3e-4)
    assert history.rebound_m_s == pytest.approx(V_M_S, rel=1e-8)


def test_flores_of_one():
    assert peak_force_N(STATES["PF"], COAL, restitution=0.5) == pytest.approx(2812, abs=0.5)
    assert peak_force_N(STATES["PF"], GANGUE, restitution=0.5) == pytest.approx(5045, abs=0.5)


@pytest.mark.parametrize("x_m", [0.05, 0.2, 0.33])
def test_beam_compliance_is_the_integral_of_the_moment_squared(x_m):
    """Castigliano: w/P = integral of M^2/(E I) for a unit load on a simply supported beam."""
    stiffness = PLATE.youngs_modulus_Pa * B_M * H_M**3 / 12

    def moment(s):
        return s * (L_M - x_m) / L_M if s < x_m else x_m * (L_M - s) / L_M

    integral = quad(lambda s: moment(s) ** 2 / stiffness, 0, L_M, points=[x_m], epsabs=0, epsrel=1e-12)[0]
    assert theory.beam_compliance(x_m, L_M, B_M, H_M) == pytest.approx(integral, rel=1e-10)


@dataclass(frozen=True)
class Recursion:
    """deformation_m after `steps` steps; residual: relative error of energy (29)."""

    deformation_m: float
    steps: int
    residual: float


def recursive_deformation(
    stiffness: float,
    mass_kg: float,
    speed_m_s: float,
    *,
    restitution: float = 1.0,
    compliance_m_N: float,
    tolerance: float = 1e-6,
    max_steps: int = 100,
) -> Recursion:
    """The paper's recursion (28) to its precision gamma (29), started at the rigid plate's value.

    d_N = {m v^2 / (2 [2K/(5e) + C K^2 sqrt(d_(N-1)) / 2])}^(2/5): a contraction, since the
    logarithmic slope is at most 1/5 in magnitude. Raises ArithmeticError if `max_steps`
    do not reach `tolerance`.
    """
    energy = 0.5 * mass_kg * speed_m_s**2

    def energy_taken(d):
        return 0.4 * stiffness / restitution * d**2.5 + 0.5 * compliance_m_N * stiffness**2 * d**3

    d = (2.5 * restitution * energy / stiffness) ** 0.4
    for step in range(max_steps + 1):
        residual = abs(energy_taken(d) / energy - 1.0)
        if residual <= tolerance:
            return Recursion(float(d), step, float(residual))
        d = (
            energy / (0.4 * stiffness / restitution + 0.5 * compliance_m_N * stiffness**2 * np.sqrt(d))
        ) ** 0.4
    raise ArithmeticError(
        f"recursion (28): residual {residual:.3g} after {max_steps} steps, above {tolerance:g}"
    )


@pytest.mark.parametrize("restitution", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("compliance_m_N", [1e-10, 2e-8, 1e-6])
def test_recursion_reaches_the_exact_root(restitution, compliance_m_N):
    m, k = theory.sphere_mass_kg(GANGUE, R_M), theory.contact_stiffness(GANGUE, R_M)
    how = {"restitution": restitution, "compliance_m_N": compliance_m_N}
    root = theory.max_deformation_m(k, m, V_M_S, **how)
    taken = 0.4 * k / restitution * root**2.5 + 0.5 * compliance_m_N * (k * root**1.5) ** 2
    assert taken == pytest.approx(0.5 * m * V_M_S**2, rel=1e-12)
    found = recursive_deformation(k, m, V_M_S, **how, tolerance=1e-12)
    assert found.deformation_m == pytest.approx(root, rel=1e-11)
    assert found.residual <= 1e-12


def test_recursion_contracts_by_a_fifth_at_most():
    m, k, c = theory.sphere_mass_kg(GANGUE, R_M), theory.contact_stiffness(GANGUE, R_M), 1e-6
    root = theory.max_deformation_m(k, m, V_M_S, compliance_m_N=c)
    tolerances = np.logspace(-1, -10, 10)
    found = [recursive_deformation(k, m, V_M_S, compliance_m_N=c, tolerance=t) for t in tolerances]
    for a, b in itertools.pairwise(found):
        shrunk = np.log(abs(b.deformation_m / root)) / np.log(abs(a.deformation_m / root))
        assert abs(shrunk) <= 0.2 ** (b.steps - a.steps) * 1.01
    with pytest.raises(ArithmeticError, match="recursion"):
        recursive_deformation(k, m, V_M_S, compliance_m_N=c, tolerance=1e-12, max_steps=2)


def test_figure_9_order_of_the_states_and_the_position():
    x = np.linspace(0.02, 0.38, 19)
    for rock in ROCKS.values():
        force = {
            key: np.array([
                peak_force_N(state, rock, compliance_m_N=c) for c in theory.beam_compliance(x, L_M, B_M, H_M)
            ])
            for key, state in STATES.items()
        }  # fmt: skip
        assert np.ptp(force["PH"]) == np.ptp(force["PF"]) == 0
        for key in ("HN", "FN"):
            assert np.argmin(force[key]) == 9  # the middle of the length
            assert np.all(np.diff(force[key][:10]) < 0) and np.all(np.diff(force[key][9:]) > 0)
        assert np.all(force["PF"] < force["PH"]) and np.all(force["FN"] < force["HN"])
        assert np.all(force["HN"] < force["PH"]) and np.all(force["FN"] < force["PF"])


def test_figure_10_rigid_totals_are_straight_and_all_rise():
    x_m = 0.1 * np.cos(np.arange(10) * np.pi / 5)
    compliance = theory.beam_compliance(x_m + L_M / 2, L_M, B_M, H_M)

    def rocks(gangue_count):
        return [ROCKS[name] for name in theory.materials_in_order(gangue_count, ORDER)]

    for key, state in STATES.items():
        totals = np.array([sum(peak_force_N(state, rock, compliance_m_N=c) for rock, c in
                                zip(rocks(t), compliance, strict=True)) for t in range(11)])
        steps = np.diff(totals)
        assert np.all(steps > 0)
        if state.deflects:
            assert np.ptp(steps) > 0.01 * steps.mean(), key
        else:
            np.testing.assert_allclose(steps, steps[0], rtol=1e-10)


@pytest.mark.parametrize("law", DAMPING)
@pytest.mark.parametrize("e", [0.3, 0.6, 0.95])
def test_rebound_of_each_law_by_its_first_integral(law, e):
    """v dv / (1 + c v) is exact: c - ln(1 + c) = -c r - ln(1 - c r) for the restitution r reached."""
    c = DAMPING[law](e)
    found = force_history(law, 1e9, 0.1, 3.0, e)
    r = found.rebound_m_s / 3.0
    if c == 0:
        assert r == pytest.approx(1.0, rel=1e-8)
    else:
        assert c - np.log1p(c) == pytest.approx(-c * r - np.log1p(-c * r), rel=1e-6)
    momentum = np.trapezoid(found.force_N, found.t_s)
    assert momentum == pytest.approx(0.1 * 3.0 * (1 + r), rel=1e-5)


@pytest.mark.parametrize(("e", "factor"), [(0.5, 1.42), (0.3, 2.18)])
def test_damped_peak_is_above_the_force_at_maximum_compression(e, factor):
    found = force_history("flores", 1e9, 0.1, 3.0, e)
    assert found.peak_force_N / (1e9 * found.deformation_m.max() ** 1.5) == pytest.approx(factor, abs=0.005)


def test_light_plate_gives_the_static_deflection_state_and_a_heavy_one_the_rigid():
    m, k, c = theory.sphere_mass_kg(COAL, R_M), theory.contact_stiffness(COAL, R_M), 1.9e-8
    static = peak_force_N(STATES["HN"], COAL, compliance_m_N=c)
    light = force_history("hertz", k, m, V_M_S, plate=Spring(c, 2e-4))
    assert light.peak_force_N == pytest.approx(static, rel=3e-3)
    assert light.rebound_m_s == pytest.approx(V_M_S, rel=1e-4)
    heavy = force_history("hertz", k, m, V_M_S, plate=Spring(c, 1e6))
    assert heavy.peak_force_N == pytest.approx(peak_force_N(STATES["PH"], COAL), rel=1e-5)


def test_unknown_law():
    with pytest.raises(ValueError, match="hunt_crossley"):
        force_history("guess", 1e9, 0.1, 3.0)


@pytest.mark.parametrize("law", ["flores", "hunt_crossley", "lankarani_nikravesh"])
def test_every_law_has_the_wanted_restitution_where_it_is_near_one(law):
    """All of them are made for that: the loss is 1 - e to first order."""
    found = force_history(law, 1e9, 0.1, 3.0, 0.99)
    assert found.rebound_m_s == pytest.approx(0.99 * 3.0, abs=0.1 * 0.01 * 3.0)


def test_hertz_contact_time_by_its_integral():
    """2 d_max/v times the integral of 1/sqrt(1 - x^(5/2)) from 0 to 1, which is (2/5) B(2/5, 1/2)."""
    assert hertz.CONTACT_TIME_FACTOR == pytest.approx(2 * 0.4 * beta(0.4, 0.5), rel=5e-5)


def test_stones_laid_down_have_no_theory_of_impact(tmp_path, monkeypatch):
    monkeypatch.setitem(synthetic.SCENE["stones"], "speed_m_s", 0.0)
    with pytest.raises(RecordError, match=r"scene\.stones\.speed_m_s = 0; needs an impact"):
        theory.setup_of(read_run(synthetic.write_run(tmp_path / "laid", 0.5)))


def test_on_a_tilted_plate_the_speed_across_it_counts(tmp_path, monkeypatch):
    monkeypatch.setitem(synthetic.SCENE["plate"], "tilt_deg", 60.0)
    setup = theory.setup_of(read_run(synthetic.write_run(tmp_path / "tilted", 0.5)))
    assert setup.speed_m_s == pytest.approx(synthetic.SCENE["stones"]["speed_m_s"] / 2)


def test_there_is_no_beam_beyond_its_supports():
    assert theory.beam_compliance([0.0, L_M], L_M, B_M, H_M).tolist() == [0.0, 0.0]
    with pytest.raises(RecordError, match="the beam between the rods"):
        theory.beam_compliance([0.1, 1.2 * L_M], L_M, B_M, H_M)


@pytest.mark.parametrize("wrong", [{"speed_m_s": 0.0}, {"restitution": 0.0}, {"restitution": 2.0},
                                   {"compliance_m_N": -1e-8}, {"radius_m": -0.02}])
def test_what_is_no_impact_is_refused(wrong):
    with pytest.raises(RecordError, match="must be finite and above 0"), np.errstate(invalid="ignore"):
        peak_force_N(STATES["FN"], COAL, **wrong)


@pytest.mark.parametrize("wrong", [{"speed_m_s": np.nan}, {"restitution": 0.0}, {"restitution": 1.5}, {"mass_kg": -0.1},
                                   {"plate": Spring(0.0, 1.0)}, {"plate": Spring(1e-7, -1.0)}])
def test_a_force_history_is_of_an_impact(wrong):
    with pytest.raises(RecordError, match="above 0"):
        force_history("flores", **{"stiffness": 1e9, "mass_kg": 0.1, "speed_m_s": 3.0, "restitution": 0.5} | wrong)
