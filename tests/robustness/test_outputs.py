"""No command replaces or mixes with what this program did not write, and none loses a run of another scene."""

import json
import os
import shutil
from pathlib import Path

import pandas as pd
import pytest

import dem.run.run
import plate_fem.__main__
import recognition.__main__
import report.__main__
import report.page
from common.files.output_directory import (
    Busy,
    at_work_in,
    hash_of,
    is_stamped,
    locked,
    refuse_replacing,
    remove_written,
    stamped,
    write_contents,
)
from common.tables import InputError
from dem.__main__ import main
from dem.run.run import RunError
from tests.analysis.synthetic import write_sweep
from tests.robustness.small import HERTZ, SCENES

RUN = ["run", str(HERTZ), "--out"]


@pytest.fixture
def commands(tmp_path):
    """The arguments of each command that writes a directory, without the directory."""
    plan, campaign = tmp_path / "plan.toml", tmp_path / "campaign.toml"
    plan.write_text(f'scene = "{HERTZ}"\nseed = 1\n[families.one]\ngroups = 1\nruns_per_group = 1\n')
    campaign.write_text(f'scene = "{HERTZ}"\n[vary]\n"stones.gangue_ratio" = [0.0]\n')
    return {"run": RUN, "deck": ["deck", str(HERTZ), "--out"], "sweep": ["sweep", str(HERTZ), "--out"],
            "dataset": ["dataset", str(plan), "--out"], "campaign": ["campaign", str(campaign), "--out"],
            "calibrate": ["calibrate", "coal", "--scene", str(SCENES / "paper.toml"), "--out"]}


def everything(directory):
    return {str(file.relative_to(directory)): file.read_bytes() for file in directory.rglob("*") if file.is_file()}


def refused(capsys, arguments):
    code = main([str(argument) for argument in arguments])
    errors = capsys.readouterr().err.splitlines()
    assert code == 2 and len(errors) == 1, (code, errors)
    return errors[0]


@pytest.mark.parametrize("name", ["run", "deck", "sweep", "dataset", "campaign"])
def test_a_directory_of_somebody_else_is_left_alone(commands, tmp_path, capsys, name):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.txt").write_text("years of work")
    before = everything(tmp_path)
    for out in (mine, tmp_path / "x" / ".." / "mine"):
        assert "mine" in refused(capsys, [*commands[name], out])
    assert everything(tmp_path) == before


def test_the_files_of_a_calibration_are_replaced_by_a_calibration_only(commands, tmp_path, capsys):
    (tmp_path / "coal.toml").write_text("mine")
    assert "coal.toml" in refused(capsys, [*commands["calibrate"], tmp_path])
    (tmp_path / "coal.toml").unlink()
    (tmp_path / "coal.partial").mkdir()
    (tmp_path / "coal.partial" / "mine").write_text("mine")
    assert "coal.partial" in refused(capsys, [*commands["calibrate"], tmp_path])
    assert (tmp_path / "coal.partial" / "mine").exists()


@pytest.mark.parametrize("out", [".", "..", "/", "sub/..", "link", "file", "file/x"])
@pytest.mark.parametrize("name", ["run", "sweep", "dataset", "campaign", "deck"])
def test_places_that_are_no_output(commands, tmp_path, capsys, monkeypatch, name, out):
    here = tmp_path / "here"
    (here / "sub").mkdir(parents=True)
    (here / "file").write_text("")
    (here / "link").symlink_to(here / "sub")
    monkeypatch.chdir(here)
    before = sorted(tmp_path.rglob("*"))
    assert out in refused(capsys, [*commands[name], out])
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("kind", ["sweep", "dataset", "campaign"])
def test_a_run_does_not_take_the_place_of_many_runs(tmp_path, capsys, kind):
    out = tmp_path / kind
    (out / "ratio_000").mkdir(parents=True)
    (out / "ratio_000" / "run.json").write_text("{}")
    write_contents(out, kind)
    assert kind in refused(capsys, [*RUN, out, "--overwrite"])
    assert (out / "ratio_000" / "run.json").exists()


def test_a_run_is_replaced_by_the_same_scene_or_with_overwrite(tmp_path, capsys):
    out, other = tmp_path / "run", ["--set", "stones.speed_m_s=2.0"]
    assert main([*RUN, str(out)]) == 0
    assert main([*RUN, str(out)]) == 0
    before = everything(out)
    capsys.readouterr()
    assert "another scene" in refused(capsys, [*RUN, out, *other])
    (out / "view").mkdir(exist_ok=True)
    (out / "view" / "mine.txt").write_text("mine")  # a file of somebody else within
    assert "mine.txt" in refused(capsys, [*RUN, out, *other, "--overwrite"])
    (out / "view" / "mine.txt").unlink()
    assert everything(out) == before
    assert main([*RUN, str(out), *other, "--overwrite"]) == 0
    assert json.loads((out / "run.json").read_text())["scene"]["stones"]["speed_m_s"] == 2.0
    assert {entry.name for entry in tmp_path.iterdir()} == {"run"}  # nothing beside it, as it has no modes


def test_neighbours_with_the_names_that_a_run_uses_are_left_alone(tmp_path, capsys):
    for suffix in (".partial", ".earlier"):
        place = tmp_path / f"run{suffix}"
        place.mkdir()
        (place / "mine.txt").write_text("mine")
        assert f"run{suffix}" in refused(capsys, [*RUN, tmp_path / "run", "--overwrite"])
        assert everything(place) == {"mine.txt": b"mine"}
        (place / "mine.txt").unlink()
        place.rmdir()


def begun(out, *arguments):
    """A run that `main` stops before the engine starts, as far as its started.json."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dem.run.run._run_in", lambda *_: (_ for _ in ()).throw(RunError("stopped")))
        assert main([*RUN, str(out), *arguments]) == 1
    return out.with_name(f"{out.name}.partial")


def test_a_run_that_replaces_another_is_gone_on_with(tmp_path, capsys):
    """Consent to the replacement was given when it was begun."""
    out, other = tmp_path / "run", ["--set", "stones.speed_m_s=2.0"]
    assert main([*RUN, str(out)]) == 0
    begun(out, *other, "--overwrite")
    capsys.readouterr()
    assert "another scene was begun" in refused(capsys, [*RUN, out])
    assert main(["resume", str(out)]) == 0
    assert json.loads((out / "run.json").read_text())["scene"]["stones"]["speed_m_s"] == 2.0
    assert "another scene" in refused(capsys, [*RUN, out])


def test_a_foreign_file_in_a_run_in_progress_is_neither_deleted_nor_taken_for_its_own(tmp_path, capsys, monkeypatch):
    out = tmp_path / "run"
    partial = begun(out)
    capsys.readouterr()
    (partial / "mine.txt").write_text("mine")
    for command in ([*RUN, out], [*RUN, out, "--overwrite"], ["resume", out]):
        assert "mine.txt" in refused(capsys, command)
    (partial / "mine.txt").unlink()
    simulate = dem.run.run._run_in

    def put_while_it_runs(*arguments):
        (partial / "mine.txt").write_text("mine")
        return simulate(*arguments)

    monkeypatch.setattr("dem.run.run._run_in", put_while_it_runs)
    assert main(["resume", str(out)]) == 0
    files = json.loads((out / "contents.json").read_text())["files"]
    assert "run.json" in files and "mine.txt" not in files
    assert {"mine.txt", "contents.json"} == set(everything(out)) - set(files)
    assert "mine.txt" in refused(capsys, [*RUN, out, "--overwrite"])
    assert (out / "mine.txt").read_text() == "mine"


def while_it_runs(monkeypatch, put):
    """Something is done in the middle of the next runs."""
    simulate = dem.run.run._run_in

    def run_in(work, *arguments):
        put(work.path)
        return simulate(work, *arguments)

    monkeypatch.setattr("dem.run.run._run_in", run_in)


MINE = ("deck/notes.txt", "view/shot.png", "deck/dumps/mine.vtp", "deck/checkpoint/notes")  # within a run in progress


def put_mine(partial):
    for name in MINE:
        (partial / name).parent.mkdir(parents=True, exist_ok=True)
        (partial / name).write_text("mine")


def test_files_that_came_into_a_run_in_progress_are_nobody_elses(tmp_path, capsys, monkeypatch):
    """Before it is gone on with they are refused, and while it runs they are left alone."""
    out = tmp_path / "run"
    partial = begun(out)
    for name in MINE:
        (partial / name).parent.mkdir(exist_ok=True)
        (partial / name).write_text("mine")
        capsys.readouterr()
        for command in ([*RUN, out], ["resume", out], [*RUN, out, "--overwrite"]):
            assert name in refused(capsys, command)
        assert (partial / name).read_text() == "mine"
        (partial / name).unlink()
    while_it_runs(monkeypatch, put_mine)
    assert main(["resume", str(out)]) == 0
    assert not set(MINE) & set(json.loads((out / "contents.json").read_text())["files"])
    capsys.readouterr()
    assert any(name in refused(capsys, [*RUN, out, "--overwrite"]) for name in MINE)
    assert all((out / name).read_text() == "mine" for name in MINE)


def test_a_data_set_drops_the_deck_but_not_what_is_in_it_of_somebody_else(commands, tmp_path, monkeypatch):
    while_it_runs(monkeypatch, put_mine)
    assert main([*commands["dataset"], str(tmp_path / "set")]) == 0
    (directory,) = (tmp_path / "set").glob("one/000/ratio_*")
    found = everything(directory)
    assert set(MINE) <= set(found)
    assert {name for name in MINE if name.startswith("deck")} == {name for name in found if name.startswith("deck")}


@pytest.mark.parametrize("place", ["run.earlier", "run", "run.earlier is a file", "run.earlier is a copy"])
def test_what_came_beside_a_run_at_work_is_left_alone(tmp_path, capsys, monkeypatch, place):
    out, earlier, other = tmp_path / "run", tmp_path / "run.earlier", ["--set", "stones.speed_m_s=2.0"]
    assert main([*RUN, str(out)]) == 0

    def put(partial):
        if place == "run.earlier":
            earlier.mkdir()
            (earlier / "mine.txt").write_text("mine")
        elif place == "run":
            (out / "mine.txt").write_text("mine")
        elif "file" in place:
            earlier.write_text("mine")
        else:
            shutil.copytree(out, earlier)

    while_it_runs(monkeypatch, put)
    capsys.readouterr()
    where = place.split()[0]
    assert where in refused(capsys, [*RUN, out, *other, "--overwrite"])
    before = everything(tmp_path)
    assert any(name.startswith(where) for name in before)
    assert where in refused(capsys, [*RUN, out, *other, "--overwrite"])
    assert everything(tmp_path) == before
    if place == "run":
        (out / "mine.txt").unlink()
    else:
        earlier.rename(tmp_path / "moved away")
    monkeypatch.setattr("dem.run.run._run_in", None)  # what was simulated is taken, and not once more
    assert main([*RUN, str(out), *other, "--overwrite"]) == 0
    assert json.loads((out / "run.json").read_text())["scene"]["stones"]["speed_m_s"] == 2.0


@pytest.mark.parametrize("name", ["deck/deck.liggghts", "run.json", "signals.parquet"])
def test_a_file_of_a_run_that_was_changed_by_hand_is_not_replaced(tmp_path, capsys, name):
    out = tmp_path / "run"
    assert main([*RUN, str(out)]) == 0
    with open(out / name, "ab") as changed:
        changed.write(b"\n")
    before = everything(out)
    capsys.readouterr()
    for command in ([*RUN, out], [*RUN, out, "--overwrite"]):
        assert name in refused(capsys, command)
    assert everything(out) == before


def test_a_list_of_files_does_not_reach_out_of_its_directory(tmp_path):
    out, mine = tmp_path / "run", tmp_path / "mine.txt"
    out.mkdir()
    mine.write_text("mine")
    (out / "link").symlink_to(mine)
    write_contents(out, "run", {"../mine.txt": hash_of(mine), "link": hash_of(mine), str(mine): hash_of(mine)})
    with pytest.raises(InputError, match="link"):
        refuse_replacing(out, "run")
    remove_written(out, "run")
    assert mine.read_text() == "mine" and (out / "link").is_symlink()


@pytest.mark.slow
def test_a_single_file_is_written_over_its_own_kind_only(tmp_path, capsys, monkeypatch):
    """Not over any file of the format, nor over one that was changed since."""
    monkeypatch.setattr("recognition.estimation.noise.COPIES", 2)  # a fit takes its time
    scene = tmp_path / "plate.toml"
    scene.write_text('[plate]\nsize_m = [0.5, 0.5]\nthickness_m = 0.005\n'
                     "damping_ratio = 0.01\ndensity_kg_m3 = 7830.0\nyoungs_modulus_Pa = 2.07e11\npoisson_ratio = 0.3\n"
                     "max_frequency_Hz = 100.0\n")
    sweep = write_sweep(tmp_path / "sweep", ratios=(0.0, 0.3, 0.5, 1.0))
    own = tmp_path / "own"
    modes = plate_fem.__main__.main, ["modes", str(scene), "--out", str(own.with_suffix(".vtu"))]
    fit = recognition.__main__.main, ["fit", str(sweep), "--out", str(own.with_suffix(".json"))]
    one = str(sweep / "ratio_000")
    compare = report.__main__.main, ["compare", one, one, "--out", str(own.with_suffix(".html"))]
    for (entry, words), text in [
            (modes, '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid">mine</VTKFile>\n'),
            (fit, '{"format": "coal-gangue mixing ratio", "notes": "mine"}'),
            (compare, '<meta name="generator" content="coal-gangue-impact">mine')]:
        file = Path(words[-1])
        file.write_text(text)
        assert entry(words) == 2 and file.read_text() == text
        assert str(file) in capsys.readouterr().err
        file.unlink()
        assert entry(words) == 0
        own = file.read_bytes()
        assert words[0] == "fit" or entry(words) == 0
        file.write_bytes(own.replace(b"e", b"E", 1))
        assert entry(words) == 2 and file.read_bytes() == own.replace(b"e", b"E", 1)


@pytest.mark.parametrize("kind", ["sweep", "dataset"])
@pytest.mark.parametrize("damaged", ["", '{"status": "fini'])
def test_a_damaged_run_is_replaced_with_overwrite(commands, tmp_path, capsys, monkeypatch, kind, damaged):
    """What would be run is looked at, and the runs are left out."""
    out = tmp_path / kind
    monkeypatch.setattr("dem.batch.sweep.run_all", lambda works, *_: [(k, 1, "left out") for k in range(len(works))])
    where = out / ("ratio_000" if kind == "sweep" else "one/000/ratio_000")
    for ratio in ("ratio_000", "ratio_100"):  # of the data set there is one of the two
        directory = where.with_name(ratio)
        directory.mkdir(parents=True)
        (directory / "run.json").write_text(damaged)
        write_contents(directory, "run", {"run.json": hash_of(directory / "run.json")})
    write_contents(out, kind)
    assert "run.json" in refused(capsys, [*commands[kind], out])
    assert main([*commands[kind], str(out), "--overwrite"]) == 1
    assert ("2 runs, 2 to run" if kind == "sweep" else "1 runs, 1 to run") in capsys.readouterr().out


@pytest.mark.parametrize("left", [".lock", "contents.json.123.part"])
def test_a_directory_that_was_only_just_begun_is_taken_up(tmp_path, left):
    """Killed before it wrote contents.json, or another process still does."""
    out = tmp_path / "sweep"
    out.mkdir()
    lock = locked(out / ".lock")
    (out / left).touch()
    with pytest.raises(Busy), at_work_in(out, "sweep"):
        pass
    os.close(lock)
    with at_work_in(out, "sweep"):
        assert (out / "contents.json").is_file()
    (tmp_path / "mine" / "contents.json.part").mkdir(parents=True)
    with pytest.raises(InputError, match="mine"), at_work_in(tmp_path / "mine", "sweep"):
        pass


def test_two_commands_do_not_work_in_one_directory(commands, tmp_path, capsys):
    for kind in ("sweep", "dataset", "campaign"):
        out = tmp_path / kind
        with at_work_in(out, kind):
            assert main([*commands[kind], str(out)]) == 1
            assert "another process is at work here" in capsys.readouterr().err
        assert not list(out.glob("**/run.json"))


@pytest.mark.slow
def test_a_report_is_written_over_a_report_only(tmp_path):
    sweep = write_sweep(tmp_path / "sweep", ratios=(0.0,))
    head = "claim,where,verdict,value,expected\n"
    for mine in ("mine", head, stamped(head, "# {}").replace("where", "where?")):
        (sweep / "claims.csv").write_text(mine)
        with pytest.raises(InputError, match="claims.csv"):
            report.page.report(sweep)
        assert (sweep / "claims.csv").read_text() == mine and not (sweep / "report.html").exists()
    (sweep / "claims.csv").write_text(stamped(head, "# {}"))
    report.page.report(sweep)
    report.page.report(sweep)
    assert is_stamped((sweep / "claims.csv").read_bytes())


@pytest.mark.parametrize(("command", "name", "head"), [
    (["calibrate", "coal", "--scene", "scenes/paper.toml", "--out"], "coal_tests.csv", "stage,test,seed\n"),
    (["evaluate"], "evaluation.csv", "method,held_out,noise_db\n")])
def test_a_table_with_notes_in_it_is_not_replaced(tmp_path, capsys, command, name, head):
    (tmp_path / name).write_text(stamped(head, "# {}") + "my note\n")
    program = recognition.__main__.main if command == ["evaluate"] else main
    assert program([*command, str(tmp_path)]) == 2
    assert f"{name}: is there, and this program did not write it, or it was changed since" in capsys.readouterr().err


def test_damage_within_a_table_is_refused(tmp_path):
    """Every flipped bit of the numbers; without the checksums most would read as other numbers."""
    import numpy as np

    from analysis import RecordError
    from analysis.files.readers import read_table
    from common.files.parquet import write_parquet

    table = pd.DataFrame({"t_s": np.arange(200) * 1e-3, "a_m_s2": np.random.default_rng(1).normal(size=200)})
    file = tmp_path / "signals.parquet"
    write_parquet(table, file)
    whole, refusals = file.read_bytes(), 0
    pd.testing.assert_frame_equal(read_table(file), table)
    for at in range(4, len(whole), 37):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1:])
        try:
            found = read_table(file)
        except RecordError:
            refusals += 1
        else:
            assert list(found.columns) != list(table.columns) or found.equals(table), at
    assert refusals > 50
