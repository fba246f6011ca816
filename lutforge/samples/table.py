"""Sample tables as samples: RAW and JPEG values in their ranges, multipliers with green = 1."""

import math
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from lutforge.boundary import path_of, reading
from lutforge.errors import SampleError
from lutforge.samples.columns import COLUMNS_OF, RAW_RANGE
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table_file import read_columns


def read_samples(path: str | Path) -> SampleSet:
    """Read a sample table, .csv or .npz (one array a column).

    Columns may be in any order, unknown ones are ignored. Optional are `wb_*`, `raw_camera`, `x` and `y`, `lens`,
    `focal_mm`, `aperture`, `raw_space`, `developer`, `chart`, `chart_light`, `dng_camera`; an empty cell of these, or
    of the exposure, means unknown.

    Args:
        path: of the table. RAW lies in [-0.05, 1], sRGB in [0, 1]; multipliers are scaled to green = 1.

    Returns:
        The samples, one a row.

    Raises:
        SampleError: in one line that names file, line or row, column and text.
    """
    path = path_of(path, "a sample table")
    columns = read_columns(path)
    with reading(path, "a sample table", SampleError):
        if not len(columns["camera"]):
            raise SampleError(f"{path}: a header but no samples; add one sample a line")
        arrays: dict[str, Any] = {"wb": np.full((len(columns["camera"]), 3), math.nan), "raw_camera": columns["camera"]}
        arrays |= {name: values for name, values in columns.items() if name not in chain(*COLUMNS_OF.values())}
        for name, group in COLUMNS_OF.items():
            if group[0] in columns:
                arrays[name] = np.stack([columns[column] for column in group], axis=1)
        arrays["raw"] = np.clip(arrays["raw"], *RAW_RANGE)
        arrays["srgb"] = np.clip(arrays["srgb"], 0.0, 1.0)
        arrays["wb"] = arrays["wb"] / arrays["wb"][:, 1:2]
        arrays["raw_camera"] = np.where(arrays["raw_camera"] == "", arrays["camera"], arrays["raw_camera"])
        return SampleSet(**arrays)
