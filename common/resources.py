"""Where the files are that the programs read beside their code: `templates`, `scenes` and `workflow`.

They stand at the top of a checkout. The wheel carries them inside this package, in `common/data` (pyproject.toml).
"""

from pathlib import Path

_COMMON = Path(__file__).resolve().parent


def resource(name: str) -> Path:
    """Return the path of a file or directory, such as `templates` or `scenes/small.toml`, whether it exists or not."""
    return (checkout() or _COMMON / "data") / name


def checkout() -> Path | None:
    """Return the top directory of the checkout that this code runs from, or None where a wheel was installed."""
    return None if (_COMMON / "data").is_dir() else _COMMON.parent
