"""The README's picture and animation, taken from the view of a report: `python -m lab.pictures.film RUNS`.

Needs RUNS/report.html with a moving view, Debian's chromium, and the extra `browser`.
"""

import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from lab.pictures.gallery import PICTURES

FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PICTURE, ANIMATION = "impact.png", "impact.webp"
FRAMES, FRAME_ms, MOST_BYTES = 60, 80, 3_000_000
#: Nothing of the page but the view and its curves.
ALONE = """
.controls, .view .zoom, .keys, #film > .soft, #film > details { display: none !important }
.first { display: block }
#film { position: fixed; inset: 0; z-index: 9; background: #fff }
.view { border-radius: 0; margin: 0 }
.curves { padding: .4rem .8rem }
"""


def main(runs: str) -> None:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        write_picture(open_view(chromium, runs, width=1440))
        write_animation(open_view(chromium, runs, width=720))


def open_view(chromium, runs, width):
    """Open the report at a width where nothing but its view is left."""
    page = chromium.new_page(viewport={"width": width, "height": width})
    page.goto((Path(runs).resolve() / "report.html").as_uri())
    page.wait_for_selector("#film.live", timeout=120_000)
    page.add_style_tag(content=ALONE)
    page.wait_for_timeout(500)
    return page


def at(page, time_s):
    page.evaluate("t => { film.player.seek(t); film.player.labelled = 0; }", time_s)
    page.wait_for_function("!film.player.dirty")


def write_picture(page):
    at(page, page.evaluate("film.player.momentOfLargestForce()"))
    page.locator(".view").screenshot(path=PICTURES / PICTURE)
    Image.open(PICTURES / PICTURE).convert("P", palette=Image.Palette.ADAPTIVE).save(PICTURES / PICTURE, optimize=True)
    print(f"{PICTURE}: {(PICTURES / PICTURE).stat().st_size / 1e3:.0f} kB")


def write_animation(page):
    """The impact with its curves, FRAMES pictures of it."""
    end_s = page.evaluate("film.player.series.end")
    bottom = page.evaluate("Math.ceil(document.querySelector('.curves').getBoundingClientRect().bottom)")
    box = {"x": 0, "y": 0, "width": 720, "height": bottom + 8}
    pictures = []
    for k in range(FRAMES):
        at(page, end_s * k / (FRAMES - 1))
        pictures.append(Image.open(io.BytesIO(page.screenshot(clip=box))).convert("RGB"))
    for quality in (75, 60, 45, 30):
        pictures[0].save(PICTURES / ANIMATION, save_all=True, append_images=pictures[1:], duration=FRAME_ms, loop=0,
                         quality=quality, method=4)  # fmt: skip
        if (PICTURES / ANIMATION).stat().st_size < MOST_BYTES:
            break
    print(f"{ANIMATION}: {(PICTURES / ANIMATION).stat().st_size / 1e3:.0f} kB, {FRAMES} pictures of {1e3 * end_s:g} ms")


if __name__ == "__main__":
    main(sys.argv[1])
