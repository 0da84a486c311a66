"""`gangue scenes`: the scenes that are shipped, and a copy of one to change."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from common.files.output_directory import refuse_file
from common.files.whole import write_text
from common.resources import resource
from common.result import Result
from common.tables import InputError

SCHEMA = "#:schema"  # begins a scene, and no plan of many

@dataclass(frozen=True)
class ScenesResult(Result):
    """What each shipped scene is, by its file, or the one that was copied, and where to."""

    scenes: Mapping[str, str]
    copy: Path | None = None

    def words(self) -> Iterator[str]:
        if self.copy is not None:
            yield str(self.copy)
            return
        for name, about in self.scenes.items():
            yield f"{name:<24} {about}"


def scenes(name: str | None = None, out: Path | None = None) -> ScenesResult:
    """List the shipped scenes, or copy one to the file `out`, by default its own name here. A base of a scene and
    materials are found wherever the copy is. Raises InputError."""
    shipped = {file.name: file for file in sorted(resource("scenes").glob("*.toml"))
               if file.read_text().startswith(SCHEMA)}
    about = {key: _first_comment(file) for key, file in shipped.items()}
    if name is None:
        if out is not None:
            raise InputError(f"--out = {out}: must be left out where no scene is named")
        return ScenesResult(about)
    key = name if name in shipped else f"{name}.toml"
    if key not in shipped:
        raise InputError(f"SCENE = {name!r}: must be one of {', '.join(shipped)}")
    copy = out or Path(key)
    refuse_file(str(copy), lambda _: False, ".toml")  # nothing is replaced
    write_text(copy, shipped[key].read_text())
    return ScenesResult({key: about[key]}, copy)


def _first_comment(file: Path) -> str:
    """The first sentence of the comment at the top of a scene."""
    lines = []
    for line in file.read_text().splitlines()[1:]:
        if not line.startswith("#"):
            break
        lines.append(line.lstrip("# "))
    return " ".join(lines).split(". ")[0].removesuffix(".")
