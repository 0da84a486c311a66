"""The figures of a sweep, chapter by chapter."""
