"""LUT files, read back by OpenColorIO in float32, are the LUT in memory."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.luts.formats import FORMATS
from lutforge.luts.lut_programs import PROGRAMS
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.reading import read_lut, trusted_processor
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import MAX_SHAPER_SIZE
from lutforge.luts.target import files_for, target_of
from lutforge.luts.verification import verify
from lutforge.model.camera_profile import load_profile
from lutforge.model.lattice import grid, snap_levels, uniform_levels
from lutforge.pipeline.baking import bake
from tests.cases.pictures import lut_of_nodes
from tests.cases.profiles import small_profile
from tests.cases.same_bytes import same_bytes
from tests.conftest import CommandLine

WITHIN = 1e-5
IDENTITY = Lut((Cube(grid(uniform_levels(5))),))


def worst_case(
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0),
    interpolation: Interpolation = "tetrahedral",
    size: int = 33,
    matrix: Array | None = None,
) -> Lut:
    """Random node values, so that a misplaced node shows at full scale; node levels bunched near black."""
    axis = snap_levels(np.linspace(0, 1, size) ** 3, MAX_SHAPER_SIZE)
    return lut_of_nodes(
        (axis, axis, axis), np.random.default_rng(5).random((size, size, size, 3)), gain, matrix,
        interpolation=interpolation, title="Canon “S40” standard\nrender",
        comments=("white balance: daylight", "", "größte Genauigkeit"),
    )  # fmt: skip


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("name", ["a.clf", "a.ctf", "a.cube", "a.resolve.cube", "a.spi1d", "a.spi3d"])
def test_a_bunched_random_lattice_is_exact(tmp_path: Path, name: str, interpolation: Interpolation) -> None:
    lut = worst_case(interpolation=interpolation)
    path = lut.write(tmp_path / name)
    error = verify(path, lut, lut, display_referred=False)
    assert error.max < WITHIN
    assert error.samples > 80_000
    assert error.mean_de00 is None


@pytest.mark.parametrize("name", ["a.clf", "a.ctf", "a.resolve.cube", "a.csp", "a.cube", "a.png", "a.tif", "a.3dl"])
def test_what_is_written_is_read_back(tmp_path: Path, name: str) -> None:
    bits = 12 if name == "a.3dl" else 16
    if name in ("a.cube", "a.png", "a.tif", "a.3dl"):
        size = 4 if bits == 16 else 17
        lut = Lut((Cube(grid(uniform_levels(size)) ** 0.7, "trilinear"),), title="t")
    else:
        lut = worst_case(size=5)
    read, x = read_lut(lut.write(tmp_path / name)), np.random.default_rng(0).random((500, 3))
    if read.cube is not None and read.cube.interpolation != lut.interpolation:  # the file names none
        read = replace(read, ops=(*read.ops[:-1], replace(read.cube, interpolation=lut.interpolation)))
    np.testing.assert_allclose(read(x), lut(x), atol=1e-5 if bits == 16 else 0.5 / 4095 + 1e-9)
    if name in ("a.cube", "a.png", "a.tif"):
        assert read.title == "t"
    assert bits == 16 or read.metadata.bits == 12


@pytest.mark.parametrize("name", ["a.cube", "a.csp", "a.spi1d", "a.3dl", "a.png"])
def test_writing_refuses_what_the_file_cannot_hold(tmp_path: Path, name: str) -> None:
    """One line that says which form the file needs; nothing is fitted or sampled."""
    for lut in (worst_case((2.0, 1.0, 1.5), size=5), Lut((*IDENTITY.ops, Curve(np.array([[0.0] * 3, [1.0] * 3]))))):
        with pytest.raises(LutError, match=r"bake\(transform, form=\"(shaper|plain)\"\)") as caught:
            lut.write(tmp_path / name)
        assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_shaper_is_refused_where_only_a_cube_is_held(tmp_path: Path) -> None:
    levels = tuple(snap_levels(np.linspace(0, 1, 17) ** p, MAX_SHAPER_SIZE) for p in (1.5, 2.0, 2.5))
    lut = lut_of_nodes((levels[0], levels[1], levels[2]), grid(uniform_levels(17)))
    with pytest.raises(LutError, match='form="plain"'):
        lut.write(tmp_path / "a.3dl")
    with pytest.raises(LutError, match="choose a size"):
        Lut((Cube(grid(uniform_levels(18))),)).write(tmp_path / "a.3dl")
    with pytest.raises(LutError, match="129"):
        Lut((Cube(np.zeros((130, 130, 130, 3))),)).write(tmp_path / "a.cube")


def test_a_plain_cube_file_says_what_it_is(tmp_path: Path) -> None:
    lut = Lut((Cube(np.random.default_rng(0).random((17, 17, 17, 3))),), "Canon “S40”", ("größte Genauigkeit",))
    for name in ("a.cube", "b.cube", "c.clf"):
        assert verify(lut.write(tmp_path / name), lut, lut, display_referred=False).max < WITHIN
    lines = (tmp_path / "a.cube").read_text("ascii").splitlines()
    assert lines[:2] == ['TITLE "Canon ?S40?"', "# grote Genauigkeit"] or lines[1].startswith("# gro")
    assert lines[2:5] == ["LUT_3D_SIZE 17", "DOMAIN_MIN 0.0 0.0 0.0", "DOMAIN_MAX 1.0 1.0 1.0"]
    assert len(lines) == 5 + 17**3
    assert "LUT1D" not in (tmp_path / "c.clf").read_text()


def test_extreme_inputs_read_as_in_memory(tmp_path: Path) -> None:
    x = np.array([[np.nan, 0.5, 0.5], [-1, 0.5, 2], [np.inf, -np.inf, 0.5], [1e30, 1e-30, -0.0]], dtype=np.float32)
    for name, lut in (("a.clf", worst_case((2.0, 1.0, 0.5))), ("a.resolve.cube", worst_case())):
        np.testing.assert_allclose(evaluate(trusted_processor(lut.write(tmp_path / name)), x), lut(x), atol=1e-5)


@pytest.mark.parametrize("name", ["a.clf", "a.ctf", "a.cube", "a.csp", "a.spi1d"])
def test_the_same_lut_is_the_same_file(tmp_path: Path, name: str) -> None:
    lut = worst_case(size=9)
    first = lut.write(tmp_path / name).read_bytes()
    assert same_bytes(lut.write(tmp_path / name), first)


def test_writing_again_is_seen_by_verify(tmp_path: Path) -> None:
    """OpenColorIO caches files by path; a stale read would compare the old file."""
    lut, path = worst_case(size=5), tmp_path / "a.clf"
    assert verify(lut.write(path), lut, lut, display_referred=False).max < WITHIN
    assert lut.cube is not None
    other = replace(lut, ops=(*lut.ops[:-1], Cube(1 - lut.cube.values)))
    assert verify(other.write(path), other, other, display_referred=False).max < WITHIN
    assert verify(path, lut, lut, display_referred=False).max > 0.5


def test_verify_reports_a_known_difference(tmp_path: Path) -> None:
    error = verify(IDENTITY.write(tmp_path / "a.cube"), lambda x: np.asarray(x) + 0.01)
    assert error.max == pytest.approx(0.01 * np.sqrt(3), rel=1e-4)
    assert error.mean == pytest.approx(error.max, rel=1e-4)
    assert error.max_de00 is not None
    assert 0.2 < error.max_de00 < 5
    assert "ΔE00" in str(error)


def test_clear_refusals(tmp_path: Path) -> None:
    with pytest.raises(LutError, match=r"suffix \"\.xyz\""):
        worst_case(size=5).write(tmp_path / "a.xyz")
    with pytest.raises(LutError, match="unknown program"):
        bake(IDENTITY, tmp_path / "a.cube", program="paint")
    with pytest.raises(LutError, match="rawtherapee does not read"):
        bake(IDENTITY, tmp_path / "a.cube", program="rawtherapee")
    with pytest.raises(LutError, match="2 to 64"):
        bake(IDENTITY, tmp_path / "a.cube", program="aftereffects", size=65)
    assert list(tmp_path.iterdir()) == []


def test_paths_with_variables_of_opencolorio(tmp_path: Path) -> None:
    lut = worst_case(size=5)
    path = lut.write(tmp_path / "100% $HOME ü" / "a$b.clf")
    assert verify(path, lut, lut, display_referred=False).max < WITHIN
    assert read_lut(path).summary == lut.summary


def test_the_interpolation_asked_for_is_used(tmp_path: Path) -> None:
    lut = worst_case(size=9)
    path = lut.write(tmp_path / "a.shaper.cube")
    assert lut.cube is not None
    for method in INTERPOLATIONS:
        by_method = replace(lut, ops=(*lut.ops[:-1], replace(lut.cube, interpolation=method)))
        assert verify(path, by_method, by_method, display_referred=False).max < WITHIN
    assert verify(path, lut, lut, interpolation="trilinear", display_referred=False).max > 0.01


def test_tables_of_one_dimension_are_read_quietly(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "curve.cube"
    path.write_text("LUT_1D_SIZE 2\n0 0 0\n1 0.5 1\n")
    got = evaluate(trusted_processor(path), [[0.1, 0.2, 0.3]])
    np.testing.assert_allclose(got, [[0.1, 0.1, 0.3]], atol=1e-6)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("program", sorted(name for name in PROGRAMS if ".cube" in PROGRAMS[name].reads))
def test_every_program_gets_a_readable_cube(tmp_path: Path, program: str) -> None:
    path = tmp_path / "a.cube"
    lut = bake(IDENTITY, path, program=program.upper(), size=5)
    assert lut.interpolation == PROGRAMS[program].interpolation
    assert trusted_processor(path) is not None
    assert ("LUT_1D_SIZE" in path.read_text()) == PROGRAMS[program].shaper
    assert path.suffix in FORMATS


def look(x: ArrayLike) -> Array:
    """A steep look."""
    y = np.asarray(x, dtype=np.float64) ** 0.4
    return np.asarray(np.clip(y @ np.array([[1.1, -0.1, 0.0], [0.05, 0.9, 0.05], [0.0, -0.2, 1.2]]).T, 0.0, 1.0))


def parsed(path: Path) -> np.ndarray:
    """(17, 17, 17, 3), red index first: three header lines, a blank one, then codes of 12 bits, red fastest."""
    data = path.read_bytes()
    assert b"\r" not in data
    lines = data.decode("ascii").split("\n")
    assert lines[:4] == ["# panasonic vlt file version 1.0", '# source vlt file ""', "LUT_3D_SIZE 17", ""]
    codes = np.array([line.split() for line in lines[4:-1]], dtype=np.int64)
    assert codes.shape == (17**3, 3)
    assert codes.min() >= 0
    assert codes.max() <= 4095
    return codes.reshape(17, 17, 17, 3).transpose(2, 1, 0, 3) / 4095


def test_a_vlt_is_written_as_published(tmp_path: Path) -> None:
    lut = bake(look, tmp_path / "look.vlt")
    assert lut.cube is not None
    assert np.abs(parsed(tmp_path / "look.vlt") - np.clip(lut.cube.values, 0, 1)).max() <= 0.5 / 4095 + 1e-12
    again = read_lut(tmp_path / "look.vlt")
    assert again.cube is not None
    assert np.array_equal(again.cube.values, parsed(tmp_path / "look.vlt"))


@pytest.mark.parametrize(("line", "text"), [(2, "LUT_3D_SIZE 33"), (4, "0 0 5000"), (4, "0 0 0.5"), (4, "0 0")])
def test_other_numbers_in_a_vlt_are_refused(tmp_path: Path, line: int, text: str) -> None:
    path = tmp_path / "look.vlt"
    bake(look, path)
    lines = path.read_text().split("\n")
    lines[line] = text
    path.write_text("\n".join(lines))
    with pytest.raises(LutError, match=r"look\.vlt"):
        read_lut(path)


NAMED = (
    *("resolve", "premiere", "photoshop", "aftereffects", "finalcut", "nuke", "baselight"),
    *("flame", "ffmpeg", "obs", "darktable", "rawtherapee", "gimp", "blender"),
)


@pytest.fixture(scope="module")
def profile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("profile") / "camera.npz"
    small_profile("A Camera: №1/x").save(path)
    return path


@pytest.mark.parametrize("program", NAMED)
def test_every_program_has_its_files(program: str) -> None:
    files = files_for(PROGRAMS[program], "../A Camera: №1 RAW to standard/daylight")
    first, *fallback = files
    assert first.suffix in PROGRAMS[program].reads
    assert files[first] is PROGRAMS[program]
    assert len(first.parts) == 1
    assert first.name == first.name.encode("ascii", "ignore").decode()
    if PROGRAMS[program].shaper:
        assert [path.name.endswith(".plain.cube") for path in fallback] == [True]


def test_no_dialect_takes_the_place_of_another() -> None:
    """Plain cubes and cubes with a shaper have different names, so that baking for one program spares the other's."""
    shaped: set[str] = set()
    plain: set[str] = set()
    for name in NAMED:
        for path, reader in files_for(PROGRAMS[name], "look").items():
            if path.suffix == ".cube":
                (shaped if target_of(path, reader).form == "shaper" else plain).add(path.name)
    assert shaped
    assert plain
    assert not shaped & plain


@pytest.mark.slow
def test_a_program_without_a_name_and_a_file_named_twice(tmp_path: Path, profile: Path, lutforge: CommandLine) -> None:
    bake = partial(lutforge, "bake", profile, cwd=tmp_path)
    words = ("refinish", "--from", "standard/daylight", "--to", "standard/daylight", "--size", "5")
    run = bake(*words, "--for", "resolve")
    assert len(list(tmp_path.glob("*.cube"))) == 2
    run = bake(*words, "-o", "a.clf", "-o", "./a.clf")
    assert "named twice, written once" in run.stderr
    assert run.stdout.count("a.clf:") == 1


@pytest.mark.slow
def test_steps_are_the_model_and_files_say_what_goes_in(tmp_path: Path, profile: Path, lutforge: CommandLine) -> None:
    bake = partial(lutforge, "bake", profile, cwd=tmp_path)
    run = bake(
        "refinish", "--from", "standard/daylight", "--to", "standard/daylight", "--ev", "-1", "-o", "a.clf"
    )  # fmt: skip
    # Colours near white fade into it in the cube between.
    assert "Cube 5³ → Matrix → Range → Curve 4096 → Cube 33³ → Range → Cube 5³" in run.stdout
    # The cube of highlights is within a code in the mean.
    codes = np.random.default_rng(1).integers(0, 256, (4096, 3)) / 255
    model = load_profile(profile).refinish("standard/daylight", "standard/daylight", -1.0)
    assert np.abs(evaluate(trusted_processor(tmp_path / "a.clf"), codes) - model(codes)).mean() < 1 / 255
    linear = bake("linearize", "--from", "standard/daylight", "-o", "b.png", "--size", "9")
    assert "whole numbers band the darks of linear light" in linear.stderr
    assert "8 bits would show bands" in linear.stderr
    scene = ("render", "--space", "acescg", "--ev", "-1", "--to", "standard/daylight", "-o", "c.clf")
    bake(*scene)
    assert "not for JPEGs" in (tmp_path / "c.clf").read_text()
    assert "input: scene-linear acescg" in (tmp_path / "c.clf").read_text()
