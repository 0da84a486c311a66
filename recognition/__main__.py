"""`python -m recognition COMMAND`: the commands of `gangue` of recognition."""

from gangue.__main__ import door

main = door("recognition")

if __name__ == "__main__":
    raise SystemExit(main())
