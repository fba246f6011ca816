"""Batches as they come: pictures that are no plain RGB, layers, links, names, and what earlier runs left behind."""

import shlex
import shutil
import subprocess
from io import BytesIO
from pathlib import Path

import colour
import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest
from PIL import Image as Picture
from PIL import ImageCms

from lutforge.colour.icc_profile import ADOBE_RGB_NAME, adobe_rgb_profile
from lutforge.errors import ConfigError, ImageError
from lutforge.grading.batch import apply_batch
from lutforge.grading.grade import ConfigRecipe, LutRecipe
from lutforge.grading.image import apply_image
from lutforge.grading.inputs import find_inputs
from lutforge.images.read import ImageReader, is_premultiplied, read_image
from lutforge.luts.input_and_output import input_and_output_of, read_input_and_output
from lutforge.luts.ops import Cube
from lutforge.luts.reading import read_lut
from lutforge.luts.sequence import Lut
from lutforge.model.lattice import grid, uniform_levels
from lutforge.ocio.config import write_config
from lutforge.shots.tags import tags
from tests.cases.pictures import apply_to_pixels, write_cube, write_picture
from tests.cases.profiles import small_profile
from tests.ocio.test_config import SMALL


@pytest.fixture
def cube(tmp_path: Path) -> LutRecipe:
    return LutRecipe(write_cube(tmp_path / "look.cube"))


def test_colours_that_are_not_rgb_are_refused(tmp_path: Path, cube: LutRecipe) -> None:
    codes = np.random.default_rng(0).integers(0, 256, (20, 30, 4), dtype=np.uint8)
    Picture.fromarray(codes, "CMYK").save(tmp_path / "cmyk.jpg")
    Picture.fromarray(codes, "CMYK").save(tmp_path / "cmyk.tif")
    Picture.fromarray(codes[..., :3].copy(), "LAB").save(tmp_path / "lab.tif")
    Picture.fromarray(codes[..., 0].copy(), "L").save(tmp_path / "grey.jpg")
    write_picture(tmp_path / "chroma.exr", kind="float", names=("Y", "RY", "BY"))
    (tmp_path / "raw.NEF").touch()
    says = {"cmyk.jpg": "CMYK", "cmyk.tif": "CMYK", "lab.tif": "CIELAB", "grey.jpg": "greyscale"}
    says |= {"chroma.exr": "luminance and chroma", "raw.NEF": "a camera's profile"}
    result = apply_batch(cube, [tmp_path / name for name in says], tmp_path / "out")
    assert not result.done
    for failure, (name, word) in zip(result.failed, says.items(), strict=True):
        assert failure.reason.startswith(f"{tmp_path / name}: ")
        assert word in failure.reason


def test_layers_and_other_names_are_told(tmp_path: Path, cube: LutRecipe) -> None:
    names = {
        "layers.exr": ("R", "G", "B", "A", "diffuse.R", "diffuse.G", "diffuse.B"),
        "only.exr": ("d.R", "d.G", "d.B", "e.R", "e.G", "e.B"),
        "xyz.exr": ("X", "Y", "Z"),
    }
    for name, channels in names.items():
        write_picture(tmp_path / name, kind="float", names=channels)
    result = apply_batch(cube, [tmp_path / name for name in names], tmp_path / "out")
    assert [done.notes for done in result.done] == [
        ("R, G, B were graded; the layers diffuse are as they were",),
        ("d.R, d.G, d.B were graded; the layers e are as they were",),
        ("the channels X, Y, Z were graded as red, green and blue",),
    ]
    before, after = read_image(tmp_path / "layers.exr"), read_image(tmp_path / "out" / "layers.exr")
    assert after.spec.channelnames == before.spec.channelnames
    np.testing.assert_array_equal(after.pixels[..., 3:], before.pixels[..., 3:])


def test_pixels_that_are_no_numbers_are_counted(tmp_path: Path, cube: LutRecipe) -> None:
    pixels = np.full((20, 30, 3), 0.5, np.float32)
    pixels[3, :5, 1], pixels[4, 0], pixels[4, 1] = np.nan, np.inf, -np.inf
    write_picture(tmp_path / "a.exr", kind="float", pixels=pixels)
    (done,) = apply_batch(cube, [tmp_path / "a.exr"], tmp_path / "out").done
    assert done.notes == ("7 pixels are not finite numbers; what became of them means nothing",)
    assert np.isfinite(read_image(done.target).pixels).all()


@pytest.mark.parametrize(("name", "size", "kind", "channels"), [
    ("one.png", (1, 1), "uint8", 3), ("one.jpg", (1, 1), "uint8", 3), ("one.exr", (1, 1), "half", 4),
    ("alpha.png", (20, 30), "uint16", 4), ("ünïcødé 写真 #1.png", (9, 9), "uint16", 3), ("-o.png", (9, 9), "uint16", 3),
])  # fmt: skip
def test_small_odd_and_transparent_pictures(
    tmp_path: Path, cube: LutRecipe, name: str, size: tuple[int, int], kind: str, channels: int
) -> None:
    write_picture(tmp_path / name, size, kind, channels=channels)
    (done,) = apply_batch(cube, [tmp_path / name], tmp_path / "out").done
    before, after = read_image(tmp_path / name), read_image(tmp_path / "out" / name)
    expected = apply_to_pixels(cube.grade(done.source).processor, before.pixels, is_premultiplied(before.spec))
    expected = np.clip(expected, 0, 1) if kind.startswith("uint") else expected
    np.testing.assert_allclose(after.pixels, expected, atol=0.02 if name.endswith("jpg") else 0.003)
    assert after.spec.format == kind


def test_a_gif_has_its_alpha_last(tmp_path: Path, cube: LutRecipe) -> None:
    Picture.fromarray(np.random.default_rng(0).integers(0, 256, (9, 9), dtype=np.uint8), "L").save(tmp_path / "a.gif")
    (done,) = apply_batch(cube, [tmp_path / "a.gif"], tmp_path / "out", ".png").done
    assert read_image(done.target).pixels.shape == (9, 9, 4)


def test_links_are_images_of_their_own(tmp_path: Path, cube: LutRecipe) -> None:
    (tmp_path / "in").mkdir()
    write_picture(tmp_path / "in" / "a.png")
    (tmp_path / "in" / "b.png").symlink_to("a.png")
    (tmp_path / "in" / "gone.png").symlink_to("nowhere.png")
    (tmp_path / "in" / "loop").symlink_to(tmp_path / "in")
    images, _ = find_inputs([tmp_path / "in"], tmp_path / "out")
    result = apply_batch(cube, images, tmp_path / "out")
    assert [done.target.name for done in result.done] == ["a.png", "b.png"]
    assert [failure.reason for failure in result.failed] == [f"{tmp_path / 'in' / 'gone.png'}: no such file"]
    assert not (tmp_path / "out" / "b.png").is_symlink()


def test_raw_files_of_a_folder_are_rendered_unless_their_picture_is_there(tmp_path: Path) -> None:
    for name in ("a.NEF", "a.JPG", "b.CR2", "c.jpg"):
        (tmp_path / name).touch()
    images, notes = find_inputs([tmp_path], tmp_path / "out", raw=True)
    assert [path.name for path in images] == ["a.JPG", "b.CR2", "c.jpg"]
    assert notes == [f"{tmp_path}: 1 RAW file left out beside pictures of the same name; to render them, name them"]
    assert [path.name for path in find_inputs([tmp_path], tmp_path / "out")[0]] == ["a.JPG", "c.jpg"]


@pytest.mark.parametrize("suffix", [".clf", ".ctf", ".cube", ".csp"])
@pytest.mark.parametrize(("kind", "space"), [("render", "raw"), ("linearize", "acescg"), ("refinish", "raw")])
def test_a_lut_file_says_what_goes_in_and_what_comes_out(tmp_path: Path, suffix: str, kind: str, space: str) -> None:
    ends, levels = input_and_output_of(kind, space), uniform_levels(2)
    Lut((Cube(grid(levels)),), "x", ("LutForge 1", *ends.comments)).write(tmp_path / f"a{suffix}")
    assert read_input_and_output(read_lut(tmp_path / f"a{suffix}").comments) == ends
    assert read_input_and_output(read_lut(write_cube(tmp_path / "other.cube")).comments) is None


def test_scene_linear_light_in_eight_bits_is_told(tmp_path: Path) -> None:
    levels = uniform_levels(2)
    for kind in ("render", "linearize", "refinish"):
        comments = ("LutForge 1", *input_and_output_of(kind, "raw").comments)
        Lut((Cube(grid(levels)),), comments=comments).write(tmp_path / f"{kind}.clf")
    write_picture(tmp_path / "a.jpg")
    write_picture(tmp_path / "a.tif", kind="uint16")
    sources = [tmp_path / "a.jpg", tmp_path / "a.tif"]

    def told(kind: str, suffix: str | None = None) -> list[bool]:
        result = apply_batch(LutRecipe(tmp_path / f"{kind}.clf"), sources[: 2 - bool(suffix)], tmp_path / kind, suffix)
        assert not result.failed
        return [any("scene-linear" in note for note in done.notes) for done in result.done]

    assert told("render") == [True, False]
    assert told("linearize") == [True, False]
    assert told("linearize", ".exr") == [False]
    assert told("refinish") == [False, False]


def test_a_config_knows_which_of_its_spaces_are_linear() -> None:
    config = Path(__file__).parents[2] / "ocio_configs" / "nikon_d40" / "config.ocio"
    grade = ConfigRecipe(config, "Nikon D40 JPEG standard daylight", "ACEScg").grade(Path())
    assert (grade.takes_linear, grade.gives_linear) == (False, True)


def in_adobe_rgb(path: Path, **tags: str) -> Path:
    """A JPEG as cameras write it in Adobe RGB: EXIF says so, there is no ICC profile."""
    exif = Picture.Exif()
    exif._ifds[0x8769] = {0xA001: 65535, 0xA005: {1: "R03", 2: b"0100"}}  # Pillow has no other way to write it
    for number, text in ((0x010E, "description"), (0x010F, "make"), (0x0110, "model")):
        exif[number] = tags.get(text, "x")
    Picture.fromarray(np.random.default_rng(0).integers(0, 256, (20, 30, 3), dtype=np.uint8)).save(path, exif=exif)
    return path


def told_space(path: Path) -> tuple[int, str]:
    spec = read_image(path).spec
    return spec.get_int_attribute("Exif:ColorSpace"), spec.get_string_attribute("ICCProfile:profile_description")


def test_pictures_in_adobe_rgb_stay_so(tmp_path: Path, cube: LutRecipe) -> None:
    source = in_adobe_rgb(tmp_path / "a.jpg")
    (done,) = apply_batch(cube, [source], tmp_path / "out").done
    assert told_space(done.target) == (0xFFFF, "")
    assert tags(done.target)["Iop", 1] == "R03"
    (other,) = apply_batch(cube, [source], tmp_path / "other", suffix=".tif").done
    assert told_space(other.target) == (0xFFFF, ADOBE_RGB_NAME)
    (again,) = apply_batch(cube, [other.target], tmp_path / "again").done
    assert told_space(again.target) == (0xFFFF, ADOBE_RGB_NAME)
    write_picture(tmp_path / "plain.jpg", Exif_ColorSpace=1)
    (plain,) = apply_batch(cube, [tmp_path / "plain.jpg"], tmp_path / "out").done
    assert told_space(plain.target) == (1, "")


@pytest.mark.parametrize("name", [None, "", "sRGB, nearly", "Camera"])
def test_a_picture_in_another_space_is_told(tmp_path: Path, cube: LutRecipe, name: str | None) -> None:
    """What a profile does to colours tells whether it is sRGB; programs name it as they like, or not at all."""
    adobe, srgb = adobe_rgb_profile(), ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    assert ADOBE_RGB_NAME.encode() in adobe and "sRGB built-in".encode("utf-16-be") in srgb
    if name is not None:
        adobe = adobe.replace(ADOBE_RGB_NAME.encode(), name.encode().ljust(len(ADOBE_RGB_NAME), b"\0"))
        srgb = srgb.replace("sRGB built-in".encode("utf-16-be"), name.ljust(13).encode("utf-16-be"))
    profiles = {"adobe": adobe, "srgb": srgb, "broken": b"not a profile" * 20}
    for space, profile in profiles.items():
        Picture.fromarray(np.full((8, 8, 3), 99, np.uint8)).save(tmp_path / f"{space}.jpg", icc_profile=profile)
    pictures = [*(tmp_path / f"{space}.jpg" for space in profiles), in_adobe_rgb(tmp_path / "exif.jpg")]
    notes = ["; ".join(done.notes) for done in apply_batch(cube, pictures, tmp_path / "out").done]
    named = "Compatible with Adobe RGB" if name is None else ""
    assert f"the picture is in {named}" in notes[0] and notes[1] == ""
    assert "ICC profile is broken" in notes[2] and "the picture is in Adobe RGB" in notes[3]


def test_the_profile_of_adobe_rgb_is_adobe_rgb() -> None:
    """Against colour-science, through LittleCMS, to half a code."""
    codes = np.random.default_rng(0).integers(60, 200, (16, 16, 3), dtype=np.uint8)
    adobe, srgb = ImageCms.ImageCmsProfile(BytesIO(adobe_rgb_profile())), ImageCms.createProfile("sRGB")
    convert = ImageCms.buildTransform(adobe, srgb, "RGB", "RGB", renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC)
    converted = ImageCms.applyTransform(Picture.fromarray(codes), convert)
    assert converted is not None
    expected = 255 * colour.RGB_to_RGB(
        codes / 255, "Adobe RGB (1998)", "sRGB", apply_cctf_decoding=True, apply_cctf_encoding=True
    )
    inside = np.all((expected > 2) & (expected < 253), axis=-1)
    assert inside.sum() > 50
    np.testing.assert_allclose(np.asarray(converted)[inside], expected[inside], atol=0.6)


@pytest.mark.slow
def test_a_config_that_names_an_endless_lut_is_refused(tmp_path: Path) -> None:
    path = write_config([small_profile()], tmp_path / "config", inverse_size=SMALL)
    (path.parent / "luts" / "endless.csp").write_text("CSPLUTV100\n3D\n\nBEGIN METADATA\nx\n")
    path.write_text(path.read_text().replace("test_one_standard_linearize.clf", "endless.csp"))
    with pytest.raises(ConfigError, match=r"config\.ocio: .*seconds"):
        ConfigRecipe(path, "Test One JPEG standard daylight", "ACEScg").check()


def test_an_exr_whose_first_part_is_depth_names_the_part_to_grade(tmp_path: Path, cube: LutRecipe) -> None:
    """And the command that is named takes that part out."""
    path = tmp_path / "a render.exr"
    parts = [oiio.ImageSpec(16, 8, len(names), oiio.HALF) for names in ("Z", "XYZ", "RGB")]
    for name, part in zip(("Z", "XYZ", "RGB"), parts, strict=True):
        part.channelnames = tuple(name)
        part.attribute("oiio:subimagename", name)
    target = oiio.ImageOutput.create(str(path))
    assert target is not None
    target.open(str(path), tuple(parts))
    for index, part in enumerate(parts):
        if index:
            target.open(str(path), part, "AppendSubimage")
        target.write_image(np.full((8, 16, part.nchannels), 0.5, np.float32))
    target.close()
    with pytest.raises(ImageError, match=r"its first part holds Z alone; grade the part with colours: ") as refusal:
        apply_image(cube.grade(path), path, tmp_path / "b.exr")
    command = shlex.split(str(refusal.value).rpartition(": ")[2])
    assert command[:4] == ["oiiotool", str(path), "--subimage", "2"]
    if shutil.which("oiiotool") is not None:
        subprocess.run(command, check=True, cwd=tmp_path)
        done = apply_image(cube.grade(tmp_path / "colours.exr"), tmp_path / "colours.exr", tmp_path / "b.exr")
        assert read_image(done.target).pixels.shape == (8, 16, 3)


def test_an_exr_whose_attributes_are_no_text_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    oiio.ImageBuf(np.full((4, 4, 3), 0.5, np.float32)).write(str(path))
    path.write_bytes(path.read_bytes().replace(b"chlist\0", b"\xff\xfelist\0"))
    with pytest.raises(ImageError, match=r"a\.exr: cannot be read as an image \(it holds bytes that are not text\)"):
        ImageReader(path)
