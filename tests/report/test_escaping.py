"""What stands in run.json or is the name of a directory is text in a page: it adds no element and no attribute."""

import json
from html.parser import HTMLParser

import numpy as np
import pytest

import report.comparison
import report.page
from report.comparison import Curve, compare, draw_curve
from report.drawing.style import to_uri
from tests.analysis.synthetic import write_run
from tests.report.synthetic_view import write_view

EVIL = "</script><script>alert(1)</script><!--<img src=x onerror=alert(1)>\"'>${7*7}{{7*7}}$\\frac{"
NAME = EVIL.replace("/", "|")  # of a directory
NEEDED = ("status", "materials", "model")  # values that say what a run is


class Elements(HTMLParser):
    """Elements of a page with the names of their attributes, and the text of each script."""

    def __init__(self, html):
        super().__init__(convert_charrefs=True)
        self.found, self.scripts = [], []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, sorted(name for name, _ in attrs)))
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data):
        if self.found and self.found[-1][0] == "script":
            self.scripts[-1] += data


def poisoned(value):
    if isinstance(value, dict):
        of_tables = any(isinstance(each, dict) for each in value.values())
        return {key: each if key in NEEDED else poisoned(each) for key, each in value.items()} | (
            {} if of_tables else {EVIL: EVIL})
    if isinstance(value, list):
        return [poisoned(each) for each in value]
    return value + EVIL if isinstance(value, str) else value


def poison(run):
    content = poisoned(json.loads((run / "run.json").read_text()))
    for table in ("versions", "seeds", "wall_time_s", "energy"):  # of one type each
        content[table].pop(EVIL)
    (run / "run.json").write_text(json.dumps(content))


@pytest.fixture(scope="module")
def sweeps(tmp_path_factory):
    """The same run in a sweep of a harmless name and in one that is poisoned; of neither is the scene the paper's."""
    here = tmp_path_factory.mktemp("escaping")
    for name in ("harmless", NAME):
        run = write_run(here / name / "ratio_050", 0.5)
        write_view(run)
        content = json.loads((run / "run.json").read_text())
        content["scene"]["name"] = "harmless"
        (run / "run.json").write_text(json.dumps(content))
    poison(here / NAME / "ratio_050")
    return here / "harmless", here / NAME


@pytest.mark.slow
def test_a_report_has_no_element_more(sweeps, monkeypatch):
    monkeypatch.setattr(report.page, "CHAPTERS", report.page.CHAPTERS[:1])  # drawing takes its time
    harmless, evil = (Elements(report.page.report(sweep).report.read_text()) for sweep in sweeps)
    assert evil.found == harmless.found
    films = [json.loads(script) for script in evil.scripts if '"bodies"' in script[:200]]
    assert [film["plate"]["rods"][0][EVIL] for film in films] == [EVIL]


def test_a_comparison_has_no_element_more(sweeps, tmp_path, monkeypatch):
    monkeypatch.setattr(report.comparison, "_figures", lambda *_: [("data:,", EVIL)])
    harmless, evil = sweeps
    pages = [compare(a, b, tmp_path / f"{k}.html").page for k, (a, b) in enumerate([sweeps, (evil, harmless)])]
    one, other = (Elements(page.read_text()) for page in pages)
    assert one.found == other.found and not {"script", "onerror"} & {word for tag, names in one.found
                                                                     for word in (tag, *names)}


def test_names_of_directories_in_pictures_are_no_formulas_and_are_shown():
    t_s = np.linspace(0, 1, 5)
    figure = draw_curve(Curve("force", t_s, t_s, t_s), ("_a$b$^{", "c$"))
    assert to_uri(figure, "curve") and len(figure.axes[0].get_legend().texts) == 2
