"""`python -m analysis COMMAND`: the commands of `gangue` on records."""

from gangue.__main__ import door

main = door("analysis")

if __name__ == "__main__":
    raise SystemExit(main())
