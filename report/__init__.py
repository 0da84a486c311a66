"""The report of a sweep: the paper figure by figure, and the scoreboard of its statements."""
