"""One scene of each kind, on one and on two ranks, by an engine with sanitizers, which ends at its first report: `make
sanitize`. Not one of the other tests, whose engine has none."""

from contextlib import suppress

import pytest

from common.scene.scene import changed_scene
from dem.coupling.launch import ENGINE
from dem.run.run import Stopped, resume, run_scene
from tests.dem.decks import bond_line, deck, fcc_ball, ledger, run_engine, write_files
from tests.robustness.small import SCENES

BRIEF = {"time.sample_interval_s": 3e-5, "time.duration_s": 6e-4, "time.view_interval_s": 1.5e-4}
COARSE = {"plate.max_frequency_Hz": 2000.0}
SMALL = {"stones.agglomerate.subspheres": 200}
STREAM = {**COARSE, **SMALL, "time.duration_s": 0.04, "stones.drawn.arrival_s": [0.0, 0.03],
          "time.view_interval_s": 0.01}
WALLS = dict.fromkeys(("x_minus", "x_plus", "y_minus", "y_plus"), 0.05)
KINDS = {
    "spheres, elastic plate": ("elastic_plate", {}),
    "rigid plate that yields": ("hertz_gangue", {"plate.yield_stress_Pa": 345e6}),
    "smooth stones that break": ("paper", {**BRIEF, **COARSE, **SMALL, "stones.speed_m_s": 6.0}),
    "stones that crush, bonds that snap": ("single", {
        **BRIEF, **COARSE, "materials.coal.contact_strength_Pa": 1e8, "stones.speed_m_s": 6.0,
        "materials.coal.bond.fracture_energy_J_m2": None}),
    "sub-spheres": ("small", {"time.duration_s": 4e-3, **COARSE}),
    "shapes with faces": ("polyhedra", {**BRIEF, **COARSE, "stones.drawn.speed_m_s": 6.0}),
    "stones that come and go": ("sizes", {**COARSE, **SMALL, "time.duration_s": 0.012}),
    "stream": ("stream", {**STREAM, "stones.drawn.rate_1_s": 150.0}),
    "stream of shapes": ("caving", {**STREAM, "stones.drawn.rate_kg_s": 200.0}),
    "side walls": ("sizes", {
        **COARSE, **SMALL, "time.duration_s": 0.02, "plate.wall_height_m": WALLS,
        "stones.each": [{"material": "coal", "radius_m": 0.02, "place_m": [0.22, -0.22],
                         "velocity_m_s": (3.0, -3.0, -2.0)}]}),
}


def test_the_engine_has_sanitizers():
    built = ENGINE.read_bytes()
    assert b"__asan_init" in built and b"__ubsan_handle_out_of_bounds" in built


@pytest.mark.parametrize(("kind", "ranks"), [
    (kind, ranks) for kind in KINDS for ranks in (1, 2) if ranks == 1 or "stream" not in kind])  # which are for one
def test_a_scene_has_no_report(tmp_path, kind, ranks):
    """Stopped on one rank at its first checkpoint, if it comes to one, and taken up again."""
    name, changes = KINDS[kind]
    scene = changed_scene(SCENES / f"{name}.toml", {**changes, "ranks": ranks})
    with suppress(Stopped):
        run_scene(scene, "scene", tmp_path / "run", walltime_s=0.0 if ranks == 1 else None)
    assert resume(tmp_path / "run", show_progress=False)["status"] == "finished"


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("kernel", ["plain", "sse2", "auto"])
def test_a_deck_written_by_hand_has_no_report(tmp_path, kernel, ranks):
    """A bonded ball that hits the plate and a wall aslant, and breaks."""
    ball = fcc_ball(4)
    ball.center_m[:, 2] += 1e-5 - (ball.center_m[:, 2] - ball.radius_m).min()
    write_files(tmp_path, ball)
    wall = "contact model hertz tangential history primitive type 2 zplane 0.0"
    of = "agglomerates agglomerates.txt"
    lines = (f"fix plate all wall/plate {of} forces forces.bin extent -1 1 -1 1 co_step 1 {wall}\n"
             f"fix side all wall/side {of} forces side.bin every 10 box 5e-3 5e-3 -1 1 -1 1 {wall}\n"
             f"fix pictures all pictures {of} file pictures.bin every 100\n")
    bonds = bond_line(tension=1e6, shear=1e6, damping_time=1e-8, kernel=kernel, dilatation=(1e9, 1.0, 0.0),
                      fracture=1.0)
    run_engine(tmp_path, deck(2e-8, 3000, 100, lines, bonds, "velocity all set 2 1 -5 units box\n"), ranks)
    assert ledger(tmp_path).column["broken"][-1] > 0
