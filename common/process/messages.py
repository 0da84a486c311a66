"""What library code says while it works: messages of `logging`, which a command line lets through to the terminal."""

import logging
import os
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

#: Environment variable with the least level of messages that are shown, of `logging`; INFO where it is absent. Programs
#: that are started from here have it too.
LEVEL = "GANGUE_LOG_LEVEL"
PACKAGES = ("common", "dem", "plate_fem", "analysis", "recognition", "report")


PATIENCE_s, LOG_s = 0.1, 0.9  # with a stage that is not named yet, on a terminal and in a log


class _Terminal(logging.Handler):
    """Messages go to the output, warnings and worse to the error output. A closed pipe or a full disk is raised."""

    def emit(self, record: logging.LogRecord) -> None:
        warned = record.levelno >= logging.WARNING
        print(self.format(record), file=sys.stderr if warned else sys.stdout, flush=True)


def show_messages(quiet: bool = False) -> None:
    """Let the messages of all packages through to the terminal, if quiet but those of what goes wrong. A warning of
    Python's is one line, without the code that it came from."""
    warnings.formatwarning = lambda message, *_, **__: f"warning: {message}\n"
    for name in PACKAGES:
        logger = logging.getLogger(name)
        logger.setLevel("WARNING" if quiet else os.environ.get(LEVEL, "INFO"))
        if not any(isinstance(handler, _Terminal) for handler in logger.handlers):
            logger.addHandler(_Terminal())


@contextmanager
def told(stage: str) -> Iterator[None]:
    """Name what is done within, on the error output, if it takes longer than PATIENCE_s, or LOG_s where that is no
    terminal, and a command line shows what is said; "" is not named."""
    logger = logging.getLogger(PACKAGES[0])
    if not (stage and logger.handlers and logger.isEnabledFor(logging.INFO)):
        yield
        return
    patience_s = PATIENCE_s if sys.stderr.isatty() else LOG_s
    timer = threading.Timer(patience_s, lambda: print(f"{stage} ...", file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
