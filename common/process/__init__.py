"""How a command runs: its end, its messages and the processes that it starts."""
