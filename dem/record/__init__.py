"""What a run records: signals, energy, stones, pictures."""
