"""`python -m lutforge` is the `lutforge` command."""

from lutforge.cli import start

if __name__ == "__main__":
    start()
