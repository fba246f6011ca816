"""The LUTs of kits: how near they come to the model on what programs feed them, and what they say of themselves."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.colour.rgb_spaces import matrix_between, rgb_space
from lutforge.errors import SettingsError
from lutforge.kits.kit import look_of
from lutforge.kits.lumix import card_name
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.reading import trusted_processor
from lutforge.model.camera_profile import CameraProfile, through_camera
from lutforge.ocio.blender import blender_config
from lutforge.pipeline.bake_plan import BakeOptions
from lutforge.pipeline.baking import bake_files
from lutforge.pipeline.kits import write_kit
from lutforge.pipeline.transforms import TransformRequest
from tests.conftest import CommandLine

SETTING = "standard/auto"


def scene(low: float, high: float) -> Array:
    """Scene-linear colours (n, 3): all channels at once, and each alone, on black and on grey."""
    ramp = np.linspace(low, high, 500)[:, None]
    alone = []
    for channel in np.eye(3):
        alone += [ramp * channel, ramp * channel + 0.18 * (1 - channel)]
    return np.concatenate([np.random.default_rng(1).uniform(low, high, (20_000, 3)), *alone])


def test_the_nuke_kit_is_the_model_from_below_black_to_what_clips(profile: CameraProfile, tmp_path: Path) -> None:
    folder = write_kit(profile, SETTING, tmp_path / "kit", "nuke")
    (path,) = folder.glob("*.clf")
    x = np.concatenate([scene(-0.1, 4.0), scene(-0.1, 1.0)])
    light = evaluate(trusted_processor(path), x) @ matrix_between("acescg", "linear-srgb").T
    shown = rgb_space("srgb").encode(np.clip(light, 0.0, 1.0))
    assert np.abs(shown - through_camera(profile, SETTING, "acescg")(x)).max() < 0.5 / 255
    request = TransformRequest("render", target=SETTING, space="acescg")
    bake_files(profile, request, [tmp_path / "plain.clf"])
    assert path.stat().st_size < 1.5 * (tmp_path / "plain.clf").stat().st_size


@pytest.mark.parametrize("program", ["nuke", "gimp", "lightroom"])
def test_a_kit_prints_the_error_of_every_file(
    program: str, profile: CameraProfile, tmp_path: Path, lutforge: CommandLine
) -> None:
    profile.save(tmp_path / "camera.npz")
    run = lutforge("kit", "camera.npz", "--to", SETTING, "--for", program, "-o", "kit", cwd=tmp_path)
    errors = json.loads((tmp_path / "kit" / "kit.json").read_text(encoding="utf-8"))["errors"]
    files = {path.name for path in (tmp_path / "kit").iterdir() if path.suffix in (".clf", ".cube", ".dcp")}
    assert set(errors) == files
    page = (tmp_path / "kit" / "README.md").read_text(encoding="utf-8")
    for name, error in errors.items():
        assert re.search(r"mean .* max .*ΔE00 mean", error)
        assert f"{name}: {error}" in page
        assert error in run.stdout


@pytest.mark.usefixtures("small_inverses")
@pytest.mark.parametrize("with_blender", [False, True])
def test_the_kit_for_blender_prints_the_error_of_its_view(
    profile: CameraProfile, tmp_path: Path, lutforge: CommandLine, monkeypatch: pytest.MonkeyPatch, with_blender: bool
) -> None:
    """In LutForge's own config and merged with the one of the Blender that is installed."""
    if not with_blender:
        monkeypatch.setattr("lutforge.kits.all_kits.blender_config", lambda: None)
    elif blender_config() is None:
        pytest.skip("Blender is not installed")
    profile.save(tmp_path / "camera.npz")
    run = lutforge("kit", "camera.npz", "--to", SETTING, "--for", "blender", "-o", "kit", cwd=tmp_path)
    ((name, error),) = json.loads((tmp_path / "kit" / "kit.json").read_text(encoding="utf-8"))["errors"].items()
    assert name == "Canon PowerShot S40 standard in ocio" and f"{name}: read back" in run.stdout
    mean = re.search(r"ΔE00 mean ([\d.e-]+)", error)
    assert mean is not None and float(mean[1]) < 0.5
    assert f"{name}: {error}" in (tmp_path / "kit" / "README.md").read_text(encoding="utf-8")


def test_the_error_of_a_shaper_cube_counts_what_it_clips(profile: CameraProfile, tmp_path: Path) -> None:
    """A colour outside the space's gamut is negative in a channel, where a curve per channel ends at black."""
    request = TransformRequest("render", target=SETTING, space="acescg")
    (file,), notes = bake_files(profile, request, [tmp_path / "a.resolve.cube"], BakeOptions(size=17))
    x = np.concatenate([scene(-0.1, 1.0)])
    got, expected = evaluate(trusted_processor(file.path), x), through_camera(profile, SETTING, "acescg")(x)
    assert file.error.max > 0.5 * np.linalg.norm(got - expected, axis=1).max()
    assert any("the largest difference is at light" in note for note in notes)


@pytest.mark.parametrize("suffix", [".cube", ".resolve.cube", ".csp", ".3dl", ".spi1d", ".vlt", ".clf", ".ctf"])
def test_files_say_what_they_take_and_give(suffix: str, profile: CameraProfile, tmp_path: Path) -> None:
    request = TransformRequest("refinish", source=SETTING, target="standard/2,1,1.4")
    path = tmp_path / f"a{suffix}"
    bake_files(profile, request, [path], BakeOptions(size=None if suffix in (".clf", ".ctf") else 17))
    for file in [path, path.with_suffix(".spi3d")] if suffix == ".spi1d" else [path]:
        text = file.read_text(encoding="utf-8")
        for words in (
            "LutForge", "input: the camera's JPEG, encoded", "output: the camera's JPEG",
            "range: full, not video levels",
            "Canon PowerShot S40 standard/auto to standard/2,1,1.4", "licence: CC0",
        ):  # fmt: skip
            assert words in text.replace("&apos;", "'")
        if suffix in (".clf", ".ctf"):
            assert "<InputDescriptor>the camera" in text
            assert "<OutputDescriptor>the camera" in text


def test_kits_say_it_too(profile: CameraProfile, tmp_path: Path) -> None:
    for program, takes, gives in (
        ("gimp", "scene-referred srgb", "the camera's JPEG"),
        ("nuke", "scene-linear acescg", "scene-linear acescg"),
    ):
        folder = write_kit(profile, SETTING, tmp_path / program, program)
        (path,) = [path for path in folder.iterdir() if path.suffix in (".cube", ".clf")]
        text = path.read_text(encoding="utf-8")
        assert f"input: {takes}" in text
        assert f"output: {gives}" in text.replace("&apos;", "'")
        assert "range: full, not video levels" in text
        assert "CC0" in (folder / "README.md").read_text(encoding="utf-8")


def test_the_namespace_of_a_clf(profile: CameraProfile, tmp_path: Path) -> None:
    request = TransformRequest("render", target=SETTING)
    for version, namespace in ((None, "http://www.smpte-ra.org/ns/2136-1/2024"), ("3", "urn:AMPAS:CLF:v3.0")):
        bake_files(profile, request, [tmp_path / "a.clf"], BakeOptions(clf_version=version))
        head = (tmp_path / "a.clf").read_text(encoding="utf-8")[:300]
        assert f'xmlns="{namespace}"' in head
        assert head.count("compCLFversion") == 1
        x = np.random.default_rng(0).random((500, 3))
        assert np.abs(evaluate(trusted_processor(tmp_path / "a.clf"), x) - profile.render(SETTING)(x)).max() < 1e-5
    for version, path in (("2", "a.clf"), ("3", "a.cube")):
        with pytest.raises(SettingsError):
            bake_files(profile, request, [tmp_path / path], BakeOptions(clf_version=version))


@pytest.mark.parametrize(("base", "word"), [(None, "VLOG"), ("standard", "STD")])
def test_luts_of_bodies_name_their_base(base: str | None, word: str, profile: CameraProfile, tmp_path: Path) -> None:
    folder = write_kit(profile, SETTING, tmp_path / "kit", "lumix", base=base)
    (cube,), (vlt,) = folder.glob("*.cube"), folder.glob("*.vlt")
    lines = cube.read_text(encoding="ascii").splitlines()
    assert lines[0].startswith("TITLE ")
    assert lines[1] == f"#LUMIXPHOTOSTYLE {word}"
    assert f"#LUMIXPHOTOSTYLE {word}" in vlt.read_text(encoding="ascii").splitlines()[2]
    assert all(re.fullmatch(r"[A-Z0-9]{1,8}", path.stem) for path in (cube, vlt))


def test_names_on_a_card_differ(profile: CameraProfile) -> None:
    look = look_of(profile, SETTING)
    taken: set[str] = set()
    for _ in range(12):
        taken.add(card_name(look, taken))
    assert len(taken) == 12
    assert all(len(name) <= 8 for name in taken)


def test_cubes_have_six_decimals(profile: CameraProfile, tmp_path: Path) -> None:
    bake_files(profile, TransformRequest("render", target=SETTING), [tmp_path / "a.cube"], BakeOptions(size=9))
    last = (tmp_path / "a.cube").read_text(encoding="ascii").splitlines()[-1]
    assert [len(number.split(".")[1]) for number in last.split()] == [6, 6, 6]
