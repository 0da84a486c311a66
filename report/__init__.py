"""The report of a sweep: the paper figure by figure, and the scoreboard of its statements.

A chapter is a folder: results.py has its numbers, figures.py draws them, chapter.py has title and caption of each,
and claims.py the paper's statements on it. A figure's key, such as "fig-16", stands in the last two.
"""
