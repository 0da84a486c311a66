"""Figures of the report, drawn from plain data. Only this room imports matplotlib."""
