"""`python -m plate_fem COMMAND`: the commands of `gangue` of the plate alone."""

import sys
from functools import partial

from gangue.__main__ import main as gangue

main = partial(gangue, package="plate_fem")

if __name__ == "__main__":
    sys.exit(main())
