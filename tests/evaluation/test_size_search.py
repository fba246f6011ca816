"""The smallest size that reaches a held-out error, by the Python API and by the command line."""

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.preparation import data_by_style
from lutforge.cli.main import app
from lutforge.errors import CalibrationError
from lutforge.evaluation.size_search import smallest_size
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import write_samples
from lutforge.simulate.camera import nikon_d5100
from tests.calibration.samples_simulated import chart_140, photograph_patches


@pytest.fixture(scope="module")
def samples() -> SampleSet:
    return photograph_patches(nikon_d5100(), chart_140(), balances=("daylight",), stops=(-3, -2, -1, 0))


def test_it_reaches_the_error_that_calibrate_prints(samples: SampleSet) -> None:
    data = data_by_style(samples)
    printed = calibrate(samples, CalibrationOptions(size=13)).styles["standard"].errors["render_mean"]
    assert smallest_size(data, 1.2 * printed) <= 13
    assert smallest_size(data, 1.0) == 9


def test_what_no_size_reaches_is_said(samples: SampleSet) -> None:
    with pytest.raises(CalibrationError, match=r"the smallest is 0\.0"):
        smallest_size(data_by_style(samples), 1e-6, sizes=(5, 9))
    with pytest.raises(CalibrationError, match="above 0"):
        smallest_size(data_by_style(samples), float("nan"))
    alone = samples.select(samples.shot == samples.shot[0])
    with pytest.raises(CalibrationError, match="no shot can be held out"):
        smallest_size(data_by_style(alone), 0.01)


def test_the_command_shows_both(samples: SampleSet, tmp_path: Path) -> None:
    write_samples(tmp_path / "samples.csv", samples)
    words = ["calibrate", str(tmp_path / "samples.csv"), "-o", str(tmp_path / "a.npz"), "--tolerance", "0.5"]
    result = CliRunner().invoke(app, [*words, "--learning-curve"])
    assert result.exit_code == 0, result.output
    assert "9 nodes per axis are the fewest" in result.output
    table = result.output.split("by the number of shots: standard")[1]
    shots, errors = zip(*re.findall(r"^ *(\d+) +\d+ +(0\.\d{4})", table, flags=re.MULTILINE), strict=True)
    assert len(shots) >= 2 and np.all(np.diff([int(count) for count in shots]) > 0)
    assert float(errors[-1]) == pytest.approx(float(errors[0]), rel=0.05)  # one shot here tells as much as two
    assert float(errors[-1]) < 0.005
    assert "shots" in result.output.split("standard: ")[-1]
    both = CliRunner().invoke(app, [*words, "--size", "9"])
    assert isinstance(both.exception, CalibrationError) or both.exit_code == 2
