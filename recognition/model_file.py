"""Fitted methods as JSON and back: dataclasses of numbers, texts and arrays, by cattrs.

A table of the file has exactly the fields of its dataclass. Numbers must be finite and of their type; nothing is
converted or filled in.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar, get_args, get_origin

import numpy as np
from cattrs import Converter
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

T = TypeVar("T")


def encode(value: Any) -> Any:
    """A dataclass as nested dicts and lists."""
    return _converter.unstructure(value)


def decode(data: Any, of: type[T]) -> T:
    """A dataclass from what `encode` made of it. ValueError, KeyError or TypeError for anything else."""
    return _converter.structure(data, of)


def _array(data: Any, of: Any) -> Any:
    """An array of the kind of number that its type names."""
    kind = np.dtype(get_args(get_args(of)[1])[0])
    found = np.array(data)
    if found.size == 0 or found.dtype.kind not in ("iu" if kind.kind == "i" else "iuf") or not np.isfinite(found).all():
        raise ValueError(f"an array of finite {kind.name} is needed")
    return found.astype(kind)


def _exactly(data: Any, of: type[T]) -> T:
    if type(data) is not of:
        raise TypeError(f"{data!r:.40} is not of type {of.__name__}")
    return data


def _float(data: Any, _: type) -> float:
    if isinstance(data, bool) or not isinstance(data, (int, float)) or not math.isfinite(data):
        raise TypeError(f"{data!r:.40} is not a finite number")
    return float(data)


def _structure(of: type) -> Callable[[Any, Any], Any]:
    names = {field.name for field in fields(of)}
    inner: Any = make_dict_structure_fn(of, _converter, _cattrs_include_init_false=True,
                                        _cattrs_detailed_validation=False)

    def structure(data: Any, _: Any) -> Any:
        if not isinstance(data, dict) or set(data) != names:
            raise ValueError(f"{of.__name__} needs {', '.join(sorted(names))}")
        return inner(data, of)

    return structure


def _unstructure(of: type) -> Callable[[Any], Any]:
    shortened: dict[str, Any] = {field.name: override(unstruct_hook=_to_digits(field.metadata["digits"]))
                                 for field in fields(of) if "digits" in field.metadata}
    hook: Any = make_dict_unstructure_fn(of, _converter, _cattrs_include_init_false=True, **shortened)
    return hook


def _to_digits(digits: int) -> Callable[[Any], Any]:
    return lambda array: np.vectorize(lambda number: float(f"{number:.{digits}g}"))(array).tolist()


def _is_array(of: Any) -> bool:
    return np.ndarray in (of, get_origin(of))


_converter = Converter(detailed_validation=False, forbid_extra_keys=True)
_converter.register_structure_hook(float, _float)
for _kind in (int, str, bool):
    _converter.register_structure_hook(_kind, _exactly)
_converter.register_structure_hook_func(_is_array, _array)
_converter.register_unstructure_hook_func(_is_array, lambda array: array.tolist())
_converter.register_structure_hook_factory(is_dataclass, _structure)
_converter.register_unstructure_hook_factory(is_dataclass, _unstructure)
