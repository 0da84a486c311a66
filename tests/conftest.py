"""What all tests share: a cache of modes and packings, empty at the start, and Ctrl-C as on a terminal."""

import os
import shutil
import signal
import tempfile

from common.process import messages

messages.LOG_s = 1e6  # on a loaded machine a stage would be named, beside the one line of a refusal
os.environ |= dict.fromkeys(("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"), "1")  # as the Makefile does
WORKER = "PYTEST_XDIST_WORKER" in os.environ  # which inherits the directory of the process that started it


def pytest_configure(config):
    # A shell without job control starts programs in the background with SIGINT ignored, which children inherit.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # and nohup those that it starts with SIGHUP ignored
    if not WORKER:
        os.environ["COAL_GANGUE_CACHE"] = tempfile.mkdtemp(prefix="cache-of-tests-")


def pytest_unconfigure(config):
    if not WORKER:
        shutil.rmtree(os.environ["COAL_GANGUE_CACHE"], ignore_errors=True)
