"""When pictures are taken, what they show, and that taking them changes nothing."""

from xml.etree import ElementTree

import meshio
import numpy as np
import pandas as pd
import pytest
from scenes_of_tests import changed, one_by_one

from dem.deck.pictures import ALL_IMPACT_PICTURES, PictureSchedule, arrival_s, picture_schedule
from dem.deck.time_step import step_limits, time_step
from dem.run.paraview import read_pictures
from dem.run.run import run_scene
from dem.stones.arrangement import stones_of
from dem.stones.assembly import assemble

STONE = {"stones.agglomerate.subspheres": 60, "stones.agglomerate.contact": "sub_spheres", "stones.agglomerate.unbreakable": True, "plate.max_frequency_Hz": 1000.0,
         "time.free_flight_tolerance": 1.0}  # it leaves the force loops as soon as it has rebounded
TABLES = ("signals", "fast", "breakage", "energy", "contacts")


@pytest.fixture(scope="module")
def taken(runs):
    """A stone that hits the plate and flies off spinning, with pictures, without, and with those in flight alone."""
    outputs = {"pictures": {}, "none": {"time.view_interval_s": None}, "even": {"time.view_interval_s": 3e-4}}
    for name, changes in outputs.items():
        with pytest.MonkeyPatch.context() as patch:
            if name == "even":  # as in a stream
                patch.setattr("dem.deck.pictures.IMPACT_PICTURES", 0)
            run_scene(changed("single", STONE | changes), "single", runs / f"pictures_{name}")
    return {name: runs / f"pictures_{name}" for name in outputs}


def pictures(directory):
    """{time: {part: file}} of view.pvd."""
    found = {}
    for entry in ElementTree.parse(directory / "view.pvd").getroot().findall("./Collection/DataSet"):
        found.setdefault(float(entry.get("timestep")), {})[entry.get("part")] = directory / entry.get("file")
    return found


def test_pictures_change_no_number(taken):
    for name in TABLES:
        without = pd.read_parquet(taken["none"] / f"{name}.parquet")
        for other in ("pictures", "even"):
            pd.testing.assert_frame_equal(pd.read_parquet(taken[other] / f"{name}.parquet"), without, check_exact=True)
    assert not (taken["none"] / "view.pvd").exists()


def test_pictures_are_dense_while_the_stone_pushes_and_even_in_flight(taken):
    """Against the push in the fast stream, whose rows are means over the 5 us before them."""
    fast = pd.read_parquet(taken["pictures"] / "fast.parquet")
    t, push = fast["t_s"].to_numpy(), fast["force_N"].to_numpy() != 0  # a dashpot may pull
    dense = [k for k in range(4, len(t) - 1, 4) if t[k] <= 4.6e-4]  # twice 234 us
    pushed = [k for k in dense if push[k] and push[k + 1]]
    free = [k for k in dense if not push[k] and not push[k + 1]]
    taken_at = np.array(list(pictures(taken["pictures"])))
    assert np.all(np.diff(taken_at) > 0) and len(pushed) > 8

    def there(times):
        return np.abs(taken_at[:, None] - times).min(axis=0) < 1e-12

    even = np.arange(41) * 1.5e-4
    assert np.all(there(even))
    assert np.all(there(t[pushed]))
    assert not np.any(there(t[[k for k in free if np.abs(even - t[k]).min() > 1e-9]]))
    assert np.all(np.array(list(pictures(taken["even"]))) == pytest.approx(np.arange(21) * 3e-4))


def test_a_stone_in_flight_is_shown_on_its_parabola_and_rigid(taken):
    shown = pictures(taken["pictures"])
    last_push = pd.read_parquet(taken["pictures"] / "contacts.parquet")["t_s"].max()
    times = [t for t in shown if t > last_push + 5e-4]
    particles = [meshio.read(shown[t]["0"]) for t in times]
    place = np.array([mesh.points for mesh in particles])
    mass = particles[0].point_data["radius_m"] ** 3
    height = place[:, :, 2] @ mass / mass.sum()
    curve = np.polyfit(times, height, 2)
    assert curve[0] == pytest.approx(-9.8 / 2, rel=0.01)
    assert np.abs(np.polyval(curve, times) - height).max() < 5e-7  # places to 1 um
    arm = place - place[:, :1]
    turned = np.linalg.norm(arm[-1] - arm[0], axis=1).max()
    assert turned > 1e-5  # it spins
    rounding_m = 2 * np.sqrt(3) * 2**-20  # of two arms, each coordinate of which is the difference of two rounded ones
    assert np.abs(np.linalg.norm(arm, axis=2) - np.linalg.norm(arm[0], axis=1)).max() <= rounding_m


def test_two_rates_meet_in_one_schedule():
    schedule = PictureSchedule(every=270, impact_every=36, impacts=((36, 108), (540, 612)))
    assert schedule.possible(range(0, 1)) == [0]
    assert schedule.possible(range(36, 571, 9)) == [36, 72, 108, 270, 540]
    assert schedule.possible(range(9, 36, 9)) == []
    assert schedule.possible(range(541, 700, 1)) == [576, 612]


@pytest.mark.parametrize("arrivals_s, impacts", [([0.0] * 10, 1), ([0.0] * 5 + [0.01] * 5, 2), ([0.01 * k for k in range(10)], None)])
def test_each_impact_gets_its_pictures_and_all_together_are_bounded(arrivals_s, impacts):
    """A stone's lowest point falls h = v t + g t^2/2 in the time t, or touches when it was asked to."""
    scene = one_by_one(changed("paper", {"stones.agglomerate.subspheres": 20, "time.duration_s": 10.0,
                                         "stones.agglomerate.contact": "sub_spheres"}), arrival_s=arrivals_s)
    assembly = assemble(scene, stones_of(scene, "scene"))
    step = time_step(scene, step_limits(scene, assembly, "scene"), "scene", 0.1)
    t = arrival_s(assembly)
    lowest = [(assembly.center_m[:, 2] - assembly.radius_m)[assembly.agglomerate == k].min() for k in range(10)]
    later = np.array(arrivals_s) > 0
    assert (3.0 * t + 4.9 * t**2)[~later] == pytest.approx(np.array(lowest)[~later], rel=1e-12)
    assert t[later] == pytest.approx(np.array(arrivals_s)[later], rel=1e-9)
    schedule = picture_schedule(scene, assembly, step)
    assert len(schedule.impacts) == impacts or impacts is None and 2 < len(schedule.impacts) < 10
    assert len(schedule.in_impact) <= ALL_IMPACT_PICTURES
    first, last = schedule.impacts[0]
    assert first >= t.min() / step.dt_s > first - schedule.impact_every
    assert (last - first) * step.dt_s >= 4.6e-4 - 4e-5  # twice the contact of a Hertz sphere
    assert schedule.impact_every * step.dt_s == pytest.approx(2e-5, rel=1e-9)
    assert all(k % step.fast_steps == 0 for k in schedule.in_impact)


def test_a_scene_without_pictures_has_no_schedule():
    scene = changed("paper", {"time.view_interval_s": None, "stones.agglomerate.subspheres": 20,
                              "stones.agglomerate.contact": "sub_spheres"})
    assembly = assemble(scene, stones_of(scene, "scene"))
    step = time_step(scene, step_limits(scene, assembly, "scene"), "scene", 0.1)
    assert picture_schedule(scene, assembly, step) is None


def test_pictures_that_are_cut_off_are_refused(tmp_path):
    whole = np.array([7, 0, 1, 0], dtype="<i8").tobytes() + np.zeros(12, dtype="<f4").tobytes()
    for cut in (len(whole) - 1, 20, 8):
        (tmp_path / "pictures.bin").write_bytes(whole + whole[:cut])
        with pytest.raises(RuntimeError, match="cut off or damaged"):
            list(read_pictures(tmp_path / "pictures.bin", np.array([2])))
    (tmp_path / "pictures.bin").write_bytes(whole + whole)
    assert [step for step, *_ in read_pictures(tmp_path / "pictures.bin", np.array([2]))] == [7, 7]
