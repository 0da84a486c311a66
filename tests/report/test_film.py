"""The film of a run: what the page unpacks is what the pictures show."""

import base64
import gzip
import json
from dataclasses import replace
from types import SimpleNamespace

import meshio
import numpy as np
import pandas as pd
import pytest

from analysis import read_run
from dem.run.paraview import Mesh, VtuWriter
from report.drawing.lines import envelope
from report.film import reel
from report.film.packing import OUTSIDE, pack_moving, quantised
from report.film.pictures import EARLY, IMPACT, WHOLE, Instant, choose, instants, read_arrays, read_film
from report.film.reel import QUANTUM_M, pack_run
from report.missing import MissingResult
from tests.analysis.synthetic import write_run
from tests.report.synthetic_view import T_S, centre_m, write_view


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    directory = write_run(tmp_path_factory.mktemp("film") / "ratio_050", 0.5)
    return read_run(directory), write_view(directory)


def unpack_moving(text: str, instants: int) -> np.ndarray:
    """Return what `pack_moving` packed, shape (instants, values of an instant); the page does the same."""
    data = np.frombuffer(gzip.decompress(base64.b64decode(text)), dtype=np.uint8)
    half = data.size // 2
    zigzag = data[:half].astype(np.uint16) | (data[half:].astype(np.uint16) << 8)
    error = ((zigzag >> 1) ^ (-(zigzag & 1).astype(np.int32)).astype(np.uint16)).astype(np.int16)
    rows = error.reshape(instants, -1).copy()
    for k in range(1, instants):
        rows[k] += rows[k - 1]
        if k > 1:
            rows[k] += rows[k - 1] - rows[k - 2]
    return rows


@pytest.mark.parametrize("instants_", [1, 2, 3, 7])
def test_packed_numbers_come_back_whatever_they_are(instants_):
    values = np.random.default_rng(1).integers(-32768, 32768, (instants_, 5, 3)).astype(np.int16)
    back = unpack_moving(pack_moving(values), instants_)
    assert np.array_equal(back.reshape(values.shape), values)


def test_positions_are_within_half_a_quantum_and_what_leaves_the_box_is_marked(run):
    directory, network = run
    reel = json.loads(pack_run(directory, network, (IMPACT,)))
    packed, quantum_m = reel["series"][0], reel["quantum"]
    assert quantum_m == QUANTUM_M[0]
    t_s = T_S[T_S < 1.21e-3]
    shown = unpack_moving(packed["position"], len(t_s)).reshape(len(t_s), -1, 3)
    true = np.stack([centre_m(network, t) for t in t_s])
    assert np.abs(shown * quantum_m - true).max() <= 0.5 * quantum_m * (1 + 1e-3)
    assert quantised(np.array([0.6, 0.7, -2.0, np.inf]), 2e-5).tolist() == [30000, OUTSIDE, OUTSIDE, OUTSIDE]


def test_the_impact_of_stones_that_come_one_by_one_holds_the_largest_force(tmp_path):
    network = write_view(directory := write_run(tmp_path / "ratio_050", 0.5))
    fast = pd.read_parquet(directory / "fast.parquet")
    fast.loc[(fast["t_s"] - 9e-3).abs().idxmin(), "force_N"] = 1e6
    fast.to_parquet(directory / "fast.parquet")
    (series,) = json.loads(pack_run(read_run(directory), network, (IMPACT,)))["series"]
    assert series["end"] == pytest.approx(10e-3)


@pytest.mark.parametrize(("until_s", "keys"), [(IMPACT.until_s, ["whole"]), (8e-3, ["impact", "whole"])])
def test_a_series_that_would_be_longer_than_the_run_is_not_shown(run, monkeypatch, until_s, keys):
    found = [one for one in instants(run[0].path) if one.t_s < until_s]
    monkeypatch.setattr(reel, "instants", lambda path: found)
    series = json.loads(reel.pack_films(*run, 1.0, (IMPACT, EARLY, WHOLE)))["series"]
    assert [one["key"] for one in series] == keys and series[-1]["end"] == pytest.approx(found[-1].t_s, rel=1e-5)


def test_spheres_without_bonds_move_too(tmp_path):
    directory = write_run(tmp_path / "ratio_050", 0.5)
    (directory / "deck" / "bonds.txt").unlink()
    (directory / "run.json").write_text(json.dumps(json.loads((directory / "run.json").read_text()) | {"n_bonds": 0}))
    pd.read_parquet(directory / "breakage.parquet").iloc[:0].to_parquet(directory / "breakage.parquet")
    reel = json.loads(pack_run(read_run(directory), write_view(directory), (IMPACT,)))
    assert gzip.decompress(base64.b64decode(reel["bodies"]["first"])) == b""
    assert len(reel["series"]) == 1


def test_each_series_takes_the_pictures_of_its_stretch(run):
    found = instants(run[0].path)
    chosen = {series.key: [instant.t_s for instant in choose(found, series)] for series in (IMPACT, EARLY, WHOLE)}
    assert chosen["impact"] == pytest.approx(T_S[:61])
    assert chosen["early"][-1] == pytest.approx(0.04) and len(chosen["early"]) > 20
    assert chosen["whole"][-1] == pytest.approx(0.04) and len(chosen["whole"]) <= WHOLE.most


def test_sub_spheres_of_a_stream_are_known_when_stones_come_and_pieces_leave(run, tmp_path):
    """A picture has the stones that are there, in order, and of a broken one what is left of it."""
    rng = np.random.default_rng(4)
    network = replace(run[1], radius_m=run[1].radius_m * rng.uniform(0.9, 1.1, run[1].radius_m.size))
    there = network.agglomerate != 2  # not come yet
    there[np.flatnonzero(network.agglomerate == 3)[[1, 4]]] = False  # chips that left
    points = rng.normal(size=(there.sum(), 3)).astype(np.float32)
    file = tmp_path / "particles_0000.vtu"
    VtuWriter().write(file, Mesh(points, np.arange(len(points)).reshape(-1, 1), {
        "radius_m": network.radius_m[there], "agglomerate": network.agglomerate[there].astype("u2")}))
    centre_m = read_film([Instant(0.0, file, None)], network).centre_m[0]
    assert np.array_equal(np.isfinite(centre_m).all(axis=1), there)
    assert np.array_equal(centre_m[there], points)
    with pytest.raises(MissingResult, match="not show the sub-spheres"):
        read_film([Instant(0.0, file, None)], replace(network, radius_m=1.1 * network.radius_m))


def test_the_view_has_the_walls_of_the_plate(tmp_path):
    directory = write_run(tmp_path / "ratio_050", 0.5)
    info = json.loads((directory / "run.json").read_text())
    info["scene"]["plate"] |= {"size_m": [0.5, 0.4], "wall_height_m": {"x_plus": 0.1}}
    (directory / "run.json").write_text(json.dumps(info))
    packed = json.loads(pack_run(read_run(directory), write_view(directory), (IMPACT,)))
    assert packed["plate"]["walls"] == [[0.25, 0.25, -0.2, 0.2, -0.01, 0.1]]


def test_pictures_of_a_run_are_read_as_meshio_reads_them(tmp_path):
    """The points take three blocks of the file."""
    rng = np.random.default_rng(2)
    points, cells = rng.normal(size=(200_000, 3)), rng.integers(0, 200_000, (1000, 4))
    values = {"von_mises_Pa": rng.normal(size=200_000), "displacement_m": points[::-1]}
    file = tmp_path / "plate_0000.vtu"
    VtuWriter().write(file, Mesh(points, cells, {**values, "fragment": np.arange(200_000, dtype="i4")}))
    found, mesh = read_arrays(file, ("points", "quads", "displacement_m", "von_mises_Pa")), meshio.read(file)
    assert sorted(found) == ["displacement_m", "points", "quads", "von_mises_Pa"]
    assert np.array_equal(found["points"], mesh.points) and np.array_equal(found["quads"], mesh.cells_dict["quad"])
    for name in ("displacement_m", "von_mises_Pa"):
        assert np.array_equal(found[name], mesh.point_data[name])


@pytest.mark.parametrize("kept", [0.1, 0.5, 0.9])
def test_a_picture_that_was_cut_off_is_refused(tmp_path, kept):
    file = tmp_path / "particles_0000.vtu"
    points = np.random.default_rng(3).normal(size=(5000, 3))
    VtuWriter().write(file, Mesh(points, np.arange(5000).reshape(-1, 1), {"radius_m": points[:, 0]}))
    data = file.read_bytes()
    file.write_bytes(data[:int(kept * len(data))])
    with pytest.raises(MissingResult, match="cannot be read"):
        read_film([Instant(0.0, file, None)], None)


def test_a_run_without_pictures_says_so(tmp_path):
    directory = write_run(tmp_path / "ratio_000", 0.0)
    with pytest.raises(MissingResult, match="view_interval_s"):
        instants(directory)


def test_the_envelope_keeps_every_extreme():
    t_s = np.linspace(0, 1, 100_001)
    values = np.sin(2 * np.pi * 700 * t_s) * np.exp(-3 * t_s)
    values[54_321] = 9.0  # one sample wide
    thin_s, thin = envelope(t_s, values, 900)
    assert thin_s.size <= 902 and np.all(np.diff(thin_s) > 0)
    assert thin.max() == 9.0 and thin.min() == values.min()
    assert {(t, v) for t, v in zip(thin_s, thin, strict=True)} <= set(zip(t_s, values, strict=True))


@pytest.fixture
def run_of_many_pictures(monkeypatch):
    monkeypatch.setattr(reel, "instants", lambda path: [None] * 100)
    return SimpleNamespace(path=None)


@pytest.mark.parametrize("room", [0, 112, 113, 250, 358, 700, 10**6])
def test_a_run_shows_as_many_pictures_as_its_room_has_place_for(monkeypatch, run_of_many_pictures, room):
    texts = {most: "x" * int(20 + 10 * most**0.9) for most in (100, 50, 25, 12)}
    monkeypatch.setattr(reel, "pack_run", lambda run, network, wanted: texts[wanted[0].most])
    monkeypatch.setattr(reel, "BUDGET_BYTES", 2 * room)
    fitting = [text for text in texts.values() if len(text) <= room]
    if fitting:
        assert reel.pack_films(run_of_many_pictures, None, 0.5, (WHOLE,)) == fitting[0]
    else:
        with pytest.raises(MissingResult):
            reel.pack_films(run_of_many_pictures, None, 0.5, (WHOLE,))


def test_where_few_pictures_of_all_are_too_many_the_impact_is_shown_alone(monkeypatch, run_of_many_pictures):
    monkeypatch.setattr(reel, "pack_run", lambda run, network, wanted: "x" * sum(series.most for series in wanted))
    monkeypatch.setattr(reel, "BUDGET_BYTES", 30)
    assert len(reel.pack_films(run_of_many_pictures, None, 1.0, (IMPACT, EARLY, WHOLE))) == IMPACT.most // 2
    assert len(reel.pack_films(run_of_many_pictures, None, 1.0, (EARLY, WHOLE))) == WHOLE.most // 8 + EARLY.most // 8
    packed = []
    monkeypatch.setattr(reel, "pack_run", lambda run, network, wanted: packed.append(wanted) or "x" * 31)
    with pytest.raises(MissingResult):
        reel.pack_films(run_of_many_pictures, None, 1.0, (WHOLE,))
    assert len(packed) == 1  # a run that has one series is not packed again


@pytest.mark.parametrize("room, packed", [(31, [100]), (30, [100, 12, 25, 50, 100])])
def test_few_pictures_are_packed_at_once_where_there_is_room(monkeypatch, room, packed):
    tried = []
    monkeypatch.setattr(reel, "instants", lambda path: [None] * 20)
    monkeypatch.setattr(reel, "pack_run", lambda run, network, wanted: tried.append(wanted[0].most) or "x" * (
        31 if wanted[0].most == 100 else 16))
    monkeypatch.setattr(reel, "BUDGET_BYTES", room)
    assert len(reel.pack_films(SimpleNamespace(path=None), None, 1.0, (WHOLE,))) == (31 if room == 31 else 16)
    assert tried == packed
