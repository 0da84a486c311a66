"""The commands of `gangue`: where each is carried out, and examples of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Command:
    """`package` carries out the command by its own command line, under the name `word`; empty where it needs none.
    `examples` follow the help. `json`: can it give its result as JSON? `parser`: the function of the package's command
    line that returns the parser."""

    package: str
    word: str
    help: str
    examples: tuple[str, ...]
    json: bool = True
    parser: str = "_parser"


COMMANDS = {
    "run": Command("dem", "run", "simulate one scene", (
        "gangue run scenes/single.toml --gangue 1 --out runs/single",
        "gangue run scenes/paper.toml --set stones.speed_m_s=2.0 --set time.duration_s=0.04 --out runs/slow",
        "gangue --json run scenes/single.toml --out runs/single")),
    "resume": Command("dem", "resume", "go on with a run that was stopped or killed", (
        "gangue resume runs/single",)),
    "sweep": Command("dem", "sweep", "simulate a scene at every mixing ratio", (
        "gangue sweep scenes/paper.toml --out runs/paper --jobs 2",
        "gangue sweep scenes/paper.toml --set stones.count=6 --out runs/six")),
    "dataset": Command("dem", "dataset", "simulate what a plan draws, for recognition", (
        "gangue dataset scenes/dataset.toml --out runs/dataset",), json=False),
    "campaign": Command("dem", "campaign", "simulate every combination of values", (
        "gangue campaign scenes/campaign.toml --out runs/campaign --jobs 2",
        "gangue campaign scenes/campaign.toml --out runs/campaign --jobs 200 --profile slurm"), json=False),
    "deck": Command("dem", "deck", "write the LIGGGHTS deck of a scene and run nothing", (
        "gangue deck scenes/paper.toml --out runs/deck",)),
    "calibrate": Command("dem", "calibrate", "fit the bonds of a material in virtual tests", (
        "gangue calibrate coal --scene scenes/paper.toml --out scenes/materials",)),
    "build-engine": Command("dem", "build-engine", "build the engine", ("gangue build-engine",), json=False),
    "modes": Command("plate_fem", "modes", "natural frequencies of the plate of a scene", (
        "gangue modes scenes/paper.toml",
        "gangue modes scenes/paper.toml --out modes.vtu")),
    "features": Command("analysis", "features", "features of a run or of any record", (
        "gangue features runs/paper/ratio_030",
        'gangue features Messung.csv --column Beschleunigung --time "Zeit [ms]"',
        "gangue features hit.flac --scale 98.1 --unit m/s^2",
        "gangue --json features impact.mat --column acc/north")),
    "fit": Command("recognition", "fit", "fit a model of recognition to simulated runs", (
        "gangue fit runs/paper --out model.json",)),
    "recognise": Command("recognition", "recognise", "mixing ratio of a record", (
        "gangue recognise runs/other/ratio_040 --model model.json",
        "gangue recognise measured.csv --model model.json")),
    "evaluate": Command("recognition", "evaluate", "error of each method on runs it was not trained on", (
        "gangue evaluate runs/dataset",), json=False),
    "tap": Command("recognition", "tap", "learn a plate's modes from taps at known places", (
        "gangue tap scenes/paper.toml taps.toml --out plate.json",)),
    "check": Command("recognition", "check", "look for faults in the channels of a record", (
        "gangue check measured.csv --plate plate.json",), json=False),
    "listen": Command("recognition", "listen", "stones one by one, and the mixing ratio over time, from a stream", (
        "gangue listen stream.parquet --plate plate.json --out runs/heard",)),
    "volley": Command("recognition", "volley", "mixing ratio of stones that arrive at once on unknown places", (
        "gangue volley measured.csv --plate plate.json --stones 10",), json=False),
    "report": Command("report", "", "write report.html of a sweep", (
        "gangue report runs/paper",)),
    "compare": Command("report", "compare", "write a page of what differs between two runs or two sweeps", (
        "gangue compare runs/before runs/after",
        "gangue compare runs/before/ratio_030 runs/after/ratio_030 --out thirty.html"), parser="_compare_parser"),
}

#: Those of `gangue` itself.
OWN = {"doctor": "what this machine has and lacks", "completion": "completion of commands for a shell"}
