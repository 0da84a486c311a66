"""What every other package uses: scene files and their tables, Hertz' contact, error laws, files and resources.

This package imports none of the others.
"""
