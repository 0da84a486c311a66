"""Pages are made with fewer noisy copies of records."""

import pytest


@pytest.fixture(scope="module", autouse=True)
def few_copies():
    """Recognition, which has its own tests, takes most of the time of a page."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("recognition.estimation.noise.COPIES", 2)
        yield
