"""What the documentation shows works: its examples, its links, its notation."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest

from analysis import read_sweep
from common.scene.scene import read_scene
from dem.calibration import calibrate
from dem.calibration.virtual_tests import LoadHistory
from gangue.__main__ import main
from tests.analysis.synthetic import write_sweep

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("common", "dem", "plate_fem", "analysis", "recognition", "report", "gangue")
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
EXTENDING = (ROOT / "docs" / "extending.md").read_text()


def test_what_is_cited_has_the_version_of_the_project():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()


def blocks(kind, text=EXTENDING):
    return re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize("code", blocks("python"), ids=["feature", "sensor", "fusion", "figure"])
def test_examples_in_python(code, tmp_path, monkeypatch):
    assert "assert " in code  # each example says what comes of it
    monkeypatch.chdir(ROOT)
    names = {}
    if "runs" in code or "sweep" in code:
        names["sweep"] = read_sweep(write_sweep(tmp_path / "runs"))
        names["runs"] = names["sweep"].runs
    exec(compile(code, "docs/extending.md", "exec"), names)  # noqa: S102  our own page


@pytest.mark.slow
@pytest.mark.parametrize("page, number", [("plate", 0), ("from_python", 0), ("from_python", 1)])
def test_pages_run_as_they_stand(page, number, tmp_path, monkeypatch):
    """Scripts of other pages. `OUT` is where they write, `SWEEP` a sweep of the paper's scene."""
    monkeypatch.chdir(ROOT)
    names = {"OUT": tmp_path}
    code = blocks("python", (ROOT / "docs" / f"{page}.md").read_text())[number]
    if "SWEEP" in code:
        names["SWEEP"] = write_sweep(tmp_path / "runs")
    exec(compile(code, f"docs/{page}.md", "exec"), names)  # noqa: S102  our own page


def calibrate_at_once(monkeypatch, compressive_Pa, tensile_Pa):
    """Calibrations of few packings, with strengths that are met at once in place of the engine's."""
    def strength(work, *_):
        work.mkdir(parents=True, exist_ok=True)
        return LoadHistory(np.array([1.0]), np.array([compressive_Pa if work.name == "compression" else tensile_Pa]))

    for name, value in {"FIT_SEEDS": 2, "CHECK_SEEDS": 2, "check_engine": lambda: None,
                        "strength_test": strength}.items():
        monkeypatch.setattr(calibrate, name, value)


@pytest.mark.slow
def test_the_example_of_a_material(tmp_path, monkeypatch):
    """The calibration on few coarse packings."""
    sheet, scene = blocks("toml")
    (tmp_path / "sheet.toml").write_text(sheet)
    (tmp_path / "scene.toml").write_text(scene.replace("= 200", "= 60"))
    calibrate_at_once(monkeypatch, compressive_Pa=60e6, tensile_Pa=6e6)
    monkeypatch.chdir(ROOT)
    assert main(blocks("sh")[0].replace("OUT", str(tmp_path)).split()[1:]) == 0
    (tmp_path / "scene.toml").write_text(scene)
    found = read_scene(tmp_path / "scene.toml")
    gangue = found.materials["gangue"]
    assert (gangue.youngs_modulus_Pa, gangue.density_kg_m3) == (15e9, 2500.0)
    assert found.materials["gangue"].bond.friction_angle_deg == 35.0  # assumed, and said so
    assert found.materials["coal"] == read_scene(ROOT / "scenes" / "paper.toml").materials["coal"]


def engine_with_the_example(tmp_path):
    """A copy of the engine's sources with the fix, put in as the page says."""
    engine = tmp_path / "engine"
    shutil.copytree(ROOT / "dem" / "engine", engine)
    for code in blocks("cpp"):
        name, text = re.fullmatch(r"// (\S+)\n(.*)", code, re.DOTALL).groups()
        (engine / name).write_text(text)
    for file, old, new in [("main.cpp", '#include "record/fix_ledger.h"',
                            '#include "record/fix_ledger.h"\n#include "fix_top_speed.h"'),
                           ("main.cpp", 'styles["ledger"]', 'styles["top/speed"] = &create<FixTopSpeed>;\n  styles["ledger"]')]:
        text = (engine / file).read_text()
        assert text.count(old) == 1
        (engine / file).write_text(text.replace(old, new))
    return engine


def test_the_example_of_a_fix_is_compiled_where_the_page_puts_it(tmp_path):
    made = subprocess.run(["make", "-n", "-C", engine_with_the_example(tmp_path), f"BUILD={tmp_path / 'build'}"],
                          capture_output=True, text=True, check=True)
    assert "fix_top_speed.cpp" in made.stdout


@pytest.mark.validate
def test_the_example_of_a_fix(tmp_path):
    """Built into a copy of the engine; two spheres that fall freely have the speed that gravity gives them."""
    engine = engine_with_the_example(tmp_path)
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


def test_the_index_lists_every_page():
    index = (ROOT / "docs" / "index.md").read_text()
    for page in (ROOT / "docs").glob("*.md"):
        assert page.name == "index.md" or f"({page.name})" in index, page.name


@pytest.mark.parametrize("page", [p for p in PAGES if p.name != "CHANGELOG.md"], ids=lambda p: p.name)
def test_paths_that_a_page_names_exist(page):
    """In the text, not in examples; those of tests may leave out `tests/`."""
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL).replace("SCENE=scenes/x.toml", "")
    folders = "|".join((*PACKAGES, "lab", "scenes", "templates", "tests", "workflow"))
    for path in re.findall(rf"(?<![\w/])(?:{folders})/[\w/]+(?:\.\w+)+", text):
        assert (ROOT / path).exists() or (ROOT / "tests" / path).exists(), path


def notation(heading):
    """Rows of the table under a heading of docs/notation.md, without its head."""
    section = re.split(r"^## ", (ROOT / "docs" / "notation.md").read_text(), flags=re.MULTILINE)
    (table,) = [part for part in section if part.startswith(heading)]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines() if line.startswith("|")][2:]


def symbols():
    """Rows: symbol, code, unit, meaning."""
    return notation("Symbols")


def terms():
    """Rows: term, meaning, code."""
    return notation("Terms")


def test_one_symbol_has_one_meaning():
    names = [symbol.strip() for row in symbols() for symbol in row[0].split(",")]
    assert all(names) and len(names) > 40 and len(names) == len(set(names)), sorted(s for s in names if names.count(s) > 1)


def test_one_term_has_one_meaning_of_one_sentence():
    names = [name.strip() for term, _, _ in terms() for name in term.split(",")]
    assert len(names) > 30 and len(names) == len(set(names)), sorted(n for n in names if names.count(n) > 1)
    for term, meaning, _ in terms():
        assert re.fullmatch(r"[A-Z](?:[^.]|\.\w)*\.", meaning), term


def test_names_of_the_notation_are_those_of_the_code():
    source = "".join(p.read_text() for folder in PACKAGES
                     for p in (ROOT / folder).rglob("*") if p.suffix in (".py", ".cpp", ".h"))
    for code in [row[1] for row in symbols()] + [row[2] for row in terms()]:
        for name in re.findall(r"`(\w+)`", code):
            assert re.search(rf"\b{name}", source), name
