import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def runs(tmp_path_factory):
    """One directory for run directories, so that they share the modes of the plate kept beside them."""
    return tmp_path_factory.mktemp("runs")
