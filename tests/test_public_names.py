"""The public names: all there, each one hop away, and importing the package is quick and light."""

import subprocess
import sys

import lutforge as lf


def test_every_name_is_there() -> None:
    for name in lf.__all__:
        assert getattr(lf, name) is not None
        assert name in dir(lf)


def test_an_unknown_name_is_an_attribute_error() -> None:
    assert not hasattr(lf, "frobnicate")


def test_importing_loads_nothing_heavy() -> None:
    code = "import sys, lutforge; print([m for m in ('numpy', 'scipy', 'numba', 'colour') if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
