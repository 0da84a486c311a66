"""What a command answers: one small object, of which words, JSON and exit code only say what it holds."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from math import isfinite
from typing import Any

NO_ANSWER = ("refused", "not_explained", "out_of_distribution")  # why a record has no answer to be trusted


class Result:
    """Answer of a command, to be a frozen dataclass with units in the names of its fields."""

    line = ""  # the words, with {fields}

    @property
    def exit_code(self) -> int:
        """3 where a field of NO_ANSWER says why, 1 where a field `failed` does, else 0."""
        if any(getattr(self, name, None) for name in NO_ANSWER):
            return 3
        return 1 if getattr(self, "failed", None) else 0

    def words(self) -> Iterator[str]:
        """The lines that a terminal shows. All that they say stands in the fields."""
        yield from self.line.format(**vars(self)).split("\n")

    def as_json(self) -> Any:
        """The fields by name, of what JSON knows: a number that is not finite is null, a path is text."""
        return plain(self)


def plain(value: Any) -> Any:
    """Numbers, texts, lists and objects by name of what dataclasses, arrays and paths hold."""
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if hasattr(value, "tolist"):  # of numpy
        return plain(value.tolist())
    if isinstance(value, float):
        return value if isfinite(value) else None
    return value if value is None or isinstance(value, str | int) else str(value)
