"""Numbers that the report takes from a sweep, one class for each chapter; `SweepResults` holds them all."""
