"""Charts that were measured: CGATS tables as spectrophotometers' programs write them."""

from pathlib import Path

import colour
import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.colour.spectra import WAVELENGTHS, reflectances
from lutforge.errors import CalibrationError
from lutforge.samples.chart_kinds import chart_kind

NAMES = [f"{column}{row}" for row in (1, 2, 3, 4) for column in "ABCDEF"]
"""Of a ColorChecker Classic, row by row, as X-Rite names its patches."""


def table(path: Path, fields: str, names: list[str], values: Array, head: str = "CGATS.17") -> Path:
    rows = "\n".join(f"{name}\t" + "\t".join(map(str, row)) for name, row in zip(names, values.tolist(), strict=True))
    path.write_text(
        f'{head}\nORIGINATOR "a \xb5 program"\nNUMBER_OF_FIELDS {values.shape[1] + 1}\nBEGIN_DATA_FORMAT\n{fields}\n'
        f"END_DATA_FORMAT\nNUMBER_OF_SETS {len(names)}\nBEGIN_DATA\n{rows}\nEND_DATA\n",
        encoding="latin-1",
    )
    return path


@pytest.mark.parametrize(("prefix", "scale"), [("SPEC_", 100.0), ("SPECTRAL_NM", 1.0), ("nm", 1.0)])
def test_reflectances_look_as_a_light_makes_them(prefix: str, scale: float, tmp_path: Path) -> None:
    bands = np.flatnonzero((WAVELENGTHS >= 380) & (WAVELENGTHS <= 730) & (WAVELENGTHS % 10 == 0))
    values = scale * reflectances("ISO 17321-1")[:, bands]
    fields = "SAMPLE_NAME " + " ".join(f"{prefix}{WAVELENGTHS[band]:.0f}" for band in bands)
    own, classic = chart_kind(str(table(tmp_path / "own.txt", fields, NAMES, values))), chart_kind("classic")
    np.testing.assert_array_equal(own.centres, classic.centres)
    for light in ("D50", "A"):
        np.testing.assert_allclose(own.linear_srgb(light), classic.linear_srgb(light), atol=0.003)
    assert own.name == "own" and "own.txt" in own.source


def test_colours_under_d50_are_found_by_name_in_any_order(tmp_path: Path) -> None:
    wanted = chart_kind("classic2014").linear_srgb()  # under a D50 of more digits
    published = colour.CCS_COLOURCHECKERS["ColorChecker24 - After November 2014"]
    xyz = np.asarray(colour.xyY_to_XYZ(np.array(list(published.data.values()))), dtype=np.float64)
    lab = np.asarray(colour.XYZ_to_Lab(xyz, published.illuminant), dtype=np.float64)
    shuffled = np.random.default_rng(0).permutation(24)
    own = table(tmp_path / "own.cgats", "Sample_Name Lab_L Lab_a Lab_b", [NAMES[i] for i in shuffled], lab[shuffled])
    own.write_text(own.read_text(encoding="latin-1").replace(".", ","))  # as written in German
    np.testing.assert_allclose(chart_kind(str(own)).linear_srgb(), wanted, atol=5e-4)
    down = [f"{row}{column}" for row in "ABCD" for column in range(1, 7)]  # other charts count rows by letters
    own = table(tmp_path / "own.ti3", "SAMPLE_LOC XYZ_X XYZ_Y XYZ_Z", [f'"{name}"' for name in down], 100 * xyz, "CTI3")
    np.testing.assert_allclose(chart_kind(str(own)).linear_srgb(), wanted, atol=5e-4)


@pytest.mark.parametrize(
    ("fields", "row", "said"),
    [
        ("SAMPLE_NAME LAB_L", "A1 2 3", "do not fill 2 columns"),
        ("SAMPLE_NAME RGB_R", "A1 2", "no reflectances, LAB"),
        ("SAMPLE_NAME SPEC_500", "A1 2", "1 reflectances from 500 to 500"),
        ("SAMPLE_NAME LAB_L LAB_A LAB_B", "A1 nan 0 0", "no number"),
        ("SAMPLE_NAME LAB_L LAB_A LAB_B", "A1 x 0 0", "cannot be read as a CGATS table"),
        ("SAMPLE_NAME", "", "no table between"),
        ("SAMPLE_NAME LAB_L LAB_A LAB_B", "white 90 0 0", "not named A1, A2"),
    ],
)
def test_what_is_no_table_is_refused_in_a_line(fields: str, row: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "own.txt"
    path.write_text(f"BEGIN_DATA_FORMAT\n{fields}\nEND_DATA_FORMAT\nBEGIN_DATA\n{row}\n{'END_DATA' if row else ''}")
    with pytest.raises(CalibrationError, match=said) as refused:
        chart_kind(str(path))
    assert "own.txt" in str(refused.value) and "\n" not in str(refused.value)
