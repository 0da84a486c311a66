"""`python -m recognition COMMAND`: the commands of `gangue` of recognition."""

import sys
from functools import partial

from gangue.__main__ import main as gangue

main = partial(gangue, package="recognition")

if __name__ == "__main__":
    sys.exit(main())
