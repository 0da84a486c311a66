"""What all pages of the report are made by: templates, and tables as text between commas."""

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import jinja2

from common.resources import resource


def rendered(template: str, filters: Mapping[str, Callable[[Any], Any]], **content: Any) -> str:
    """A page from a template of `templates`, in which text is never markup and an unknown name is an error."""
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(resource("templates")), autoescape=True,
                                     undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= filters
    return environment.get_template(template).render(**content)


def to_csv(rows: Iterable[Sequence[str]]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()
