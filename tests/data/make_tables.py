"""Derive the tables of this folder from the photographs and published models that they come from.

    LUTFORGE_TEST_DATA=FOLDER python -m tests.data.make_tables

FOLDER holds canon_powershot_s40, nus_nikon_d40 and middlebury_charts; README.md says where each was published.
"""

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np

import lutforge as lf
from lutforge.model.published_model import read_published_model
from lutforge.samples.sample_set import SampleSet
from tests.cases.real_data import CHARTS, D40, S40


def chart_samples(table: Path) -> SampleSet:
    """Return the means of chart patches as samples. RAW and JPEG have 8 bits; the exposures of a light double."""
    found: dict[tuple[str, str, str, str], dict[str, list[float]]] = {}
    with table.open() as stream:
        for line in csv.DictReader(stream):
            key = (line["camera"], line["illum"], line["exposure"], line["patch"])
            found.setdefault(key, {})[line["kind"]] = [float(line[channel]) / 255 for channel in "RGB"]
    keys = sorted(found)
    samples = SampleSet.from_arrays(
        [found[key]["raw"] for key in keys], [found[key]["jpg"] for key in keys], camera="several",
        white_balance="wb1", shot=[f"light{light}-exposure{exposure}" for _, light, exposure, _ in keys],
        patch=[f"{light}-{int(patch):02d}" for _, light, _, patch in keys],
        exposure_s=[2.0 ** int(exposure) / 60 for _, _, exposure, _ in keys],
    )  # fmt: skip
    camera = np.array([key[0] for key in keys])
    return replace(samples, camera=camera, raw_camera=camera)


def main() -> None:
    source = Path(os.environ["LUTFORGE_TEST_DATA"])
    lf.sample(sorted((source / "canon_powershot_s40").glob("CRW_*.CRW"))).save(S40)
    chart_samples(source / "middlebury_charts" / "patch_means.csv").save(CHARTS)
    published = read_published_model(source / "nus_nikon_d40" / "other_white_balances")
    np.savez_compressed(
        D40, balanced=published.balanced.astype(np.float32), encoded=published.encoded.astype(np.float32),
        matrix=published.model.matrix, inverse_response=published.model.response.inverse,
        white_balances=np.array(list(published.white_balances)),
        multipliers=np.array([balance.multipliers for balance in published.white_balances.values()]),
    )  # fmt: skip


if __name__ == "__main__":
    main()
