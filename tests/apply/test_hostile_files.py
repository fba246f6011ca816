"""Files of strangers that made `apply` hang or end in a traceback: each is one line of our own error."""

import json
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest

from lutforge.apply.grade import ConfigRecipe
from lutforge.apply.job import JOURNAL, read_journal
from lutforge.errors import ConfigError, ImageError
from lutforge.images.read import ImageReader
from lutforge.ocio.config import write_config
from tests.cases.profiles import small_profile
from tests.ocio.test_config import SMALL

ENDLESS = "CSPLUTV100\n3D\n\nBEGIN METADATA\nx\n"


def test_a_config_that_names_an_endless_lut_is_refused(tmp_path: Path) -> None:
    path = write_config([small_profile()], tmp_path / "config", inverse_size=SMALL)
    (path.parent / "luts" / "endless.csp").write_text(ENDLESS)
    path.write_text(path.read_text().replace("test_one_standard_linearize.clf", "endless.csp"))
    began = time.monotonic()
    with pytest.raises(ConfigError, match=r"config\.ocio: .*seconds"):
        ConfigRecipe(path, "Test One standard daylight", "ACEScg").check()
    assert time.monotonic() - began < 90.0


def test_an_exr_whose_attributes_are_no_text_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    oiio.ImageBuf(np.full((4, 4, 3), 0.5, np.float32)).write(str(path))
    path.write_bytes(path.read_bytes().replace(b"chlist\0", b"\xff\xfelist\0"))
    with pytest.raises(ImageError, match=r"a\.exr: cannot be read as an image \(it holds bytes that are not text\)"):
        ImageReader(path)


def test_a_journal_that_is_nested_too_deeply_is_as_good_as_none(tmp_path: Path) -> None:
    (tmp_path / JOURNAL).write_text("[" * 100_000 + "\n" + json.dumps({"recipe": 1}) + "\n")
    assert read_journal(tmp_path) == {}
