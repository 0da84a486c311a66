"""Regressions on features of a record, with intervals."""
