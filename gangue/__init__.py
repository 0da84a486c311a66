"""One command for everything: `gangue run | sweep | report | recognise | features | modes | doctor ...`.

It hands each command to the command line of its package, `python -m dem` and so on, and imports that package only then.
"""
