"""What the documentation shows works: its examples, its links, its notation."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from analysis import read_sweep
from tests.analysis.synthetic import write_sweep

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
EXTENDING = (ROOT / "docs" / "extending.md").read_text()


def blocks(kind):
    return re.findall(rf"```{kind}\n(.*?)```", EXTENDING, re.DOTALL)


@pytest.mark.parametrize("code", blocks("python"), ids=["material", "parameter", "fusion"])
def test_examples_in_python(code, tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    names = {}
    if "runs" in code:
        names["runs"] = read_sweep(write_sweep(tmp_path / "runs")).runs
    exec(compile(code, "docs/extending.md", "exec"), names)  # noqa: S102  our own page


def test_examples_of_commands(tmp_path):
    (commands,) = blocks("sh")
    for command in commands.strip().splitlines():
        words = [sys.executable, *command.replace("OUT", str(tmp_path)).split()[1:]]
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "run" / "run.json").is_file()


@pytest.mark.validate
def test_the_example_of_a_fix(tmp_path):
    """Built into a copy of the engine; two spheres that fall freely have the speed that gravity gives them."""
    engine = tmp_path / "engine"
    shutil.copytree(ROOT / "dem" / "engine", engine)
    for code in blocks("cpp"):
        name, text = re.fullmatch(r"// (\S+)\n(.*)", code, re.DOTALL).groups()
        (engine / name).write_text(text)
    for file, old, new in [("Makefile", "SOURCES := ", "SOURCES := fix_top_speed.cpp "),
                           ("main.cpp", '#include "fix_ledger.h"', '#include "fix_ledger.h"\n#include "fix_top_speed.h"'),
                           ("main.cpp", 'styles["ledger"]', 'styles["top/speed"] = &create<FixTopSpeed>;\n  styles["ledger"]')]:
        text = (engine / file).read_text()
        assert text.count(old) == 1
        (engine / file).write_text(text.replace(old, new))
    subprocess.run(["make", "-s", "-C", str(engine), f"BUILD={tmp_path / 'build'}"], check=True)
    (tmp_path / "deck").write_text("""
atom_style granular
boundary f f f
newton off
communicate single vel yes
units si
hard_particles yes
region box block -1 1 -1 1 -1 1 units box
create_box 1 box
create_atoms 1 single 0 0 0
create_atoms 1 single 0.5 0 0
set group all diameter 0.02 density 2000
neighbor 0.01 bin
neigh_modify delay 0
fix youngs all property/global youngsModulus peratomtype 1e9
fix poisson all property/global poissonsRatio peratomtype 0.3
fix restitution all property/global coefficientRestitution peratomtypepair 1 0.5
pair_style gran model hertz
pair_coeff * *
timestep 1e-5
fix motion all nve/sphere
fix gravity all gravity 9.8 vector 0 0 -1
fix top all top/speed 100
run 1000
""")
    done = subprocess.run([tmp_path / "build" / "liggghts-bonded", "-in", "deck"], cwd=tmp_path, capture_output=True,
                          text=True, check=False)
    assert done.returncode == 0, done.stdout[-1000:]
    found = [(int(step), float(speed)) for step, speed in re.findall(r"top speed (\d+) (\S+)", done.stdout)]
    assert [step for step, _ in found] == list(range(100, 1001, 100))
    assert all(speed == pytest.approx(9.8e-5 * step, rel=1e-9) for step, speed in found)


@pytest.mark.parametrize("page", PAGES, ids=[p.name for p in PAGES])
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def notation():
    """Rows of the table: symbol, code, unit, meaning."""
    lines = (ROOT / "docs" / "notation.md").read_text().splitlines()
    return [line.strip("|").split("|") for line in lines if line.startswith("|")][2:]


def test_one_symbol_has_one_meaning():
    symbols = [symbol.strip() for row in notation() for symbol in row[0].split(",")]
    assert len(symbols) > 40 and len(symbols) == len(set(symbols)), sorted(s for s in symbols if symbols.count(s) > 1)


def test_names_of_the_notation_are_those_of_the_code():
    source = "".join(p.read_text() for folder in ("common", "dem", "plate_fem", "analysis", "recognition", "report")
                     for p in (ROOT / folder).rglob("*") if p.suffix in (".py", ".cpp", ".h"))
    for _, code, *_ in notation():
        for name in re.findall(r"`(\w+)`", code):
            assert re.search(rf"\b{name}", source), name
