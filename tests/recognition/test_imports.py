import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from gangue.commands import COMMANDS

LATE = ["matplotlib", "PyEMD", "filterpy", "pyuff", "dem"]


@pytest.mark.parametrize(("package", "never"), [("analysis", [*LATE, "sklearn", "plate_fem"]), ("recognition", LATE)])
def test_import_pulls_neither_plotting_nor_the_simulation(package, never):
    """Both are imported by people who only have a record."""
    code = f"import sys, {package}; print(*(m for m in {never} if m in sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == ""


def modules_after(code):
    """Names of the modules that a new Python has after `code`."""
    found = subprocess.run([sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules, file=sys.stderr)"],
                           capture_output=True, text=True, check=True)
    return set(found.stderr.split())


@pytest.mark.parametrize("package", ["analysis", "dem", "gangue", "plate_fem", "recognition", "report"])
def test_help_imports_nothing_that_is_slow(package):
    """That of the package, and of each of its commands."""
    asked = [["--help"], *([name, "--help"] for name, command in COMMANDS.items() if command.package == package)]
    code = f"from {package}.__main__ import main\nfor words in {asked}: assert main(words) == 0"
    assert not {"numpy", "pandas", "scipy", "pydantic", "pyarrow", "matplotlib", "sklearn"} & modules_after(code)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_features_of_a_record_import_only_what_they_use(tmp_path, ending):
    file = tmp_path / f"record.{ending}"
    k = np.arange(200)
    table = pd.DataFrame({"t_s": k * 1e-4, "a_m_s2": (-1.0) ** k * k})
    table.to_csv(file, index=False) if ending == "csv" else table.to_parquet(file, index=False)
    loaded = modules_after(f"from analysis.__main__ import main\nmain(['features', {str(file)!r}])")
    assert "PyEMD.EMD" not in loaded and "analysis.signals.sifting" in loaded  # PyEMD is left as it was found
    assert not {"matplotlib", "scipy.signal", "scipy.stats", "sklearn", "meshio", "dem"} & loaded
    assert not {"pandas", "pydantic", "scipy.linalg", "scipy.interpolate", "pyarrow.dataset"} & loaded
    assert ending == "parquet" or "pyarrow" not in loaded


@pytest.mark.slow
def test_a_run_imports_only_what_it_uses():
    """All that a run needs whose modes and packings are known; finite elements and mesh files are not among it."""
    loaded = modules_after("import dem.run.run, dem.__main__, numpy, io\nfrom common.files.parquet import write_parquet\n"
                           "write_parquet({'a': numpy.ones(2), 'b': numpy.array(['x', 'y'])}, io.BytesIO())")
    assert not {"pandas", "matplotlib", "scipy.signal", "scipy.stats", "sklearn", "meshio", "PyEMD"} & loaded
