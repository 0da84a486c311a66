"""The page of a small stream, and what analysis reads of it."""

import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import report.page
from analysis import RecordError, read_run
from analysis.sweep import breakage
from analysis.sweep.runs import fallen, is_stream, true_ratio
from common.files.parquet import write_parquet
from common.scene.scene import changed_scene
from dem.run.prepare import prepare
from dem.run.run import run_scene
from recognition.stream.stones import COLUMNS
from report.stream import HEARD_WINDOW_S, StreamResults, fell, hits, pieces

SCENE = Path(__file__).parents[2] / "scenes" / "stream.toml"
SMALL = {"stones.agglomerate.subspheres": 24, "stones.agglomerate.contact": "sub_spheres", "time.view_interval_s": None,
         "plate.max_frequency_Hz": 800.0, "time.duration_s": 0.06, "stones.drawn.arrival_s": [0.0, 0.05],
         "stones.drawn.rate_1_s": 100.0, "stones.drawn.least_fragment": 3}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    directory = tmp_path_factory.mktemp("streams") / "ratio_030"
    run_scene(changed_scene(SCENE, SMALL), "stream.toml", directory)
    return read_run(directory)


@pytest.mark.slow
def test_the_page_of_a_stream_holds_everything_inside(run):
    html = report.page.report(run.path.parent).report.read_text()
    assert not re.search(r'(?:src|href)="(?!data:|#)', re.sub(r"<script>.*?</script>", "", html, flags=re.DOTALL))
    for key in ("felt", "fell", "hits", "pieces"):
        assert f'id="ratio_030-stream-{key}"' in html
    assert html.count("<img src") == 4 and "Not drawn" not in html and "not drawn" not in html
    count = fallen(run)["first_contact_s"].notna().sum()
    assert f"<b>{count} stones</b>" in html and not (run.path.parent / "claims.csv").exists()


def test_true_ratio_is_that_of_a_count_by_hand(run):
    stones = fallen(run)
    assert is_stream(run) and 0 < stones["is_gangue"].sum() < len(stones)
    for begin, end in ((0.0, 0.06), (0.01, 0.04), (0.02, 0.06)):
        here = [row for row in stones.itertuples() if begin <= row.first_contact_s < end]
        mass = {kind: sum(row.mass_kg for row in here if row.material == kind) for kind in ("coal", "gangue")}
        number = sum(row.material == "gangue" for row in here) / len(here)
        assert true_ratio(stones, begin, end) == pytest.approx(mass["gangue"] / sum(mass.values()), rel=1e-12)
        assert true_ratio(stones, begin, end, "number") == pytest.approx(number, rel=1e-12)
    with pytest.raises(RecordError, match="no stone touched the plate first from 1 to 2 s"):
        true_ratio(stones, 1.0, 2.0)


@pytest.mark.slow
def test_sub_spheres_and_bonds_of_a_stream_are_those_of_its_scene(run):
    assembly = prepare(changed_scene(SCENE, SMALL), "stream.toml", None).assembly
    network = breakage.read_network(run)
    assert np.array_equal(network.first, assembly.bond_first) and np.array_equal(network.second, assembly.bond_second)
    assert np.array_equal(network.agglomerate, assembly.agglomerate + 1)
    assert network.radius_m == pytest.approx(assembly.radius_m, rel=1e-12)


def test_pieces_have_the_mass_of_the_stones_that_came(run):
    results = StreamResults(run)
    stones, pieces = results.touched, results.piece_masses_kg
    for name, masses in pieces.items():
        own = stones[stones["is_gangue"] == (name == "gangue")]
        assert masses.sum() == pytest.approx(own["mass_kg"].sum(), rel=1e-9)
    assert len(pieces["coal"]) > (~stones["is_gangue"]).sum()  # some broke
    ends_s, ratios = results.sliding_ratio()
    assert ends_s[-1] == run.t_s[-1] and np.nanmax(ratios["mass"]) <= 1.0


def test_a_stone_file_that_is_cut_off_is_refused(run, tmp_path):
    copy = tmp_path / "ratio_030"
    shutil.copytree(run.path, copy)
    file = copy / "deck" / "stones.bin"
    for size in (40, file.stat().st_size // 16 * 8):
        file.write_bytes(file.read_bytes()[:size])
        with pytest.raises(RecordError, match=r"stones.bin: cut off"):
            breakage.read_network(read_run(copy))


@pytest.mark.slow
def test_what_was_heard_stands_beside_what_fell(run, tmp_path):
    copy = tmp_path / "heard_streams"
    shutil.copytree(run.path.parent, copy)
    stones = fallen(run).dropna(subset="first_contact_s")
    heard = pd.DataFrame(0.0, index=range(len(stones)), columns=COLUMNS).assign(
        t_s=stones["first_contact_s"].to_numpy(), gangue=stones["is_gangue"].to_numpy().astype(float),
        mass_coal_kg=stones["mass_kg"].to_numpy(), mass_gangue_kg=stones["mass_kg"].to_numpy())
    (copy / "heard").mkdir()
    write_parquet(heard, copy / "heard" / "stones.parquet")
    write_parquet(pd.DataFrame({"t_s": [0.01], "ratio": [0.3]}), copy / "heard" / "ratio.parquet")
    found = StreamResults(read_run(copy / run.path.name)).heard
    assert found.heard["mass_ratio"].iloc[-1] == pytest.approx(true_ratio(stones, 0.0, HEARD_WINDOW_S), abs=0.02)
    assert 'id="ratio_030-stream-heard"' in report.page.report(copy).report.read_text()


@pytest.mark.parametrize("force_N", [3000.0, 0.0])
def test_stones_of_which_none_broke_are_drawn(force_N):
    """Nothing to draw on a logarithmic axis."""
    touched = pd.DataFrame({"mass_kg": [0.1, 0.2], "peak_force_N": force_N, "broken_area_m2": 0.0,
                            "is_gangue": [True, False]})
    figure, _ = hits.drawn(SimpleNamespace(touched=touched))
    figure.draw_without_rendering()
    assert figure.axes[1].get_title(loc="left") == "broken area, cm²: none"


@pytest.mark.filterwarnings("error")
def test_pieces_of_a_stream_of_which_no_stone_came_are_not_drawn():
    none = np.empty(0)
    figure, _ = pieces.drawn(SimpleNamespace(
        run=SimpleNamespace(breakage=pd.DataFrame({"agglomerate": none, "t_s": none, "area_m2": none})),
        left=pd.DataFrame({"is_chip": none.astype(bool), "t_s": none, "mass_kg": none}), end_s=1.0,
        stones=pd.DataFrame({"is_gangue": [True]}), piece_masses_kg={"coal": none, "gangue": none}))
    assert len(figure.axes) == 2


def test_what_fell_is_drawn_from_the_beginning_to_the_end_also_of_one_stone():
    touched = pd.DataFrame({"first_contact_s": [0.2], "mass_kg": [0.1], "radius_m": [0.02], "is_gangue": [True]})
    ends_s = np.array([0.1, 0.3])
    figure, _ = fell.drawn(SimpleNamespace(touched=touched, window_s=0.1, sliding_ratio=lambda: (
        ends_s, {"mass": ends_s, "number": ends_s})))
    coal, gangue = figure.axes[0].get_lines()
    assert np.array_equal(gangue.get_xydata(), [[0.0, 0.0], [0.2, 0.1], [0.3, 0.1]])
    assert np.array_equal(coal.get_xydata(), [[0.0, 0.0], [0.3, 0.0]])
