"""The page that compares two settings of a camera."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lutforge.cli.reports import compare as compare_command
from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.pipeline.reports import compare
from lutforge.reports.comparison import build_comparison
from lutforge.reports.tables import Table


@pytest.fixture(scope="module")
def profile_path(published_d40: CameraProfile, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("compare") / "d40.npz"
    published_d40.save(path)
    return path


def test_a_page_shows_chart_and_differences(profile_path: Path, tmp_path: Path) -> None:
    page = compare(profile_path, profile_path, tmp_path / "compare.html", "standard/daylight", "standard/shade")
    text = (tmp_path / "compare.html").read_text()
    assert "Nikon D40 standard/shade" in text and text.count("<svg") == 1
    (table,) = (block for blocks in page.sections.values() for block in blocks if isinstance(block, Table))
    assert len(table.rows) == 24
    with pytest.raises(SettingsError, match="vivid"):
        compare(profile_path, profile_path, tmp_path / "compare.html", "vivid/daylight")
    compare_command(
        profile_path, output=tmp_path / "one.html", first_setting="standard/daylight", second_setting="standard/shade"
    )
    assert "Nikon D40 standard/shade" in (tmp_path / "one.html").read_text()


def test_the_same_setting_differs_by_nothing_and_an_exposure_is_levelled(profile_path: Path) -> None:
    profile = as_profile(profile_path)
    models = profile.styles["standard"].models
    darker = tuple(replace(model, matrix=model.matrix * 0.7) for model in models)  # half a stop less sensitive
    style = replace(profile.styles["standard"], models=darker)
    page = build_comparison(profile, "standard/daylight", profile, "standard/daylight")
    assert "ΔE00 0.0 in the mean" in page.lead[0]
    other = replace(profile, styles={"standard": style})
    page = build_comparison(profile, "standard/daylight", other, "standard/daylight")
    stops = float(page.subtitle.split(" EV")[0].split()[-1])
    assert stops == pytest.approx(-np.log2(0.7), abs=0.05)
    assert float(page.lead[0].split("ΔE00 ")[1].split()[0]) < 0.2
