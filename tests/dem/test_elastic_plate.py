"""Engine and plate together against one independent integration of sphere and modes."""

import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import SCENES, changed, hertz
from scipy.integrate import cumulative_trapezoid, solve_ivp

from analysis import read_run
from common.files.cache import user_cache
from common.scene.scene import read_scene
from dem.run.run import run_scene
from plate_fem.modes import plate_modes

SCENE = SCENES / "elastic_plate.toml"
PLACE = [[0.1, 0.03]]  # of the sphere, which gets residual modes


def reference(scene, times, modes):
    """Mean force over each interval of `times` and plate states there, by DOP853 with rtol 1e-11.

    State: sphere z and v, modal a and da/dt, impulse, work of the damping. The force is Hertz's on z - w(x, y).
    """
    phi = modes.shape_at(np.array(PLACE))[0]
    omega = 2 * np.pi * modes.frequency_Hz
    law = hertz("gangue")
    n = len(omega)

    def rates(t, y):
        z, v, a, da = y[0], y[1], y[2:2 + n], y[2 + n:2 + 2 * n]
        depth = max(0.0, scene.stones.radius_m - z + phi @ a)
        force = law["stiffness"] * depth**1.5
        dda = -phi * force - 2 * modes.damping_ratio * omega * da - omega**2 * a
        return np.concatenate([[v, force / law["mass_kg"]], da, dda, [force]])

    start = np.zeros(2 * n + 3)
    start[0], start[1] = scene.stones.radius_m + scene.stones.gap_m, -scene.stones.speed_m_s
    solution = solve_ivp(rates, (0, times[-1]), start, method="DOP853", rtol=1e-11, atol=1e-15, t_eval=times,
                         max_step=2e-6)
    a, da = solution.y[2:2 + n], solution.y[2 + n:2 + 2 * n]
    force = np.diff(solution.y[-1], prepend=0) / np.diff(times, prepend=-np.inf)
    energy = 0.5 * ((omega[:, None] * a) ** 2 + da**2).sum(axis=0)
    return {"force_N": force, "u_m": modes.mean_shape @ a, "v_m_s": modes.mean_shape @ da, "total_J": energy}


@pytest.fixture(scope="module")
def default_run(runs):
    directory = runs / "elastic"
    summary = run_scene(read_scene(SCENE), str(SCENE), directory)
    return summary, pd.read_parquet(directory / "fast.parquet")


def test_force_and_plate_motion_agree_with_the_reference(default_run, runs):
    """0.1 % in the L2 norm at the default co-step."""
    _, fast = default_run
    scene = read_scene(SCENE)
    expected = reference(scene, fast["t_s"].to_numpy(), plate_modes(scene.plate, user_cache(), PLACE))
    for name, values in expected.items():
        error = np.linalg.norm(fast[name] - values) / np.linalg.norm(values)
        assert error < 1e-3, f"{name}: {error:.2e}"


def test_energy_closes_and_impulse_is_momentum(default_run):
    summary, _ = default_run
    assert abs(summary["energy"]["closure"]) < 1e-3
    assert summary["impulse_N_s"] == pytest.approx(summary["momentum_change_kg_m_s"], rel=1e-9)
    assert summary["energy"]["given_to_plate_J"] > 0.01 * summary["energy"]["impact_J"]


@pytest.mark.slow
def test_a_sensor_of_each_kind_measures_its_own_motion(runs):
    """Velocity and displacement are the integrals of what an accelerometer at the same place measures."""
    sensors = [{"name": kind, "place_m": [0.0, 0.17], "kind": kind} for kind in ("displacement", "acceleration", "velocity")]
    run_scene(changed("elastic_plate", {"plate.sensors": sensors}), "elastic_plate", runs / "kinds")
    found = read_run(runs / "kinds")
    assert [sensor.get("kind") for sensor in found.info["scene"]["plate"]["sensors"]] == ["displacement", None, "velocity"]
    assert {found.record(name).unit for name in ("vel_velocity_m_s", "disp_displacement_m")} == {"m/s", "m"}
    t_s, *motion = (found.fast[name].to_numpy() for name in (
        "t_s", "acc_acceleration_m_s2", "vel_velocity_m_s", "disp_displacement_m"))
    for rate, of in zip(motion, motion[1:]):
        integral = cumulative_trapezoid(rate, t_s, initial=0.0)
        assert np.linalg.norm(of - integral) < 0.01 * np.linalg.norm(integral) > 0
