"""`python -m rmrc`."""

from rmrc.cli import main

if __name__ == "__main__":
    main()
