"""dem.deck.time_step with other constants: settings coarser than a scene may ask for are part of a study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from unittest.mock import patch

import dem.deck.time_step


@contextmanager
def time_step_constants(values: Mapping[str, float]) -> Iterator[None]:
    """Within the block, constants of that module by name."""
    with ExitStack() as stack:
        for name, value in values.items():
            stack.enter_context(patch.object(dem.deck.time_step, name, value))
        yield
