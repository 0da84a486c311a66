"""The command blocks of the pages, in a fresh copy of the tracked files: they run as they are written."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import wavfile

from common.scene.scene import changed_scene
from gangue.commands import parser_of
from lab.known_truth.simulated import draw_stones, stream_of
from lab.known_truth.tap_records import hammer_taps
from recognition.innovations.signatures import Channels
from recognition.plate.plate_model import PlateModel
from recognition.volley.recognise import RATE_Hz
from tests.analysis.synthetic import write_sweep
from tests.campaign.private_slurm import missing, private_slurm
from tests.recognition.test_volley import record, stone

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
BLOCKS = {f"{page.relative_to(ROOT)} {number}": block for page in PAGES
          for number, block in enumerate(re.findall(r"```sh\n(.*?)```", page.read_text(), re.DOTALL))}
#: The user's own runs and files, made before a block.
MADE_BEFORE = {
    "docs/recognition.md 0": """
gangue sweep scenes/paper.toml --set time.duration_s=0.04 --out runs/paper
gangue run scenes/paper.toml --gangue 0.4 --set stones.seed=7 --set time.duration_s=0.04 --out runs/other/ratio_040
gangue dataset scenes/dataset.toml --runs 1 --out runs/dataset
python -c "from pandas import read_parquet
read_parquet('runs/other/ratio_040/fast.parquet').to_csv('measured.csv', index=False)"
python -c "from recognition.plate.plate_model import PlateModel
PlateModel.from_scene('scenes/paper.toml', 12e3).save('plate.json')"
""", "docs/extending.md 0": """
mkdir OUT
python -c "from tests.test_docs import blocks; print(blocks('toml')[0])" > OUT/sheet.toml
python -c "from tests.test_docs import blocks; print(blocks('toml')[1])" > OUT/scene.toml
"""}
#: What shows that a block did what its page says, after it.
TRIED_AFTER = {"docs/extending.md 0": "gangue run OUT/scene.toml --gangue 1 --set time.duration_s=5e-4 --out OUT/run"}
CLUSTER = "docs/campaigns.md 0"
#: Wants what a plate and its sensors recorded.
OF_A_PLATE = ["docs/listening.md 0", "docs/tapping.md 0", "docs/volley.md 0"]
QUICK = ["docs/analysis.md 0", "docs/extending.md 1"]
LONG = sorted({*BLOCKS} - {CLUSTER} - {*QUICK} - {*OF_A_PLATE})
OF_THE_USER = {"record.csv", "hit.wav", "taps.toml", "stream.parquet", "measured.csv", "record.parquet",
               "OUT/scene.toml", "OUT/sheet.toml", "plate.json", "runs/paper", "runs/paper/ratio_030",
               "runs/before", "runs/after", "runs/dataset", "runs/other/ratio_040", "runs/a"}


def commands(block):
    """Each line of a block, without the remark behind it."""
    return [line.partition(" #")[0].strip() for line in block.strip().splitlines()]


@pytest.mark.parametrize("name", BLOCKS)
def test_every_command_is_spelt_as_the_program_takes_it(name):
    """`gangue ...` with files that are shipped, the user's own, or made above; a target of make that there is."""
    made = set()
    for line in commands(BLOCKS[name]):
        if line == ". .venv/bin/activate":
            continue
        program, *words = shlex.split(line)
        if program == "make":
            subprocess.run(["make", "-n", *words], cwd=ROOT, capture_output=True, check=True)
            continue
        assert program == "gangue", line
        given = vars(parser_of().parse_args(words))
        given.pop("gangue_ratio", None)
        out = str(given.pop("out", None))
        for value in [*given.values(), *(given.get("file") or [] if isinstance(given.get("file"), list) else [])]:
            if isinstance(value, str | Path) and re.search(r"/|\.\w+$", str(value)) and "m/s" not in str(value):
                assert str(value) in {*made, *OF_THE_USER} or (ROOT / value).exists(), line
        made.add(out)


def test_make_recognise_taps_places_as_a_scene_takes_them():
    (change,) = re.findall(r'--set "(stones.positions_m=\S+)"', (ROOT / "Makefile").read_text())
    given = vars(parser_of().parse_args(["run", "scenes/tap.toml", "--out", "x", "--set",
                                         change.replace("$$x", "0.11").replace("$$y", "-0.07")]))
    stones = changed_scene(ROOT / "scenes" / "tap.toml", dict(given["changes"])).stones
    assert [tuple(place) for place in stones.positions_m] == [(0.11, -0.07)]


@pytest.fixture
def clone(tmp_path):
    """The tracked files, with this machine's environment and engine, and files of a user beside them."""
    files = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT,
                           capture_output=True, text=True, check=True).stdout.split("\0")
    for name in filter(None, files):
        if (ROOT / name).is_file():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tmp_path / name)
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "engine").symlink_to(ROOT / "build" / "engine")
    (tmp_path / ".venv").symlink_to(Path(sys.prefix))
    for words in (["init", "-q"], ["add", "."], ["-c", "user.name=T", "-c", "user.email=t@t", "commit", "-qm", "copy"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)  # results name the commit of their code
    for sweep in ("paper", "before", "after"):
        write_sweep(tmp_path / "runs" / sweep)
    wave = np.sin(np.arange(4000) / 7)
    wavfile.write(tmp_path / "hit.wav", 20_000, wave)
    (tmp_path / "record.csv").write_text("acc,other\n" + "".join(f"{value:.6f},0.5\n" for value in wave))
    return tmp_path


def assert_block_runs(name, clone, environment=os.environ):
    environment = environment | {"PYTHONPATH": str(clone), "PATH": f"{sys.prefix}/bin:{environment['PATH']}"}
    script = MADE_BEFORE.get(name, "") + BLOCKS[name] + TRIED_AFTER.get(name, "")
    done = subprocess.run(["sh", "-e", "-c", script], cwd=clone, env=environment, capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stdout[-500:] + done.stderr[-1000:]


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_a_block_runs_as_it_is_written(name, clone):
    assert_block_runs(name, clone)


@pytest.mark.validate
@pytest.mark.parametrize("name", LONG)
def test_a_long_block_runs_as_it_is_written(name, clone):
    if re.search("(make|gangue) sweep", MADE_BEFORE.get(name, BLOCKS[name])):
        shutil.rmtree(clone / "runs")  # it makes its runs itself
    assert_block_runs(name, clone)


@pytest.mark.validate
def test_a_campaign_here_and_through_a_cluster_runs_as_it_is_written(clone, tmp_path_factory):
    """A real one-node Slurm."""
    if missing():
        pytest.skip(f"not installed: {', '.join(missing())} (Debian: slurm-wlm, munge; `make validate` installs them)")
    with private_slurm(tmp_path_factory.mktemp("slurm"), cpus=2) as environment:
        assert_block_runs(CLUSTER, clone, environment)


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A directory with taps, a stream of stones, a volley and the plate, as its modes have them."""
    directory, rng = tmp_path_factory.mktemp("measured"), np.random.default_rng(6)
    plate, sensors = PlateModel.from_scene(ROOT / "scenes" / "paper.toml", 12e3), Channels((0, 1, 2, 3))
    lines = []
    for k, tap in enumerate(hammer_taps(plate, np.array([[0.11, 0.07], [-0.16, 0.02]]), rng, rate_Hz=40e3)):
        write_record(directory / f"tap_{k}.csv", plate, tap.acceleration, tap.rate_Hz, force_N=tap.force_N)
        lines.append(f'[[taps]]\nrecord = "tap_{k}.csv"\nplace_m = {list(map(float, tap.place_m))}\n')
    (directory / "taps.toml").write_text("".join(lines))
    stones = [stone(gangue) for gangue in (False, True)]
    coal, mixed = (draw_stones(stones, count, 40.0, 0.2, share, rng) for count, share in ((55, 0.0), (25, 0.5)))
    mixed[["t_s", "centre_s"]] += coal["t_s"].iloc[-1]
    drawn = pd.concat([coal, mixed], ignore_index=True)
    heard = stream_of(plate, sensors, stones, drawn, 40e3, 20.0, rng)
    write_record(directory / "stream.parquet", plate, heard.values, heard.rate_Hz)
    at_once = record(plate, 4, rng)
    for name in ("record.parquet", "measured.csv"):
        write_record(directory / name, plate, at_once, RATE_Hz)
    plate.save(directory / "plate.json")
    return directory


def write_record(file, plate, acceleration, rate_Hz, **more):
    named = {f"acc_{name}_m_s2": row for name, row in zip(plate.sensor_names, acceleration, strict=True)}
    table = pd.DataFrame({"t_s": np.arange(acceleration.shape[1]) / rate_Hz} | named | more)
    table.to_csv(file, index=False) if file.suffix == ".csv" else table.to_parquet(file)


@pytest.mark.validate
@pytest.mark.parametrize("name", OF_A_PLATE)
def test_a_block_on_records_of_a_plate_runs_as_it_is_written(name, clone, measured):
    """On records of the paper's plate, tapped and struck; the last line of listening simulates and hears a stream."""
    shutil.copytree(measured, clone, dirs_exist_ok=True)
    assert_block_runs(name, clone)
