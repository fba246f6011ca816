"""The samples of a report: their colours, the shots they are from, and what to shoot next."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from lutforge.calibration.style_data import StyleData
from lutforge.evaluation.next_shots import colour_gaps
from lutforge.model.coverage import linearizing_error
from lutforge.model.profile_data import PictureStyle
from lutforge.report.page import Block, Picture, Points, Table, Text
from lutforge.report.sample_figures import chromaticity_figure
from lutforge.samples.extract import ShotSamples
from lutforge.samples.sample_set import SampleSet


def sample_blocks(samples: SampleSet, accounts: Sequence[ShotSamples]) -> Iterator[Block]:
    yield Picture("samples", chromaticity_figure(samples.srgb), "The JPEG colours of all samples.")
    by_name = {account.shot: account for account in accounts}
    rows = []
    for name, part in samples.by_shot():
        setting = f"{part.style[0]}/{part.white_balance[0]}"
        time = part.exposure_s[0]
        exposure = "–" if not np.isfinite(time) else f"{time:g} s" if time >= 0.3 else f"1/{1 / time:.0f} s"
        account = by_name.get(name)
        clipped = "–" if account is None else str(sum(account.clipped.values()))
        rejected = "–" if account is None else str(sum(account.rejected.values()))
        rows.append((name, setting, exposure, str(len(part)), clipped, rejected))
    yield Table("Shots", ("shot", "setting", "exposure", "samples", "areas clipped", "areas rejected"), tuple(rows))


def next_shots(data: Mapping[str, StyleData], styles: Mapping[str, PictureStyle]) -> Iterator[Block]:
    for name, style in data.items():
        gaps = colour_gaps(style.encoded, linearizing_error(styles[name]))
        if gaps:
            yield Text(f"{name}: of the colours that real surfaces have, these are known least:")
            yield Points(tuple(str(gap) for gap in gaps))
        else:
            yield Text(f"{name}: the samples come near most colours that real surfaces have.")
