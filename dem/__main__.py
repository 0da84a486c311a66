"""`python -m dem COMMAND`: the commands of `gangue` that simulate."""

import sys
from functools import partial

from gangue.__main__ import main as gangue

main = partial(gangue, package="dem")

if __name__ == "__main__":
    sys.exit(main())
