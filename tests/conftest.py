"""What every test may use."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real photographs and published models; tests that need it skip where it is missing."""
    root = Path(__file__).resolve().parents[1]
    folder = Path(os.environ.get("LUTFORGE_TEST_DATA", root.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no test data at {folder}: set LUTFORGE_TEST_DATA to the folder of real shots")
    return folder
