"""The public names: all there, each one hop away, and importing the package is quick and light."""

import inspect
import subprocess
import sys

import pytest

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


def test_signatures_are_read_in_a_line() -> None:
    for name in lf.__all__:
        public = getattr(lf, name)
        members = [public, *(value for key, value in vars(public).items() if not key.startswith("_"))]
        for member in members if isinstance(public, type) else [public]:
            if inspect.isfunction(member):
                signature = str(inspect.signature(member))
                assert "_SupportsArray" not in signature, (name, member)
            if callable(member):
                assert inspect.getdoc(member), (name, member)


def test_a_table_that_is_not_there_is_one_line() -> None:
    with pytest.raises(lf.LutForgeError, match=r"^missing.csv: no such file$"):
        lf.calibrate("missing.csv")
