import subprocess
import sys

import pytest

LATE = ["matplotlib", "PyEMD", "filterpy", "pyuff", "dem"]


@pytest.mark.parametrize(("package", "never"), [("analysis", [*LATE, "sklearn", "plate_fem"]), ("recognition", LATE)])
def test_import_pulls_neither_plotting_nor_the_simulation(package, never):
    """Both are imported by people who only have a record."""
    code = f"import sys, {package}; print(*(m for m in {never} if m in sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == ""
