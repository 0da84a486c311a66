"""The page in a real Chromium: it moves, it fits, it is whole in itself. Screenshots go to build/screenshots."""

import gzip
import io
import re
import shutil
from base64 import b64decode
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import report.page
from analysis import read_run
from analysis.sweep.breakage import broken_bonds, damage, fragment_shares
from tests.analysis.synthetic import write_sweep
from tests.report.synthetic_view import T_S, centre_m, write_view

pytestmark = pytest.mark.slow
SCREENSHOTS = Path(__file__).resolve().parents[2] / "build" / "screenshots"
#: WebGL on the processor alone, as on a machine without a graphics card.
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
WIDTHS = pytest.mark.parametrize("width", [1200, 390])


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """Directory of a sweep with pictures that counts as the paper's, its report, and sub-spheres of the 50 % run."""
    path = write_sweep(tmp_path_factory.mktemp("browser") / "paper", ratios=(0.0, 0.2, 0.5, 1.0))
    networks = {ratio: write_view(path / f"ratio_{ratio}") for ratio in ("020", "050")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report.page, "are_papers", lambda runs: True)
        return path, report.page.report(path).report, networks["050"]


@pytest.fixture(scope="module")
def chromium():
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        pytest.fail("the test of the page needs Playwright: pip install -e '.[browser]'")
    program = shutil.which("chromium")
    if program is None:
        pytest.fail("the test of the page needs Debian's chromium: make build/chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def opened(chromium, sweep):
    """Open the report at a width; at the end nothing may have gone wrong and nothing may have been asked for."""
    contexts, wrong = [], []

    def open_at(width, **options):
        page = page_at(chromium, sweep[1].as_uri(), wrong, width, **options)
        contexts.append(page.context)
        return page

    yield open_at
    for context in contexts:
        context.close()
    assert wrong == []


@pytest.fixture(scope="module")
def wide_page(chromium, sweep):
    """The report at 1200 pixels, which takes seconds to open, and what went wrong in it."""
    wrong = []
    page = live(page_at(chromium, sweep[1].as_uri(), wrong, 1200))
    yield page, wrong
    page.context.close()


@pytest.fixture
def page(wide_page):
    """The same page for all that leave it usable to the next."""
    page, wrong = wide_page
    yield page
    assert wrong == []


def page_at(chromium, uri, wrong, width, **options):
    def inside(url):
        return url == uri or url.startswith(("data:", "blob:"))

    page = chromium.new_context(viewport={"width": width, "height": 800}, **options).new_page()
    page.set_default_timeout(180_000)  # of a busy machine
    page.on("console", lambda message: wrong.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: wrong.append(request.url) if not inside(request.url) else None)
    page.goto(uri)
    return page


def live(page):
    page.wait_for_selector("#film.live", timeout=20_000)
    page.wait_for_function("!film.player.dirty")
    return page


def picture(page):
    """What the view shows, as its PNG."""
    page.wait_for_function("!film.player.dirty")
    return page.locator("[data-film=canvas]").screenshot()


def move_slider(page, value):
    page.locator("[data-film=slider]").evaluate(
        "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }", value
    )
    page.wait_for_function("!film.player.dirty")


@WIDTHS
def test_slider_and_choices_change_the_picture(opened, width):
    page = live(opened(width))
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    move_slider(page, 0)
    assert page.locator("[data-film=time]").inner_text() == "0.00 ms"
    start, cursor = picture(page), page.locator(".cursor").first.get_attribute("style")
    move_slider(page, 500)
    assert page.locator("[data-film=time]").inner_text() == "0.60 ms"
    assert picture(page) != start and page.locator(".cursor").first.get_attribute("style") != cursor
    seen = {picture(page)}
    for name, choice in (("colours", "damage"), ("colours", "fragment"), ("series", "early"), ("reel", "film-1")):
        page.locator(f"[data-film={name}]").select_option(choice)
        if name == "reel":  # it is read when it is first asked for
            page.wait_for_function("film.player.reels.size == 2")
            assert page.locator("[data-film=series] option").all_inner_texts() == ["impact", "whole run"]
        seen.add(picture(page))
    assert len(seen) == 5
    page.screenshot(path=SCREENSHOTS / f"report_{width}.png")


def test_it_plays_to_the_end_and_pauses(page):
    move_slider(page, 0)
    page.evaluate("film.PLAY_SECONDS.impact = 0.5")
    page.locator("[data-film=play]").click()
    assert page.locator("[data-film=play]").inner_text() == "Pause"
    page.wait_for_function("!film.player.playing", timeout=20_000)
    assert page.locator("[data-film=time]").inner_text() == "1.20 ms"
    assert page.locator("[data-film=play]").inner_text() == "Play"


def test_the_page_unpacks_what_was_packed(page, sweep):
    """Positions by closed form; damage and fragments as the analysis finds them."""
    path, _, network = sweep
    k = 37
    shown = np.array(page.evaluate(f"Array.from(film.player.reel.series.impact.position[{k}])")).reshape(-1, 3)
    assert np.abs(2e-5 * shown - centre_m(network, T_S[k])).max() <= 1.01e-5
    until_s = 1.9e-4
    broken = broken_bonds(read_run(path / "ratio_050"), network, until_s)
    assert broken.any() and not broken.all()
    of_page = page.evaluate(f"Array.from(film.damage(film.player.reel, {until_s}))")
    assert of_page == pytest.approx(damage(network, broken), abs=1e-6)
    pieces = sum(shares.size for shares in fragment_shares(network, broken))
    assert page.evaluate(f"film.fragments(film.player.reel, {until_s}).count") == pieces


@WIDTHS
def test_nothing_is_cut_at_any_width(opened, width):
    page = live(opened(width))
    page.evaluate("document.querySelectorAll('details').forEach((d) => (d.open = true))")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    cut = page.evaluate(
        """(width) => [...document.querySelectorAll("td, th, img, svg, button, select")]
             .filter((e) => e.getBoundingClientRect().right > width + 1 && e.offsetParent)
             .map((e) => e.outerHTML.slice(0, 80))""",
        width,
    )
    if width < 500:
        assert cut == []


def test_scoreboard_is_folded_and_filtered(page):
    rows = page.locator("tr[data-row]")
    assert not rows.first.is_visible()
    page.locator("#scoreboard summary").click()
    held = page.locator("tr[data-row=held]").count()
    visible = page.locator("tr[data-row]:visible").count()
    assert 0 < held < visible == rows.count()
    page.locator("[data-verdict=held]").click()
    assert page.locator("tr[data-row]:visible").count() == visible - held
    page.locator("#scoreboard input").fill("kurtosis")
    assert page.locator("tr[data-row]:visible").count() <= 1


def test_figures_are_saved_as_svg_and_csv(page, sweep):
    with page.expect_download() as saved:
        page.locator("[data-svg=fig-16]").click()
    assert saved.value.suggested_filename == "fig-16.svg"
    assert "<svg" in Path(saved.value.path()).read_text()
    with page.expect_download() as saved:
        page.locator("[data-csv=fig-16]").click()
    table = pd.read_csv(saved.value.path(), comment="#")
    assert list(table.columns) == ["panel", "series", "x", "y", "value"]
    curve = table[(table["panel"] == "b: velocity, m/s") & (table["series"] == "50 %")]
    run = read_run(sweep[0] / "ratio_050")
    assert curve["x"].to_numpy() == pytest.approx(1e3 * run.t_s[: len(curve)], rel=1e-4)
    assert curve["y"].to_numpy() == pytest.approx(run.signals["v_m_s"].to_numpy()[: len(curve)], rel=1e-4, abs=1e-9)


def test_every_figure_carries_its_data(sweep):
    html = sweep[1].read_text()
    drawn = re.findall(r'data-svg="([^"]+)"', html)
    assert len(drawn) > 25
    for key in drawn:
        packed = re.search(rf'id="data-{key}">([^<]+)<', html).group(1).strip()
        text = gzip.decompress(b64decode(packed)).decode()
        assert key == "fig-7" or len(pd.read_csv(io.StringIO(text), comment="#")) > 0, key


def test_a_still_picture_without_scripts_and_in_print(opened, page):
    without = opened(1200, java_script_enabled=False)
    assert without.locator(".view img").is_visible() and not without.locator(".controls").is_visible()
    assert not page.locator(".view img").is_visible()
    page.emulate_media(media="print")
    assert page.locator(".view img").is_visible() and not page.locator(".controls").is_visible()
    page.emulate_media(media="screen")


def test_corners_of_any_plate_are_inside_the_view(page):
    """Projected by the page's own camera, at its first look and at both shapes of the view."""
    outside = page.evaluate("""() => {
      const found = [];
      for (const tilt of [0, 20, 35]) for (const [length, width] of [[0.3, 0.3], [0.5, 0.5], [1.5, 1.0], [0.4, 1.5]])
      for (const aspect of [9 / 5.6, 1 / 0.72]) for (const rods of [[], [{ place_m: [0, 0], length_m: 0.3 }]]) {
        const plate = { size: [length, width], thickness: 0.02, rods, walls: [], tilt: tilt * Math.PI / 180 };
        const { view, projection } = film.camera(plate, film.VIEW, aspect);
        const times = (m, v) => [0, 1, 2, 3].map((r) => v.reduce((sum, x, c) => sum + m[4 * c + r] * x, 0));
        let widest = 0;
        for (const x of [-0.5, 0.5]) for (const y of [-0.5, 0.5]) for (const z of [0, -0.02]) {
          const [a, b, , w] = times(projection, times(view, [x * length, y * width, z, 1]));
          widest = Math.max(widest, Math.abs(a / w), Math.abs(b / w), w > 0 ? 0 : 9);
        }
        if (widest > 1 || widest < 0.4) found.push([tilt, length, width, aspect, widest]);
      }
      return found;
    }""")
    assert outside == []


def test_the_plate_leans_as_it_is_tilted(page):
    """It falls off towards +x, so that this edge is lower on the screen, and the drawn corners are there."""
    heights = page.evaluate("""() => [0, 0.6].map((tilt) => {
      const plate = { size: [0.5, 0.5], thickness: 0.02, rods: [], walls: [], tilt };
      const { view } = film.camera(plate, { azimuth: -Math.PI / 2, height: 0, zoom: 1 }, 1.6);
      return [-0.25, 0.25].map((x) => view[1] * x + view[13]);
    })""")
    assert heights[0][0] == pytest.approx(heights[0][1], abs=1e-12)
    assert heights[1][0] - heights[1][1] == pytest.approx(0.5 * np.sin(0.6), rel=1e-9)


def test_values_stand_under_the_pointer_and_a_stretch_is_zoomed(page, sweep):
    plot = page.locator("[data-plot=fig-18]")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    panel = page.evaluate("plots.all.find((p) => p.root.dataset.plot === 'fig-18').panels[0]")
    left, top, width, height = panel["box"]

    def at(share):
        return box["x"] + box["width"] * (left + share * width), box["y"] + box["height"] * (top + 0.5 * height)

    run = read_run(sweep[0] / "ratio_050")
    force_kN = 1e-3 * run.fast["force_N"].to_numpy()
    k = int(np.argmax(force_kN[run.fast["t_s"] < 1e-3]))
    t_ms = 1e3 * run.fast["t_s"].iloc[k]
    page.mouse.move(*at((t_ms - panel["x"][0]) / (panel["x"][1] - panel["x"][0])))
    page.wait_for_selector("[data-plot=fig-18] output:not([hidden])")
    shown = dict(line.split(": ") for line in plot.locator("output span").all_inner_texts())
    assert float(shown["50 %"]) == pytest.approx(force_kN[k], rel=0.02)
    page.mouse.move(*at(0.2))
    page.mouse.down()
    page.mouse.move(*at(0.6), steps=4)
    page.mouse.up()
    page.wait_for_selector("[data-plot=fig-18] .zoomed")
    ends = [float(plot.locator(f".zoomed .{name}").inner_text()) for name in ("x0", "x1")]
    span = panel["x"][1] - panel["x"][0]
    assert ends == pytest.approx([panel["x"][0] + share * span for share in (0.2, 0.6)], abs=0.01 * span)
    page.mouse.dblclick(*at(0.5))
    page.wait_for_selector("[data-plot=fig-18] .zoomed", state="detached")


def test_text_is_large_enough_on_a_phone(opened):
    page = live(opened(390))
    page.evaluate("document.querySelectorAll('details').forEach((d) => (d.open = true))")
    smallest = page.evaluate("""async () => {
      let least = 99;
      for (const e of document.querySelectorAll("body *")) {
        if (e.offsetParent && [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim())) {
          least = Math.min(least, parseFloat(getComputedStyle(e).fontSize));
        }
      }
      for (const image of document.querySelectorAll(".plot img")) {
        const svg = new DOMParser().parseFromString(atob(image.src.split(",")[1]), "image/svg+xml").documentElement;
        const scale = image.getBoundingClientRect().width / svg.viewBox.baseVal.width;
        for (const text of svg.querySelectorAll("text, tspan")) {
          const size = /(?:^|\\s)([\\d.]+)px/.exec(text.getAttribute("style") || "");
          if (size && text.textContent.trim()) least = Math.min(least, size[1] * scale);
        }
      }
      return least;
    }""")
    assert smallest >= 9


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_is_dark_where_the_system_is(opened, scheme):
    page = live(opened(390, color_scheme=scheme))
    ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", ground)[:3])) < 200) == (scheme == "dark")
    coal, view = page.evaluate("""() => [document.querySelector("[data-key=material] .swatch"),
      document.querySelector(".view")].map((e) => getComputedStyle(e).backgroundColor.match(/\\d+/g).map(Number))""")
    assert coal == page.evaluate("film.MATERIALS[0]")
    assert abs(sum(coal) - sum(view)) > 3 * 100  # of 255: coal is seen before what is behind it
    page.screenshot(path=SCREENSHOTS / f"report_390_{scheme}.png", full_page=True)


def test_no_path_of_this_machine(sweep):
    html = sweep[1].read_text()
    assert str(sweep[0].parent) not in html and str(Path(__file__).resolve().parents[2]) not in html
