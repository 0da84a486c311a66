"""Tables of the pages from the laboratory's results: `python -m lab.tables [--check] [PAGE ...]` (default: README.md, docs/*.md).

What stands between `<!-- table: NAME | column: title: format | ... -->` and `<!-- end -->` becomes the result NAME as
a table of Markdown. A column without title has its own name, one without format (that of Python) its text; without columns
there are all. `NAME where column=value, ...` takes the rows with these values, `a/b` for either. --check writes nothing, and ends with 1
where a page has another table.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from lab.results import RESULTS, ROOT, read_result

MARKED = re.compile(r"(<!-- table: (\S+?)(?: where (.*?))?\s*(?:\|(.*?))?\s*-->\n)(.*?)(<!-- end -->)", re.DOTALL)


def rendered(page: str, results: Path | None = None) -> str:
    """A page with its tables as the results are. ValueError for a result or a column that is not there."""
    directory = results or RESULTS
    return MARKED.sub(lambda found: found[1] + _table(directory / f"{found[2]}.csv", *found.group(3, 4)) + found[6], page)


def _table(file: Path, chosen: str | None, columns: str | None) -> str:
    if not file.is_file():
        raise ValueError(f"{file.name}: no such result")
    head, table = read_result(file)
    rules = [rule.strip().split("=", 1) for rule in (chosen or "").split(",") if rule.strip()]
    asked = [[part.strip() for part in one.split(":", 2)] for one in (columns or "|".join(table.columns)).split("|")]
    for name in (name for name, *_ in [*rules, *asked] if name not in table):
        raise ValueError(f"{file.name}: no column {name!r}; it has {', '.join(table.columns)}")
    for name, value in rules:
        table = table[table[name].isin(value.split("/"))]
    if table.empty:
        raise ValueError(f"{file.name}: no row where {chosen}")
    rows = [[title for title, *_ in ([*more, name] for name, *more in asked)], ["---"] * len(asked)]
    for row in table.to_dict("records"):
        rows.append([_cell(row[name], more[1] if len(more) > 1 else "") for name, *more in asked])
    made = f"`{head['command']}`, {head['date']}, commit {head['commit']}"
    return "".join(f"|{'|'.join(row)}|\n" for row in rows) + f"\n{made}; {head['machine']}.\n"


def _cell(text: str, form: str) -> str:
    """Text that is no number stays as it is."""
    try:
        return format(float(text), form) if form else text
    except ValueError:
        return text


def main(words: list[str]) -> int:
    pages = [Path(word) for word in words if word != "--check"] or [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    other = [page for page in pages if rendered(page.read_text()) != page.read_text()]
    for page in other:
        print(f"{page.name}: {'has tables that are not those of lab/results' if '--check' in words else 'written'}")
        if "--check" not in words:
            page.write_text(rendered(page.read_text()))
    return int("--check" in words and bool(other))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
