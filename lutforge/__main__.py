"""`python -m lutforge`: the command line."""

from lutforge.cli.main import main

if __name__ == "__main__":
    main()
