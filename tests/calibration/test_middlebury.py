"""Ten real cameras: trained under one light, tested under another (the table in examples/)."""

import importlib.util
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_the_full_model_beats_the_baselines_on_nine_of_ten(shared_data: Path) -> None:
    folder = shared_data / "middlebury_charts"
    if not folder.is_dir():
        pytest.skip(f"no {folder}")
    spec = importlib.util.spec_from_file_location("middlebury_table", EXAMPLES / "middlebury_table.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["middlebury_table"] = module
    spec.loader.exec_module(module)
    rows = module.table(folder)
    assert len(rows) == 10
    best = [row.camera for row in rows if round(row.rmse["full model"], 4) <= round(min(row.rmse.values()), 4)]
    assert len(best) >= 9, f"only {best}"
    # What is printed in the repository is what the program says (8-bit data: the third decimal).
    stored = (EXAMPLES / "middlebury_table.md").read_text()
    for row in rows:
        line = next(line for line in stored.splitlines() if line.startswith(f"| {row.camera} |"))
        last = float(line.split("|")[-2].strip(" *"))
        assert last == pytest.approx(row.rmse["full model"], abs=0.002)
