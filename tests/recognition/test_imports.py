import subprocess
import sys

import pytest


@pytest.mark.parametrize("package", ["analysis", "recognition"])
def test_import_pulls_neither_plotting_nor_the_simulation(package):
    """Both are imported by people who only have a record."""
    late = "('matplotlib', 'PyEMD', 'filterpy', 'pyuff', 'sklearn', 'dem', 'plate_fem')"
    code = f"import sys, {package}; print(*(m for m in {late} if m in sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == ""
