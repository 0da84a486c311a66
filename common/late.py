"""Names of a package that are imported when they are first asked for, so that a command which only reads starts at
once. The package's stub, `__init__.pyi`, imports them, which type checkers and editors read as it stands."""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def late(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return a package's `__getattr__`, which takes each name from its module and keeps it, `__dir__` and `__all__`."""
    stub = Path(str(sys.modules[package].__file__)).with_suffix(".pyi").read_text()
    imports = [node for node in ast.parse(stub).body if isinstance(node, ast.ImportFrom)]
    module_of = {alias.name: node.module for node in imports for alias in node.names}

    def find(name: str) -> Any:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(str(module_of[name])), name)
        setattr(sys.modules[package], name, value)
        return value

    return find, lambda: list(module_of), list(module_of)
