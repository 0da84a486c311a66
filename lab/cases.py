"""The cases of the laboratory: what each varies, against what it is measured, and of which sources its result speaks.

A case NAME of a module has a function `rows(out, **options)` there, called NAME, and, where the result is not the rows
themselves, `NAME_table(rows, out)`; `NAME_holds(rows)` where the case can fail. Its result is lab/results/NAME.csv.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

STONE = ("dem/engine", "dem/deck", "dem/stones", "templates/deck.liggghts.j2", "scenes/single.toml",
         "scenes/paper.toml", "lab/rock/stone.py")
PLATE = (*STONE, "dem/coupling", "plate_fem")
TAPPED = ("recognition/plate", "recognition/tapping", "lab/known_truth")
HEARD = (*TAPPED, "recognition/stone_forces", "recognition/innovations", "recognition/stream",
         "lab/streams/known_streams.py")
METHODS = ("recognition/paper", "recognition/physics", "recognition/regression", "recognition/estimation",
           "recognition/methods.py", "recognition/models.py")


@dataclass(frozen=True)
class Case:
    """A row of the table."""

    name: str
    module: str
    varies: str
    against: str
    speaks_of: tuple[str, ...]

    @property
    def sources(self) -> tuple[str, ...]:
        """Files and folders of the checkout, the case's own among them."""
        return (*self.speaks_of, f"{self.module.replace('.', '/')}.py")

    def load(self, what: str) -> Callable[..., Any]:
        """`rows`, `table` or `holds`."""
        functions = vars(import_module(self.module))
        if what == "rows":
            return functions[self.name]
        otherwise: dict[str, Callable[..., Any]] = {"table": lambda rows, out: rows, "holds": lambda rows: True}
        return functions.get(f"{self.name}_{what}", otherwise[what])


CASES = {case.name: case for case in (
    Case("work_precision", "lab.accuracy.work_precision", "each numerical setting", "a far finer value of it", PLATE),
    Case("tolerance", "lab.accuracy.tolerance", "tolerance of a scene", "a finer run", (*PLATE, "common/scene/error_laws.toml")),
    Case("omissions", "lab.accuracy.omissions", "parts of a scene left out", "the cost of the whole scene", PLATE),
    Case("emd_rules", "lab.accuracy.emd_rules", "stopping rule of EMD and length of the record", "known modes",
         ("analysis/signals",)),
    Case("cut_off", "lab.accuracy.cut_off", "cut-off of the plate's modes, with and without an anti-alias filter",
         "a higher one", PLATE),
    Case("free_flight", "lab.accuracy.free_flight", "free flight of bodies", "brute force", PLATE),
    Case("stability", "lab.accuracy.stability", "every quantity to its extremes",
         "a closed ledger, or a refusal that names a limit", (*PLATE, "lab/accuracy/stability_scenes.py")),
    Case("breakage_mesh", "lab.rock.impacts", "number of sub-spheres of a coal with flaws, and speed", "one another",
         (*STONE, "scenes/materials/soft_coal.toml")),
    Case("critical_speed", "lab.rock.impacts", "rock and size of a stone, until it falls apart", "the product's formula",
         (*STONE, "scenes/materials")),
    Case("calibration", "lab.rock.calibration", "rock", "laboratory tables", ("scenes/materials",)),
    Case("crack_area", "lab.rock.crack_area", "fracture energy of the bonds", "area and work of a plane crack",
         (*STONE, "dem/calibration", "scenes/materials/coal.toml")),
    Case("contact", "lab.rock.contact", "sub-spheres, rock, speed and plate", "an elastic sphere", PLATE),
    Case("faces", "lab.rock.faces", "attitude of a cube and a disc", "an elastic solid of finite elements, closed forms",
         (*STONE, "lab/rock/elastic_solid.py")),
    Case("two_stones", "lab.rock.two_stones", "sub-spheres of two stones that meet", "Hertz' elastic spheres", STONE),
    Case("two_cubes", "lab.rock.two_stones", "sub-spheres of two cubes that meet face on face", "an elastic solid",
         (*STONE, "lab/rock/faces.py", "lab/rock/elastic_solid.py")),
    Case("codes", "lab.speed.codes", "program, on the same agglomerate", "stock LIGGGHTS with Hertz contacts",
         ("dem/engine", "lab/speed/benchmark.liggghts.j2")),
    Case("scaling", "lab.speed.scaling", "stones and sub-spheres, one rank or two", "one another", STONE),
    Case("stream_cost", "lab.speed.stream", "stones of a stream and their rate", "stones alone",
         (*STONE, "scenes/stream.toml")),
    Case("tapping", "lab.plate.tapping", "plate, number of taps, known forces", "the true modes", TAPPED),
    Case("listening", "lab.streams.listening", "rate, sizes, sensors; forces held out", "the true ratio", HEARD),
    Case("listening_limits", "lab.streams.listening", "rate and plate; forces of the limits", "the true ratio", HEARD),
    Case("listening_noise", "lab.streams.listening", "noise of a machine, and faults in it", "the true ratio", HEARD),
    Case("natural_streams", "lab.streams.natural", "what one knows of a hundred stones that vary", "the true ratio",
         (*HEARD, "lab/recognition/superposed.py", "scenes/natural.toml")),
    Case("engine_streams", "lab.streams.engine_streams", "streams of the engine, ratio, and what one knows", "what touched the plate",
         (*HEARD, *STONE, "gangue/learn_forces.py", *(f"scenes/{name}.toml" for name in ("listening", "stream", "streams", "caving", "natural")))),
    Case("stopping", "lab.streams.stopping", "share of gangue over time, stones and what one knows of them",
         "a perfect ear", ("recognition/stone_forces", "recognition/stream", "lab/streams/stone_kinds.py")),
    Case("stone_kinds", "lab.streams.stone_kinds", "stones of a stream, and what one knows of them", "the true ratio",
         ("recognition/stone_forces", "recognition/stream", "lab/known_truth/data")),
    Case("volleys", "lab.streams.volleys", "runs, on tapped plates", "the true ratio", (*HEARD, "recognition/volley")),
    Case("volley_shares", "lab.streams.volleys", "impulse of stones in m v", "one another", STONE),
    Case("anti_alias", "lab.recognition.anti_alias", "filter before the samples of the paper's runs", "samples without it",
         (*METHODS, "analysis/signals", "report")),
    Case("recognise_families", "lab.recognition.evaluation", "how much stones differ, 44 runs a family", "the true ratio",
         (*METHODS, "recognition/evaluation.py", "scenes/dataset.toml", "lab/recognition/superposed.py",
          "lab/recognition/baselines.py")),
    Case("model_errors", "lab.recognition.model_errors", "what the plate's model leaves of a blow", "the true ratio",
         (*METHODS, *TAPPED, "lab/recognition/superposed.py")),
    Case("real_records", "lab.real.records", "balls, hammer hits, a ramp that others measured", "what was struck",
         ("analysis/signals/features.py", "recognition/stone_forces", "recognition/tapping")),
    Case("stone_forces", "lab.streams.stone_forces", "rock, size, speed and place of a stone",
         "the law of forces that is learnt", (*STONE, "recognition/stone_forces/forces.py")),
    Case("rod_joint", "lab.plate.rod_joint", "radius and modulus of a rod, Poisson's ratio", "plate and beam theory", ()),
    Case("solid_plate", "lab.plate.solid_plate", "symmetry of the plate as a solid", "CalculiX",
         ("tests/plate_fem/solid.py",)),
    Case("solids", "lab.plate.solids", "plate on rods", "CalculiX", ("plate_fem", "tests/plate_fem/solid.py")),
)}
