"""`python -m report COMMAND`: the commands of `gangue` that write pages."""

from gangue.__main__ import door

main = door("report")

if __name__ == "__main__":
    raise SystemExit(main())
