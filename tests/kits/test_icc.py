"""ICC profiles of a camera, by Little CMS; and LUTs of Lumix bodies, against the simulated camera."""

import ctypes
import ctypes.util
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.colour.srgb import delta_e_2000, srgb_decode, srgb_encode, srgb_to_lab
from lutforge.kits.icc import Variant, fit_icc_profile, icc_lines, read_icc, scene_linear, write_icc
from lutforge.kits.kit import look_of
from lutforge.luts.reading import read_lut
from lutforge.model.camera_profile import CameraProfile, load_profile, match
from lutforge.pipeline.kits import write_kit
from lutforge.samples.sample_set import SampleSet
from tests.conftest import CommandLine


@pytest.fixture(scope="module")
def icc(profile: CameraProfile, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("icc") / "look.icc"
    write_icc(fit_icc_profile(look_of(profile, "standard")), path)
    return path


def through_little_cms(path: Path, x: Array, bits: int) -> Array:
    """Camera RGB (n, 3) → encoded sRGB, relative colorimetric, in floats (bits 32) or integers (16)."""
    name = ctypes.util.find_library("lcms2")
    if name is None:
        pytest.skip("the library of Little CMS is not installed")
    library = ctypes.CDLL(name)
    for function in ("cmsOpenProfileFromFile", "cmsCreate_sRGBProfile", "cmsCreateTransform"):
        getattr(library, function).restype = ctypes.c_void_p
    # lcms2.h: FLOAT_SH, COLORSPACE_SH (RGB is 4), CHANNELS_SH, BYTES_SH; cmsFLAGS_NOOPTIMIZE.
    kind = (1 << 22 | 4 << 16 | 3 << 3 | 4) if bits == 32 else (4 << 16 | 3 << 3 | 2)
    source = ctypes.c_void_p(library.cmsOpenProfileFromFile(str(path).encode(), b"r"))
    target, relative, whole = ctypes.c_void_p(library.cmsCreate_sRGBProfile()), 1, 0x100
    assert source
    transform = ctypes.c_void_p(library.cmsCreateTransform(source, kind, target, kind, relative, whole))
    assert transform
    values = x.astype(np.float32) if bits == 32 else np.rint(np.clip(x, 0, 1) * 65535).astype(np.uint16)
    made = np.empty_like(values)
    library.cmsDoTransform(transform, values.ctypes, made.ctypes, ctypes.c_uint32(len(values)))
    return np.asarray(made / (1.0 if bits == 32 else 65535.0), dtype=np.float64)


@pytest.mark.parametrize("bits", [32, 16])
def test_little_cms_shows_the_model(bits: int, profile: CameraProfile, icc: Path, s40_samples: SampleSet) -> None:
    look = look_of(profile, "standard")
    for x in (np.clip(s40_samples.raw * s40_samples.wb, 0.0, 1.0), np.random.default_rng(1).random((20_000, 3))):
        shown = np.clip(through_little_cms(icc, x, bits), 0.0, 1.0)
        difference = delta_e_2000(shown, np.clip(look.render(x), 0.0, 1.0))
        assert difference.mean() <= 0.15
        assert np.quantile(difference, 0.99) <= 0.6


def test_greys_stay_neutral_and_light_above_white_stays_white(profile: CameraProfile, icc: Path) -> None:
    grey = np.repeat(np.linspace(0.0, 1.0, 2000)[:, None], 3, axis=1)
    shown, expected = through_little_cms(icc, grey, 32), look_of(profile, "standard").render(grey)
    assert np.abs(srgb_to_lab(shown) - srgb_to_lab(expected))[:, 1:].max() <= 0.3
    assert delta_e_2000(np.clip(shown, 0, 1), np.clip(expected, 0, 1)).max() <= 0.5
    bright = through_little_cms(icc, np.array([[1.0, 1.0, 1.0], [2.0, 3.0, 1.5], [100.0, 1.0, 4.0]]), 32)
    assert np.abs(bright - 1.0).max() < 2e-3
    warm = np.array([[1.0, 0.5, 0.2], [4.0, 0.5, 0.2]])
    assert np.abs(np.diff(through_little_cms(icc, warm, 32), axis=0)).max() == 0.0


def test_nodes_lie_where_greys_bend(profile: CameraProfile, tmp_path: Path) -> None:
    rng, grey = np.random.default_rng(7), np.repeat(np.linspace(0.0, 1.0, 2000)[:, None], 3, axis=1)
    places = np.concatenate([[0.0], np.sort(rng.random(24)), [1.0]]) ** 2.4
    cast = 0.006 * rng.uniform(-1, 1, (26, 3)) * (places[:, None] < 0.9)

    def render(x: Array) -> Array:
        kinks = [np.interp(x[..., 1], places, column) for column in cast.T]
        return np.asarray(srgb_encode(x) + np.minimum(x, 0.05) / 0.05 * np.stack(kinks, axis=-1))

    write_icc(fit_icc_profile(replace(look_of(profile, "standard"), render=render)), tmp_path / "look.icc")
    shown = through_little_cms(tmp_path / "look.icc", grey, 32)
    assert np.abs(srgb_to_lab(shown) - srgb_to_lab(render(grey)))[:, 1:].max() <= 0.3


def test_colours_without_the_tone_curve_are_linear_in_greys(profile: CameraProfile, tmp_path: Path) -> None:
    look = look_of(profile, "standard")
    fitted = fit_icc_profile(look, Variant.COLOURS)
    luminance = np.array([0.2126, 0.7152, 0.0722])
    light = np.repeat(np.linspace(0.02, 1.0, 200)[:, None], 3, axis=1)
    greys = np.repeat((srgb_decode(fitted(light)) @ luminance)[:, None], 3, axis=1)
    assert delta_e_2000(srgb_encode(greys), srgb_encode(light)).max() < 0.5
    # At the lightness of the camera's picture, a colour is the picture's, the cast of greys too.
    x = 0.18 * np.random.default_rng(2).uniform(0.5, 1.5, (200, 3))
    shown, expected = srgb_decode(fitted(x)), np.clip(look.render(x), 0.0, 1.0)
    again = shown * ((srgb_decode(expected) @ luminance) / (shown @ luminance))[:, None]
    assert delta_e_2000(np.clip(srgb_encode(again), 0.0, 1.0), expected).mean() < 0.3


def test_colours_without_the_tone_curve_do_not_jump_where_a_channel_clips(profile: CameraProfile) -> None:
    direction = np.random.default_rng(4).uniform(0.1, 1.0, (100, 3))
    light = scene_linear(look_of(profile, "standard"))
    ramps = light(np.linspace(0.0, 1.0, 513)[:, None, None] * direction / direction.max(axis=1, keepdims=True))
    assert np.abs(np.diff(srgb_encode(ramps), axis=0))[8:].max() < 5 / 255


def test_a_profile_is_read_as_little_cms_reads_it(icc: Path) -> None:
    x = np.random.default_rng(3).random((2000, 3))
    assert np.abs(read_icc(icc)(x) - np.clip(through_little_cms(icc, x, 32), 0.0, 1.0)).max() < 1e-3
    text = "\n".join(icc_lines(icc))
    assert "Canon PowerShot S40 standard" in text
    assert "Little CMS: reads it, within 0." in text


@pytest.mark.slow
def test_an_icc_profile_is_a_format_of_bake(profile: CameraProfile, tmp_path: Path, lutforge: CommandLine) -> None:
    profile.save(tmp_path / "camera.npz")
    words = ("bake", "camera.npz", "render", "--to", "standard")
    for more in ((), ("--colours",), ("--for", "darktable")):
        run = lutforge(*words, "-o", "look.icc", *more, cwd=tmp_path)
        assert "ΔE00 mean 0.0" in run.stdout
    for command in ("check", "inspect"):
        assert "Canon PowerShot S40 standard" in lutforge(command, "look.icc", cwd=tmp_path).stdout
    refused = {
        ("-o", "look.icc", "--for", "lightroom"): "lightroom does not read .icc",
        ("-o", "look.dcp", "--colours"): "--colours goes with an ICC profile",
    }
    for options, why in refused.items():
        assert why in lutforge(*words, *options, cwd=tmp_path, status=2).stderr


@pytest.mark.parametrize("program", ["darktable", "rawtherapee", "blender"])
def test_all_styles_in_one_folder(program: str, demo: tuple[Path, str], tmp_path: Path, lutforge: CommandLine) -> None:
    camera = next(demo[0].rglob("*.npz"))
    lutforge("kit", camera, "--to", "all", "--for", program, "-o", tmp_path / "kit")
    styles = json.loads((tmp_path / "kit" / "kit.json").read_text(encoding="utf-8"))["styles"]
    assert len(styles) > 1
    if program == "blender":
        config = (tmp_path / "kit" / "ocio" / "config.ocio").read_text(encoding="utf-8")
        assert all(f"LutForge Simulated D5100 {style}" in config for style in styles)
        return
    preset = ".xmp" if program == "darktable" else ".pp3"
    for style in styles:
        assert [path.name for path in (tmp_path / "kit").glob(f"* {style}.icc")]
        assert [path.name for path in (tmp_path / "kit").glob(f"* {style}{preset}")]


def test_a_lut_on_a_base_style_serves_all_white_balances(demo: tuple[Path, str], tmp_path: Path) -> None:
    camera = load_profile(next(demo[0].rglob("*.npz")))
    folder = write_kit(camera, "vivid", tmp_path / "kit", "lumix", base="standard")
    files = [next(folder.glob(pattern)) for pattern in ("*.vlt", "*.cube")]
    assert [read_lut(path).size for path in files] == [17, 33]
    balanced = np.random.default_rng(5).random((5000, 3)) ** 2
    for name in camera.white_balances:
        jpeg = camera.render_balanced(f"standard/{name}")(balanced)
        expected = match(camera, f"standard/{name}", camera, f"vivid/{name}", neutral_highlights=False)(jpeg)
        for path in files:
            assert delta_e_2000(read_lut(path)(jpeg), expected).mean() <= 0.3, (name, path.name)


def test_another_cameras_look_on_a_base_style(profile: CameraProfile, tmp_path: Path) -> None:
    other = replace(profile, camera="Other", matrix=profile.matrix @ np.diag([1.1, 1.0, 0.9]))
    folder = write_kit(profile, "standard", tmp_path / "kit", "lumix", base="standard", look=other)
    readme = (folder / "README.md").read_text(encoding="utf-8")
    assert "Other standard" in readme
    assert f"memory card of the {profile.camera}" in readme
