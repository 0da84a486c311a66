"""The exit code of an engine, and of a run, that was asked to stop at a checkpoint and did."""

STOPPED = 75
