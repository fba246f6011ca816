"""LUT files, read back by OpenColorIO in float32, are the LUT in memory."""

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from lutforge.colour.colour_difference import delta_e_2000
from lutforge.errors import LutError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.luts.bake import bake
from lutforge.luts.dialects import DIALECTS
from lutforge.luts.lut import Lut
from lutforge.luts.processor import evaluate, file_processor
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.luts.verify import verify
from lutforge.luts.write import SUFFIXES, write_lut
from lutforge.model.lattice import grid, uniform_levels
from lutforge.solvers.node_levels import snap_levels

EXACT = 1e-5


def worst_case(
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0),
    interpolation: Interpolation = "tetrahedral",
    size: int = 33,
) -> Lut:
    """Random node values, so that a misplaced node shows at full scale; node levels bunched near black."""
    axis = snap_levels(np.linspace(0, 1, size) ** 3, SHAPER_SIZE)
    cube = np.random.default_rng(5).random((size, size, size, 3))
    return Lut(
        np.array(gain),
        (axis, axis, axis),
        cube,
        np.eye(3),
        interpolation=interpolation,
        title="Canon “S40” standard\nrender",
        comments=("white balance: daylight", "", "größte Genauigkeit"),
    )


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("name", ["a.clf", "a.ctf", "a.resolve.cube"])
def test_a_bunched_random_lattice_is_exact(tmp_path: Path, name: str, interpolation: Interpolation) -> None:
    lut = worst_case(interpolation=interpolation)
    written = lut.write(tmp_path / name)
    assert written.what_was_lost == ""
    error = verify(written.path, lut, lut, display_referred=False)
    assert error.max < EXACT
    assert error.samples > 80_000
    assert error.mean_de00 is None


@pytest.mark.parametrize("gain", [(2.1, 1.0, 1.43), (0.6, 1.0, 0.8)])
def test_clf_holds_gain_and_matrix_exactly(tmp_path: Path, gain: tuple[float, float, float]) -> None:
    matrix = np.array([[1.5, -0.4, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.5, 1.5]])
    lut = replace(worst_case(gain), matrix=matrix)
    written = lut.write(tmp_path / "a.clf")
    assert written.what_was_lost == ""
    assert verify(written.path, lut, lut, display_referred=False).max < EXACT


@pytest.mark.parametrize("gain", [(2.1, 1.0, 1.43), (0.6, 1.0, 0.8)])
def test_resolve_cube_holds_the_folded_lut_exactly(tmp_path: Path, gain: tuple[float, float, float]) -> None:
    lut = worst_case(gain)
    written = write_lut(lut, tmp_path / "a.cube", dialect="resolve")
    assert "folded" in written.what_was_lost
    folded = lut.folded()
    assert verify(written.path, folded, folded, display_referred=False).max < EXACT


def test_plain_cube_holds_the_resampled_lut_exactly(tmp_path: Path) -> None:
    lut = worst_case()
    written = lut.write(tmp_path / "a.cube")
    assert "3D only" in written.format
    assert "uniform 65³" in written.what_was_lost
    plain = lut.without_shaper(65)
    assert verify(written.path, plain, plain, display_referred=False).max < EXACT
    lines = written.path.read_text("ascii").splitlines()
    assert lines[0] == 'TITLE "Canon ?S40? standard render"'
    assert lines[1:3] == ["# white balance: daylight", "# grote Genauigkeit"] or lines[2].startswith("# gro")
    assert lines[3:6] == ["LUT_3D_SIZE 65", "DOMAIN_MIN 0.0 0.0 0.0", "DOMAIN_MAX 1.0 1.0 1.0"]
    assert len(lines) == 6 + 65**3


def test_a_uniform_lut_loses_nothing_in_a_plain_cube(tmp_path: Path) -> None:
    cube = np.random.default_rng(0).random((17, 17, 17, 3))
    lut = Lut(np.ones(3), uniform_levels(17), cube, np.eye(3))
    for name, dialect in (("a.cube", None), ("b.cube", "resolve"), ("c.clf", None)):
        written = write_lut(lut, tmp_path / name, dialect)
        assert written.what_was_lost == ""
        assert verify(written.path, lut, lut, display_referred=False).max < EXACT
    assert "LUT_1D_SIZE" not in (tmp_path / "b.cube").read_text()
    assert "LUT1D" not in (tmp_path / "c.clf").read_text()


def test_red_varies_fastest_in_cube_files(tmp_path: Path) -> None:
    """Adobe Cube LUT Specification 1.0: the red index advances first."""
    lut = Lut(np.ones(3), uniform_levels(2), grid(uniform_levels(2)), np.eye(3))
    lut.write(tmp_path / "a.cube")
    rows = [line for line in (tmp_path / "a.cube").read_text().splitlines() if re.match(r"[\d.-]+ ", line)]
    assert [row.split()[0][0] + row.split()[1][0] + row.split()[2][0] for row in rows] == [
        "000", "100", "010", "110", "001", "101", "011", "111",
    ]  # fmt: skip


def test_the_resolve_dialect_is_what_opencolorio_accepts(tmp_path: Path) -> None:
    written = write_lut(worst_case(size=5), tmp_path / "a.shaper.cube")
    text = written.path.read_text("ascii")
    assert "TITLE" not in text
    assert "DOMAIN" not in text
    header = [line for line in text.splitlines()[:10] if line.startswith("LUT")]
    assert header == [
        "LUT_1D_SIZE 65536",
        "LUT_1D_INPUT_RANGE 0.0 1.0",
        "LUT_3D_SIZE 5",
        "LUT_3D_INPUT_RANGE 0.0 1.0",
    ]
    assert text.splitlines()[0].startswith("# Canon")


def test_extreme_inputs_read_as_in_memory(tmp_path: Path) -> None:
    lut = worst_case((2.0, 1.0, 0.5))
    x = np.array([[np.nan, 0.5, 0.5], [-1, 0.5, 2], [np.inf, -np.inf, 0.5], [1e30, 1e-30, -0.0]], dtype=np.float32)
    for name in ("a.clf", "a.resolve.cube"):
        written = lut.write(tmp_path / name)
        wanted = lut if name == "a.clf" else lut.folded()
        np.testing.assert_allclose(evaluate(file_processor(written.path), x), wanted(x), atol=EXACT)


@pytest.mark.parametrize("name", ["a.clf", "a.ctf", "a.cube", "a.resolve.cube", "a.spi1d"])
def test_the_same_lut_is_the_same_file(tmp_path: Path, name: str) -> None:
    lut = worst_case((1.5, 1.0, 1.2), size=9)
    lut.write(tmp_path / name)
    first = (tmp_path / name).read_bytes()
    lut.write(tmp_path / name)
    assert (tmp_path / name).read_bytes() == first


def test_writing_again_is_seen_by_verify(tmp_path: Path) -> None:
    """OpenColorIO caches files by path; a stale read would compare the old file."""
    lut = worst_case(size=5)
    lut.write(tmp_path / "a.clf")
    assert verify(tmp_path / "a.clf", lut, lut, display_referred=False).max < EXACT
    other = replace(lut, cube=1 - lut.cube)
    other.write(tmp_path / "a.clf")
    assert verify(tmp_path / "a.clf", other, other, display_referred=False).max < EXACT
    assert verify(tmp_path / "a.clf", lut, lut, display_referred=False).max > 0.5


def test_spi_pair_is_shaper_then_cube(tmp_path: Path) -> None:
    lut = worst_case((1.3, 1.0, 1.1), size=9)
    write_lut(lut, tmp_path / "a.spi3d")
    x = np.random.default_rng(0).random((2000, 3)).astype(np.float32)
    shaped = evaluate(file_processor(tmp_path / "a.spi1d"), x)
    np.testing.assert_allclose(evaluate(file_processor(tmp_path / "a.spi3d"), shaped), lut.folded()(x), atol=EXACT)


def test_delta_e_2000_of_published_pairs() -> None:
    """Grey steps of sRGB: L* from CIE 15; CIEDE2000 of neutrals is ΔL* / S_L (Sharma et al. 2005)."""
    a, b = np.full((1, 3), 0.5), np.full((1, 3), 0.52)

    def lightness(v: float) -> float:
        y = ((v + 0.055) / 1.055) ** 2.4
        return float(116 * np.cbrt(y) - 16)

    l1, l2 = lightness(0.5), lightness(0.52)
    mean = (l1 + l2) / 2
    s_l = 1 + 0.015 * (mean - 50) ** 2 / np.sqrt(20 + (mean - 50) ** 2)
    assert delta_e_2000(a, b)[0] == pytest.approx((l2 - l1) / s_l, abs=2e-3)


def test_verify_reports_a_known_difference(tmp_path: Path) -> None:
    lut = Lut(np.ones(3), uniform_levels(5), grid(uniform_levels(5)), np.eye(3))
    lut.write(tmp_path / "a.cube")
    error = verify(tmp_path / "a.cube", lambda x: np.asarray(x) + 0.01, lut)
    assert error.max == pytest.approx(0.01 * np.sqrt(3), rel=1e-4)
    assert error.mean == pytest.approx(error.max, rel=1e-4)
    assert error.max_de00 is not None
    assert 0.2 < error.max_de00 < 5
    assert "dE00" in str(error)


def test_clear_refusals(tmp_path: Path) -> None:
    lut = worst_case(size=5)
    with pytest.raises(LutError, match=r"suffix \"\.xyz\""):
        lut.write(tmp_path / "a.xyz")
    with pytest.raises(LutError, match="unknown dialect"):
        lut.write(tmp_path / "a.cube", "paint")
    with pytest.raises(LutError, match="2 to 64"):
        write_lut(lut, tmp_path / "a.cube", "aftereffects", size=65)
    assert list(tmp_path.iterdir()) == []


def test_unreadable_luts_are_one_line(tmp_path: Path) -> None:
    (tmp_path / "empty.cube").touch()
    (tmp_path / "text.cube").write_text("hello\n")
    (tmp_path / "cut.clf").write_text("<ProcessList id='x'><LUT1D>")
    (tmp_path / "lut.unknown").write_text("1 2 3\n")
    (tmp_path / "titled.cube").write_text('TITLE "x"\nLUT_1D_SIZE 2\nLUT_3D_SIZE 2\n0 0 0\n1 1 1\n' + "0 0 0\n" * 8)
    for name, words in [
        ("none.cube", "No such file"),
        (".", "folder|not a LUT"),
        ("empty.cube", "empty"),
        ("text.cube", "cannot read it"),
        ("cut.clf", "cannot read it"),
        ("lut.unknown", "cannot read it"),
        ("titled.cube", "neither TITLE nor DOMAIN"),
    ]:
        with pytest.raises(LutError, match=words) as caught:
            file_processor(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_paths_with_variables_of_opencolorio(tmp_path: Path) -> None:
    folder = tmp_path / "100% $HOME ü"
    lut = worst_case(size=5)
    written = lut.write(folder / "a$b.clf")
    assert verify(written.path, lut, lut, display_referred=False).max < EXACT


def test_the_interpolation_asked_for_is_used(tmp_path: Path) -> None:
    lut = worst_case(size=9)
    written = lut.write(tmp_path / "a.shaper.cube")
    for method in INTERPOLATIONS:
        wanted = replace(lut, interpolation=method)
        assert verify(written.path, wanted, wanted, display_referred=False).max < EXACT
    assert verify(written.path, lut, lut, interpolation="trilinear", display_referred=False).max > 0.01


def test_tables_of_one_dimension_are_read_quietly(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "curve.cube"
    path.write_text("LUT_1D_SIZE 2\n0 0 0\n1 0.5 1\n")
    got = evaluate(file_processor(path), [[0.1, 0.2, 0.3]])
    np.testing.assert_allclose(got, [[0.1, 0.1, 0.3]], atol=1e-6)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("dialect", sorted(name for name in DIALECTS if ".cube" in DIALECTS[name].reads))
def test_every_dialect_writes_a_readable_cube(tmp_path: Path, dialect: str) -> None:
    written = write_lut(worst_case(size=5), tmp_path / "a.cube", dialect, size=None)
    assert file_processor(written.path) is not None
    assert ("LUT_1D_SIZE" in written.path.read_text()) == DIALECTS[dialect].shaper
    assert written.path.suffix in SUFFIXES


@pytest.mark.parametrize("name", ["a.clf", "a.cube", "a.resolve.cube"])
def test_ociochecklut_agrees(tmp_path: Path, name: str) -> None:
    tool = shutil.which("ociochecklut", path=str(Path(sys.executable).parent))
    if tool is None:
        pytest.skip("ociochecklut is not in this environment")
    lut = worst_case(size=5)
    written = lut.write(tmp_path / name)
    wanted = (lut.without_shaper(65) if name == "a.cube" else lut)(np.array([0.2, 0.4, 0.6]))
    run = subprocess.run([tool, str(written.path), "0.2", "0.4", "0.6"], capture_output=True, text=True, check=True)
    got = [float(number) for number in run.stdout.split()[-3:]]
    # The tool reads .cube files with its own interpolation; only CLF names one.
    np.testing.assert_allclose(got, wanted, atol=1e-5 if name == "a.clf" else 0.3)


def test_a_hald_image_is_verified_without_opencolorio(tmp_path: Path) -> None:
    def look(x: ArrayLike) -> NDArray[np.float64]:
        return np.asarray(x, dtype=np.float64) ** [[0.8, 0.9, 1.1]]

    written = bake(look, 33).write(tmp_path / "look.png")
    error = verify(written.path, look, written.lut)
    assert error.mean < 1e-3
    assert error.mean_de00 is not None
    assert verify(written.path, lambda x: look(x) * 0.9, written.lut).mean > 0.03
