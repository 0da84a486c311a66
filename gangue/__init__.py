"""One command for everything: `gangue run | sweep | report | recognise | features | modes | doctor ...`.

It parses, calls one function of the package that computes the answer, and prints what that returns.
"""
