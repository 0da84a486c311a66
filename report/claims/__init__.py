"""The paper's statements, each compared with the runs: the scoreboard of the report."""
