"""The whole report of synthetic runs and sweeps."""

import csv
import json
import re

import pytest

import report.page
from analysis import read_run, read_sweep
from common.files.output_directory import files_in, hash_of, refuse_replacing, write_contents
from common.resources import resource
from common.scene.scene import changed_scene
from common.tables import InputError
from report.page import are_papers, digits
from tests.analysis import synthetic
from tests.analysis.synthetic import write_run, write_sweep


@pytest.fixture(scope="module")
def papers(tmp_path_factory):
    """Report of an incomplete sweep that counts as the paper's: ratios are missing, one directory is no run."""
    path = write_sweep(tmp_path_factory.mktemp("some") / "paper", ratios=(0.0, 0.2, 0.5, 0.6, 0.8, 1.0))
    (path / "ratio_010").mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report.page, "are_papers", lambda runs: True)
        return report.page.report(path).report


def words_of(file):
    """What a reader sees of a page."""
    text = re.sub(r"<(script|style)\b.*?</\1>", "", file.read_text(), flags=re.DOTALL)
    return " ".join(re.sub(r"<[^>]*>", " ", text).split())


def test_report_holds_everything_inside(papers):
    html = papers.read_text()
    assert not re.search(r'(?:src|href)="(?!data:|#)', re.sub(r"<script>.*?</script>", "", html, flags=re.DOTALL))
    targets = re.findall(r'href="#([^"]+)"', html)
    assert set(targets) <= set(re.findall(r'id="([^"]+)"', html))
    for number in (7, 8, 9, 10, 13, 14, 15, 16, 17, 18, 19, 21, 22, 23, 24, 25, 26, 27, 28, 29, 33, 37, 38):
        assert f'id="fig-{number}"' in html
    # A rigid plate has no modes: its stress is not drawn, and that is said. Everything else is.
    (missing,) = re.findall(r'<p class="soft">(<span id="fig-.*): Not drawn:', html)  # one line, for one reason
    assert re.findall(r'<span id="([^"]+)">', missing) == ["fig-21", "fig-21-contact"]
    assert "No moving view: 0 % gangue: ratio_000: no view.pvd" in words_of(papers)
    assert html.count("<main>") == 1 and "<th></th>" not in html and not re.search(r"<summary[^>]*>\s*</", html)
    assert re.findall(r'<details id="([^"]+)" open', html) == ["chapter-1", "chapter-2"]


def test_report_of_an_incomplete_sweep_says_so(papers):
    assert "Missing: 10, 30, 40, 70, 90 %" in words_of(papers) and "Passed over" in words_of(papers)


@pytest.mark.slow
@pytest.mark.parametrize("paper", [True, False])
def test_a_run_alone_has_its_page_whatever_its_name_is(tmp_path, monkeypatch, paper):
    """What needs several ratios is left out; nothing is missing, and no range is of one value."""
    monkeypatch.setattr(report.page, "are_papers", lambda runs: paper)
    run = write_run(tmp_path / "mine", 0.5)
    summary = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps(summary | {"warnings": ["plate.thickness_m = 0.05: too thick"]}))
    page = report.page.report(run).report
    html, words = page.read_text(), words_of(page)
    assert "Warning plate.thickness_m = 0.05: too thick" in words
    assert page == run / "report.html" and 'id="fig-felt"' in html and 'id="fig-16"' in html
    assert not {"fig-19", "fig-15", "fig-24", "fig-answer"} & set(re.findall(r'id="([^"]+)"', html))
    peak_kN = 1e-3 * read_run(run).peak("force_N")
    assert f"{peak_kN:.3g} kN largest force on the plate" in words and "Missing" not in words
    assert "m/s² largest acceleration of the plate&#39;s centre of mass" in words
    assert not re.search(r"([\d.]+) to \1\b", words) and str(tmp_path) not in html
    assert not (run / "claims.csv").exists()  # trends are what the paper states


@pytest.mark.slow
def test_a_report_in_a_run_does_not_keep_the_run_from_being_replaced(tmp_path):
    run = write_run(tmp_path / "mine", 0.5)
    write_contents(run, "run", {name: hash_of(run / name) for name in files_in(run)})
    report.page.report(run)
    refuse_replacing(run, "run")  # raises for a file that is not of the run:
    (run / "mine.txt").write_text("")
    with pytest.raises(InputError, match=r"mine\.txt, which this program did not write"):
        refuse_replacing(run, "run")


PAPER = resource("scenes") / "paper.toml"


@pytest.mark.parametrize(("changes", "same"), [
    ({"name": "mine", "stones.gangue_ratio": 0.2, "stones.seed": 5, "plate.sensors": [], "time.duration_s": 0.1,
      "time.view_interval_s": None}, True),
    ({"plate.tilt_deg": 20.0}, False), ({"materials.gangue.density_kg_m3": 2600.0}, False),
    ({"stones.speed_m_s": 2.0}, False), ({"plate.thickness_m": 0.016}, False),
    ({"contacts.coal_plate.restitution": 0.5}, False)])
def test_a_scene_is_the_papers_by_its_physics_and_not_by_its_name(tmp_path, monkeypatch, changes, same):
    monkeypatch.setattr(synthetic, "SCENE", changed_scene(PAPER, changes).model_dump(mode="json"))
    assert are_papers([read_run(write_run(tmp_path / "ratio_050", 0.5))]) == same


#: What is true of the paper's scene and its runs, and of no other.
KEPT = re.compile(r"paper|scoreboard|Yang|statements|soft coal|0\.99079|Table \d|Figure \d|Fig\. \d", re.I)


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{"thickness_m": 0.01}, {"tilt_deg": 20.0}])
def test_a_page_of_another_scene_holds_no_kept_value(tmp_path, monkeypatch, changes):
    scene = synthetic.SCENE | {"plate": synthetic.SCENE["plate"] | changes}
    monkeypatch.setattr(synthetic, "SCENE", scene)  # whose name is the paper's
    page = report.page.report(write_sweep(tmp_path / "mine", ratios=(0.0, 0.5, 1.0))).report
    said = words_of(page).partition("Assumed by the scene")[0]  # which comes from the runs
    assert KEPT.findall(said) == [] and not (page.parent / "claims.csv").exists()


def test_ratios_that_stones_cannot_give_are_not_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(synthetic.SCENE["stones"], "count", 2)
    path = write_sweep(tmp_path / "two", ratios=(0.0, 0.5))
    assert read_sweep(path).missing == [1.0]
    (tmp_path / "plan.csv").write_text("place,np,scene,stones.gangue_ratio\ntwo/ratio_000,1,x,0.0\n"
                                       "two/ratio_025,1,x,0.25\nother/ratio_100,1,x,1.0\n")
    assert read_sweep(path).missing == [0.25]  # of a campaign


def test_claims_table_is_beside_the_report(papers):
    *rows, _ = csv.reader(papers.with_name("claims.csv").open())  # the last line holds the hash
    assert rows[0] == ["claim", "where", "verdict", "value", "expected"]
    assert len(rows) > 25 + 1
    assert {row[2] for row in rows[1:]} <= {"held", "partly", "not held", "not tested"}
    verdict = {row[0]: row[2] for row in rows[1:]}
    # What the synthetic runs are made to be: forces by the ratio, coal breaking more, one area for each.
    assert verdict["The largest total contact force rises with the ratio"] == "held"
    assert verdict["After the first collision one coal is broken much more than one gangue"] == "held"
    assert verdict["The broken area of a single coal or gangue does not change with the ratio"] == "held"
    assert verdict["The total broken area rises as the ratio falls (Conclusion 1 says the reverse)"] == "held"
    assert verdict["The overall stress under the particles rises with the ratio"] == "not tested"


@pytest.mark.parametrize(("value", "said"), [(1326.4, "1330"), (85.12, "85.1"), (0.0321, "0.0321"), (51234.0, "51200")])
def test_a_number_of_the_first_screen_has_no_exponent(value, said):
    assert digits(value) == said
