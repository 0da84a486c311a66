"""The pictures of docs/gallery.md from a directory of runs: `python -m lab.pictures.gallery RUNS`."""

import sys
from pathlib import Path

import matplotlib

from analysis import read_sweep
from report.drawing.style import STYLE, lay_out
from report.page import CHAPTERS
from report.sweep_results import SweepResults

SHOWN = ("fig-7", "fig-10", "fig-laws", "fig-area-time", "fig-18", "fig-19", "fig-hilbert", "fig-23", "fig-33",
         "fig-38")  # fmt: skip
PICTURES = Path(__file__).parents[2] / "docs" / "pictures"


def main(runs: str) -> None:
    """Write the pictures, and print their rows of the table in docs/gallery.md."""
    results = SweepResults(read_sweep(runs))
    specs = {spec.key: spec for _, figures, _ in CHAPTERS for spec in figures}
    for spec in map(specs.__getitem__, SHOWN):
        figure, _ = spec.drawn(results)
        with matplotlib.rc_context(STYLE):
            lay_out(figure)
            figure.savefig(PICTURES / f"{spec.key}.png", dpi=110, facecolor="white", metadata={"Software": None})
        print(f"| ![{spec.title}](pictures/{spec.key}.png) | **{spec.title}.** {spec.caption} |")


if __name__ == "__main__":
    main(sys.argv[1])
