"""Readers of records from files of other programs and of runs."""
