"""The JSON schema of a scene, and docs/scene.md, both from the fields of common/scene/scene.py and common/scene/plate.py.

`python -m lab.scene_schema` writes scenes/scene.schema.json, which editors complete and check by, and the page.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from common.channels import unit_of
from common.files.whole import write_text
from common.resources import resource
from common.scene.scene import Scene

Node = dict[str, Any]
SCHEMA = "scenes/scene.schema.json"
PAGE = "docs/scene.md"
ALIKE = 5  # keys that two tables share, from which on they stand once
DRAFT = "http://json-schema.org/draft-07/schema#"  # what editors know

WHOLE = ("Rod", "Sensor", "EachStone")

PAIR = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}

HEAD = """# Keys of a scene

Every key of a scene file, as `python -m lab.scene_schema` writes it, in SI units. "Paper" says what the
[paper](../README.md) gives; `scenes/paper.toml` says how each other value is chosen.

The first line of a scene, `#:schema ./scene.schema.json`, lets an editor with a TOML server complete, explain and check
keys. `--set stones.count=6` of `run`, `deck` and `sweep` changes a key. Bounds alone are of a number; a number or a
pair also stands for a distribution.
"""


def scene_schema() -> Node:
    """The schema (JSON Schema, draft 7) of a scene file."""
    schema = Scene.model_json_schema()
    definitions = schema.pop("$defs")
    for table in [schema, *definitions.values()]:
        table.pop("title", None)
        table["description"] = table["description"].splitlines()[0]
        for name, key in table["properties"].items():
            table["properties"][name] = _for_editors(name, key)
    schema["properties"]["materials"]["patternProperties"] = {
        name: {"anyOf": [{"type": "string"}, table]}
        for name, table in schema["properties"]["materials"]["patternProperties"].items()}
    plate = schema["properties"]["plate"]
    plate["anyOf"] = plate.pop("oneOf")  # a part of a plate, over a base, may be of either kind
    for name, table in [("", schema), *definitions.items()]:
        if name not in WHOLE:  # a scene with a base may have any part of a table
            table["x-required"] = table.pop("required", [])
    return {"$schema": DRAFT, "title": "Scene of coal and gangue on a plate", **_referred(schema),
            "definitions": _referred(definitions)}


def _for_editors(name: str, key: Node) -> Node:
    """A key without what TOML cannot say (null), with its unit, and closed where its tables have names of their own."""
    if "description" not in key:
        raise ValueError(f"{name}: needs a meaning, Annotated[..., about(\"...\")]")
    choices = [choice for choice in key.pop("anyOf", []) if choice.get("type") != "null"]
    key = {**(choices[0] if len(choices) == 1 else {"oneOf": choices} if choices else {}), **key}
    key.pop("title", None)
    key.pop("discriminator", None)
    if key.get("default", ...) is None:
        del key["default"]
    lists = [key, *key.get("oneOf", [])]
    while lists:
        inner = lists.pop()
        if "prefixItems" in inner:  # as draft 7 has it, where all have what the first has
            inner["items"] = inner.pop("prefixItems")[0]
        lists += [inner[of] for of in ("items", "additionalProperties") if isinstance(inner.get(of), dict)]
    if key.get("$ref", "").endswith("/Distribution"):
        key["oneOf"] = [{"type": "number"}, PAIR, {"$ref": key.pop("$ref")}]
        if "default" in key:
            key["default"] = key["default"]["within"][0]
    if "patternProperties" in key:
        key["additionalProperties"] = False
    unit = unit_of(name)
    if unit != "1":
        key["x-unit"] = unit
    if "$ref" in key:  # whatever stands beside a reference is not read in draft 7
        key = {"allOf": [{"$ref": key.pop("$ref")}], **{k: v for k, v in key.items() if k != "default"}}
    return key


def _referred(node: Any) -> Any:
    """The same with references to `definitions`, the name of draft 7."""
    if isinstance(node, dict):
        return {k: v.replace("#/$defs/", "#/definitions/") if k == "$ref" else _referred(v) for k, v in node.items()}
    return [_referred(item) for item in node] if isinstance(node, list) else node


def scene_page() -> str:
    """docs/scene.md: a table of keys for every table of a scene."""
    schema = scene_schema()
    parts, written = [HEAD], dict[str, dict[str, str]]()
    for title, table in _tables(schema, schema, ""):
        rows = {name: _row(name, key, table) for name, key in table["properties"].items()}
        if rows in written.values():
            continue  # the same table at another path
        text = f"## {title}\n\n{_sentence(table['description'])}"
        for earlier, its_rows in written.items():
            alike = [name for name, row in rows.items() if its_rows.get(name) == row]
            if len(alike) >= ALIKE:
                text += f" {', '.join(f'`{name}`' for name in alike)}: as in {earlier}."
                rows = {name: row for name, row in rows.items() if name not in alike}
        written[title] = rows
        head = "\n\n|key|meaning|default|allowed|\n|---|---|---|---|\n" if rows else "\n"
        parts.append(f"{text}{head}{''.join(rows.values())}")
    return "\n".join(parts)


def _tables(schema: Node, table: Node, path: str, note: str = "") -> Iterator[tuple[str, Node]]:
    """A table with its title, and those inside it."""
    yield (f"`[{path}]`{note}" if path else "Top level"), table
    if not path:
        yield "A distribution", schema["definitions"]["Distribution"]
    for name, key in table["properties"].items():
        here = f"{path}.{name}" if path else name
        for kind, inner in _inside(key):
            named = inner["$ref"].rsplit("/", 1)[1]
            target = schema["definitions"][named]
            if kind == "list":
                yield f"`[[{here}]]`", target
            else:
                said = {"FlexiblePlate": " that bends", "RigidPlate": " that does not move"}.get(named, "")
                yield from _tables(schema, target, here + kind, said)


def _inside(key: Node) -> list[tuple[str, Node]]:
    """References to the tables in a key, each with what its path gets: nothing, `.NAME`, or "list"."""
    if "allOf" in key:
        return [("", key["allOf"][0])]
    if "anyOf" in key:
        return [("", choice) for choice in key["anyOf"]]
    if "oneOf" in key:
        return [("", choice) for choice in key["oneOf"] if "$ref" in choice and not _is_spread(key)]
    if "$ref" in key.get("items", {}):
        return [("list", key["items"])]
    named = [*key.get("patternProperties", {}).values(), key.get("additionalProperties")]
    named = [next(one for one in table["anyOf"] if "$ref" in one) if isinstance(table, dict) and "anyOf" in table else table for table in named]
    return [(".NAME", table) for table in named if isinstance(table, dict) and "$ref" in str(table)]


def _is_spread(key: Node) -> bool:
    """A number or a distribution, whose table stands once."""
    return {"type": "number"} in key.get("oneOf", [])


def _row(name: str, key: Node, table: Node) -> str:
    default = "required" if name in [*table.get("required", []), *table.get("x-required", [])] else (
        f"`{json.dumps(key['default'])}`" if "default" in key else "absent")
    meaning = key["description"] + (f" (paper: {key['x-paper']})" if "x-paper" in key else "")
    return "|" + "|".join(cell.replace("|", "\\|") for cell in (f"`{name}`", meaning, default, _allowed(key))) + "|\n"


def _allowed(key: Node) -> str:
    """Kind and bounds in a few words."""
    if _is_spread(key):
        return "distribution"
    if "enum" in key.get("propertyNames", {}):
        return f"table: {_allowed(key['additionalProperties'])} by {_allowed({'enum': key['propertyNames']['enum']})}"
    if _inside(key):
        return "table" if "allOf" in key or "oneOf" in key else "tables"
    if "oneOf" in key:
        return " or ".join(map(_allowed, key["oneOf"]))
    if "const" in key:
        return "as the table's title says"
    if "enum" in key:
        return ", ".join(f'`"{value}"`' for value in key["enum"])
    if "items" in key:
        return f"list: {_allowed(key['items'])}"
    signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    bounds = ", ".join(f"{sign}{key[bound]:g}" for bound, sign in signs.items() if bound in key)
    kind = {"integer": "integer", "number": "" if bounds else "number", "boolean": "Boolean", "string": "text"}[key["type"]]
    text = f" `{key['pattern']}`" if "pattern" in key else ""
    return f"{kind} {bounds}".strip() + text


def _sentence(text: str) -> str:
    return text if text.endswith(".") else text + "."


def main() -> None:
    """Write both files."""
    write_text(resource(SCHEMA), json.dumps(scene_schema(), indent=1) + "\n")
    write_text(Path(resource("docs")) / Path(PAGE).name, scene_page())


if __name__ == "__main__":
    main()
