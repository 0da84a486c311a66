"""The report of a run, a sweep or a stream, and of the paper's scene the scoreboard of the paper's statements.

A chapter is a folder: results.py has its numbers, figures.py draws them under title and caption, and claims.py has the
paper's statements on it. A figure's key, such as "fig-16", stands in the last two.
"""
