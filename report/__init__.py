"""The report of a run, a sweep or a stream, and of the paper's scene the scoreboard of the paper's statements.

A chapter is a module: a class has its numbers, which `SweepResults.of` keeps, functions draw them under title and
caption, and the paper's statements on it follow. Recognition, the largest, is a folder. A figure's key, such as
"fig-16", stands with the figure and with its statements.
"""
