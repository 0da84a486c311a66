"""`python -m dem COMMAND`: the commands of `gangue` that simulate."""

from gangue.__main__ import door

main = door("dem")

if __name__ == "__main__":
    raise SystemExit(main())
