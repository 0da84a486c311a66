"""The cache of modes and packings of this session's tests: empty at the start, and shared by all its processes."""

import os
import shutil
import tempfile

WORKER = "PYTEST_XDIST_WORKER" in os.environ  # which inherits the directory of the process that started it


def pytest_configure(config):
    if not WORKER:
        os.environ["COAL_GANGUE_CACHE"] = tempfile.mkdtemp(prefix="cache-of-tests-")


def pytest_unconfigure(config):
    if not WORKER:
        shutil.rmtree(os.environ["COAL_GANGUE_CACHE"], ignore_errors=True)
