"""The whole report of synthetic sweeps."""

import csv
import re

import pytest

from report.page import write_report
from tests.analysis import synthetic
from tests.analysis.synthetic import write_run, write_sweep


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """Of an incomplete sweep: some ratios are missing, one directory is no run."""
    path = write_sweep(tmp_path_factory.mktemp("some") / "paper", ratios=(0.0, 0.2, 0.5, 0.6, 0.8, 1.0))
    (path / "ratio_010").mkdir()
    return write_report(path)


def test_report_holds_everything_inside(report):
    html = report.read_text()
    assert not re.search(r'(?:src|href)="(?!data:|#)', re.sub(r"<script>.*?</script>", "", html, flags=re.DOTALL))
    targets = re.findall(r'href="#([^"]+)"', html)
    assert set(targets) <= set(re.findall(r'id="([^"]+)"', html))
    for number in (7, 8, 9, 10, 13, 14, 15, 16, 17, 18, 19, 21, 22, 23, 24, 25, 26, 27, 28, 29, 33, 37, 38):
        assert f'id="fig-{number}"' in html
    assert "Figure 11 is not at hand" in html and "table-2" in html
    # A rigid plate has no modes: its stress is not drawn, and that is said. Everything else is.
    not_drawn = re.findall(r'<figure id="([^"]+)">(?:(?!</figure>).)*Not drawn:', html, re.DOTALL)
    assert not_drawn == ["fig-21", "fig-21-contact"]
    assert "No moving view: 50 %: ratio_050: no view.pvd" in html


def test_report_of_an_incomplete_sweep_says_so(report):
    html = report.read_text()
    assert re.search(r"Missing:\s+10, 30, 40, 70, 90", html)
    assert "Passed over" in html


def test_report_of_one_run_says_what_it_cannot_give(tmp_path):
    write_run(tmp_path / "paper" / "ratio_050", 0.5)
    report = write_report(tmp_path / "paper")
    html = report.read_text()
    assert "needs at least 4 different mixing ratios" in html
    assert "Not given:" in html and 'src="data:' in html
    assert set(re.findall(r'href="#([^"]+)"', html)) <= set(re.findall(r'id="([^"]+)"', html))
    assert str(tmp_path) not in html + report.with_name("claims.csv").read_text()
    assert ",not tested," in report.with_name("claims.csv").read_text()


def test_claims_table_is_beside_the_report(report):
    *rows, _ = csv.reader(report.with_name("claims.csv").open())  # the last line holds the hash
    assert rows[0] == ["claim", "where", "verdict", "value", "expected"]
    assert len(rows) > 25 + 1
    assert {row[2] for row in rows[1:]} <= {"held", "partly", "not held", "not tested"}
    verdict = {row[0]: row[2] for row in rows[1:]}
    # What the synthetic runs are made to be: forces by the ratio, coal breaking more, one area for each.
    assert verdict["The largest total contact force rises with the ratio"] == "held"
    assert verdict["After the first collision one coal is broken much more than one gangue"] == "held"
    assert verdict["The broken area of a single coal or gangue does not change with the ratio"] == "held"
    assert verdict["The totally broken area increases with the ratio (against Fig. 15)"] == "not held"
    assert verdict["The overall stress under the particles rises with the ratio"] == "not tested"


def test_only_the_papers_scene_is_compared_with_the_paper(tmp_path, monkeypatch):
    monkeypatch.setitem(synthetic.SCENE, "name", "mine")
    write_run(tmp_path / "ratio_050", 0.5)
    html = write_report(tmp_path).read_text()
    assert "scoreboard" not in re.sub(r"<(script|style)>.*?</\1>", "", html, flags=re.DOTALL)
    assert "statements of the paper" not in html and not (tmp_path / "claims.csv").exists()
