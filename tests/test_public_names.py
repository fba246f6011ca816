"""The public names: all there, each one hop away, and importing the package is quick and light."""

import inspect
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import lutforge as lf
from tests.model.profiles_synthetic import small_profile


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


def test_what_is_no_profile_setting_or_number_is_one_plain_line(tmp_path: Path) -> None:
    profile, colours = small_profile(), np.full((2, 3), 0.5)
    wrong: Any = None
    for call, says in (
        (lambda: profile.linearize(wrong), "None is not STYLE/WB"),
        (lambda: profile.refinish("standard/daylight", "vivid/daylight", ev=cast(Any, "a")), "within ±20 stops"),
        (lambda: lf.bake(profile.render("standard/daylight"), size=cast(Any, 5.5)), "5.5 nodes per axis"),
        (lambda: lf.evaluate(wrong, "samples.csv"), "None is not a profile"),
        (lambda: lf.build_config([str(tmp_path / "x.npz")]), "x.npz: no such profile"),
        (lambda: lf.SampleSet.from_arrays(np.zeros((0, 3)), np.zeros((0, 3)), camera="A", shot="a"), "none given"),
        (lambda: lf.SampleSet.from_arrays(colours, colours, camera=wrong, shot="a"), "column camera is None"),
        (lambda: lf.SampleSet.from_arrays(colours, colours, camera="A", shot=cast(Any, ["a", None])), "shot is None"),
    ):
        with pytest.raises(lf.LutForgeError, match=re.escape(says)):
            call()
    profile.save(tmp_path / "camera.npz")
    assert lf.build_config([tmp_path / "camera.npz"]).serialize() == lf.build_config([profile]).serialize()
