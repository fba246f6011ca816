"""What samples are of survives their table, and is one thing in all of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lutforge.errors import CalibrationError
from lutforge.model.provenance import Chart, Developed, OwnRaw
from lutforge.pipeline.provenance import provenance_of
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.samples.table import read_samples
from tests.cases.samples import made_samples

KINDS: list[OwnRaw | Developed | Chart] = [
    OwnRaw(),
    Developed("darktable 4.2.1", "linear-rec2020"),
    Developed("chart maker's own program", "srgb"),
    Chart("classic", "D50", "linear-prophoto"),
]


def samples_of(kind: OwnRaw | Developed | Chart) -> SampleSet:
    samples = made_samples(12)

    def column(text: str) -> np.ndarray:
        return np.full(len(samples), text)

    match kind:
        case OwnRaw():
            return samples
        case Developed(program, space):
            return replace(samples, raw_space=column(space), developer=column(program))
        case Chart(name, light, space):
            return replace(samples, raw_space=column(space), chart=column(name), chart_light=column(light))


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_a_table_states_what_its_samples_are_of(kind: OwnRaw | Developed | Chart, suffix: str, tmp_path: Path) -> None:
    samples_of(kind).save(tmp_path / f"a{suffix}")
    again = read_samples(tmp_path / f"a{suffix}")
    assert provenance_of(again) == kind
    assert again.is_own_raw == isinstance(kind, OwnRaw)


@pytest.mark.parametrize("second", KINDS[1:], ids=str)
def test_samples_of_two_kinds_are_refused(second: OwnRaw | Developed | Chart) -> None:
    both = concatenate([samples_of(KINDS[0]), samples_of(second)])
    with pytest.raises(CalibrationError, match=rf"of several kinds: RAW, {second}.* calibrate each by itself"):
        provenance_of(both)
