"""Run directories: signals, what broke, what fell."""
