"""The chapter of the shipped rocks."""

import re

import pytest

from common.resources import resource
from common.scene import read_scene
from report.page import write_report
from report.results.rocks import ROCK_NAMES, fitted_properties, material, struck_rocks
from tests.analysis.synthetic import write_run


def test_kept_impacts_are_of_the_shipped_rocks():
    """`python -m benchmarks.rocks` makes them anew when a rock changes."""
    _, rocks = struck_rocks()
    assert {rock.name: rock.bond for rock in rocks} == {
        title: material(name)["bond"] for name, title in ROCK_NAMES.items()}


@pytest.mark.parametrize("name", ["coal", "gangue"])
def test_coal_and_gangue_are_those_of_the_paper_s_scene(name):
    bond = read_scene(resource("scenes") / "paper.toml").materials[name].bond
    assert material(name)["bond"].items() <= bond.model_dump().items()


def test_harder_rock_breaks_less():
    """At each speed, by the strengths of the sources; the slice holds no fragment that the stone does not have."""
    _, rocks = struck_rocks()
    soft, hard, gangue = (rock.impacts["broken_area_cm2"] for rock in rocks)
    assert (soft >= hard).all() and (hard >= gangue).all() and soft.iloc[-1] > hard.iloc[-1] > gangue.iloc[-1]
    assert len(set(rocks[0].slice["fragment"])) > 10 and set(rocks[1].slice["fragment"]) == {0}


def test_the_report_shows_strengths_with_their_sources(tmp_path):
    write_run(tmp_path / "paper" / "ratio_050", 0.5)
    html = write_report(tmp_path / "paper").read_text()
    assert re.search(r'<figure id="fig-rocks">.*?src="data:', html, re.DOTALL)
    cell = r"</td>\s*<td[^>]*>"
    row = ("gangue: uniaxial compressive strength, MPa", "34.5", "33.9 ± 2", "-1.8", "Adv. Civ. Eng. 2018[^<]*")
    assert re.search(cell.join(row), html)
    assert len(fitted_properties()) == 12 and "Shock Vib. 2021, 7649459" in html and "scene paper" not in html
