"""`python -m report COMMAND`: the commands of `gangue` that write pages."""

import sys
from functools import partial

from gangue.__main__ import main as gangue

main = partial(gangue, package="report")

if __name__ == "__main__":
    sys.exit(main())
