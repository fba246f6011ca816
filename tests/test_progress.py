"""Progress tells where work is, and when kernels compile."""

from typing import Any

import numba
import numpy as np

from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.srgb import srgb_encode
from lutforge.progress import part, telling_of_compilation
from lutforge.samples.sample_set import SampleSet


def test_a_part_takes_its_share_of_the_whole() -> None:
    told: list[tuple[str, float]] = []
    within = part(lambda what, share: told.append((what, share)), 0.5, 1.0, "vivid")
    within("fitting", 0.5)
    assert told == [("vivid: fitting", 0.75)]


def test_compiling_a_kernel_is_told_once() -> None:
    told: list[tuple[str, float]] = []

    doubled: Any = numba.njit(lambda value: 2 * value)

    with telling_of_compilation(lambda what, share: told.append((what, share))) as progress:
        progress("fitting", 0.25)
        doubled(1.0)
        doubled(2.0)
    assert [what for what, _ in told] == ["fitting", told[1][0], "fitting"]
    assert "compiling" in told[1][0]
    assert {share for _, share in told} == {0.25}


def test_a_calibration_tells_of_each_step_before_it_begins() -> None:
    told: list[str] = []
    raw = np.random.default_rng(0).uniform(0.01, 0.9, (120, 3))
    samples = SampleSet.from_arrays(raw, srgb_encode(raw), camera="camera", shot=np.arange(120) % 3)
    calibrate(samples, CalibrationOptions(size=5), lambda what, share: told.append(what))
    assert told[0] == "checking white balances and shots" and told[1].startswith("fitting ")
