"""The pictures of docs/gallery.md from a directory of runs: `python docs/pictures/gallery.py RUNS`."""

import sys
from pathlib import Path

import matplotlib

from analysis import read_sweep
from report.chapters.mechanics import BREAKAGE, RESPONSE, THEORY
from report.chapters.signals import RECOGNITION, SIGNALS
from report.figures.style import STYLE
from report.study import Study

SHOWN = ("fig-7", "fig-10", "fig-laws", "fig-area-time", "fig-18", "fig-19", "fig-hilbert", "fig-23", "fig-33", "fig-38")
HERE = Path(__file__).parent

study = Study(read_sweep(sys.argv[1]))
for plan in (*THEORY, *BREAKAGE, *RESPONSE, *SIGNALS, *RECOGNITION):
    if plan.key in SHOWN:
        drawn = plan.draw(study)
        figure = drawn[0] if isinstance(drawn, tuple) else drawn
        with matplotlib.rc_context(STYLE):
            figure.savefig(HERE / f"{plan.key}.png", dpi=110, metadata={"Software": None})
        print(f"| ![{plan.title}](pictures/{plan.key}.png) | **{plan.title}.** {plan.caption} |")
