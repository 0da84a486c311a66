"""`python -m plate_fem COMMAND`: the commands of `gangue` of the plate alone."""

from gangue.__main__ import door

main = door("plate_fem")

if __name__ == "__main__":
    raise SystemExit(main())
