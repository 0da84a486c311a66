"""`python -m analysis COMMAND`: the commands of `gangue` on records."""

import sys
from functools import partial

from gangue.__main__ import main as gangue

main = partial(gangue, package="analysis")

if __name__ == "__main__":
    sys.exit(main())
