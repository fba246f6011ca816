"""The profile file: round trip, equal bytes, and damaged or hostile files."""

import io
import json
import pickle
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lutforge.errors import ProfileError
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.model.falloff import Falloff
from lutforge.model.profile_data import Diagnosis
from tests.cases.profiles import small_profile

VALUES = "style0_render_values"


def _profile() -> CameraProfile:
    """The small profile with what a profile can hold beside: an output curve, lens falloffs, a diagnosis."""
    profile = small_profile()
    standard = profile.styles["standard"]
    assert standard.render is not None
    curve = np.linspace(0.0, 1.0, 65)[:, None] ** np.array([0.4, 0.5, 0.6])
    standard = replace(standard, render=replace(standard.render, output_curve=curve))
    falloffs = (Falloff((0.1, 0.0, 0.3), (0.01, 0.0), "A lens", 24.0, 2.8), Falloff((0.1, 0.2, 0.3)))
    return replace(
        profile, styles={**profile.styles, "standard": standard}, falloffs=falloffs,
        diagnoses=(Diagnosis("a cause", "its evidence", "advice"),), raw_camera="Other", raw_transfer=0.9 * np.eye(3),
    )  # fmt: skip


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "camera.npz"
    _profile().save(path)
    return path


def _rewrite(path: Path, change: dict[str, bytes | None]) -> None:
    """Replace entries of the zip; None leaves one out."""
    with zipfile.ZipFile(path) as archive:
        entries: dict[str, bytes | None] = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in (entries | change).items():
            if data is not None:
                archive.writestr(name, data)


def _edit(path: Path, **fields: Any) -> None:
    with zipfile.ZipFile(path) as archive:
        document = json.loads(archive.read("profile.json"))
    _rewrite(path, {"profile.json": json.dumps(document | fields).encode()})


def _npy(array: np.ndarray, *, allow_pickle: bool = False) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=allow_pickle)
    return stream.getvalue()


def _stated(shape: tuple[int, ...]) -> bytes:
    """An array of 64 bytes whose header states another shape."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return header.getvalue() + b"\0" * 64


def _refused(path: Path) -> str:
    with pytest.raises(ProfileError) as caught:
        load_profile(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


def test_everything_comes_back(saved: Path) -> None:
    first, second = _profile(), load_profile(saved)
    for name in ("camera", "shots", "notes", "options", "white_balances", "raw_camera", "falloffs", "diagnoses"):
        assert repr(getattr(second, name)) == repr(getattr(first, name)), name  # NaN equals nothing
    for name in ("matrix", "raw_transfer"):
        np.testing.assert_array_equal(getattr(second, name), getattr(first, name))
    x = np.random.default_rng(0).uniform(size=(50, 3))
    for name, style in first.styles.items():
        again = second.styles[name]
        assert again.errors == style.errors
        for direction, lattice in style.lattices.items():
            np.testing.assert_array_equal(again.lattices[direction](x), lattice(x))
        for direction, coverage in style.coverage.items():
            np.testing.assert_array_equal(again.coverage[direction], coverage)
        for one, other in zip(style.physical, again.physical, strict=True):
            np.testing.assert_array_equal(other.render(x), one.render(x))
            np.testing.assert_array_equal(other.linearize(x), one.linearize(x))
            assert other.white_balances == one.white_balances


def test_the_same_profile_gives_the_same_bytes(saved: Path, tmp_path: Path) -> None:
    load_profile(saved).save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == saved.read_bytes()


def test_a_missing_file_says_how_to_make_one(tmp_path: Path) -> None:
    path = tmp_path / "none.npz"
    assert f"lutforge calibrate … -o {path}" in _refused(path)
    assert f"lutforge calibrate {tmp_path / 'samples.csv'}" in _refused(tmp_path / "samples.csv")


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_truncated_files(saved: Path, share: float) -> None:
    data = saved.read_bytes()
    saved.write_bytes(data[: int(share * len(data))])
    assert _refused(saved)


def test_not_a_profile(tmp_path: Path) -> None:
    text = tmp_path / "text.npz"
    text.write_text("hello")
    assert "not a LutForge profile" in _refused(text)
    other = tmp_path / "other.npz"
    np.savez(other, a=np.zeros(3))
    assert "profile.json" in _refused(other)


@pytest.mark.parametrize(
    ("version", "says"),
    [(999, "update"), (1, "calibrate again"), *((bad, "damaged") for bad in (0, "x", "1", None, True, "1" * 1000))],
)
def test_another_version_says_what_to_do(saved: Path, version: object, says: str) -> None:
    _edit(saved, version=version)
    message = _refused(saved)
    assert says in message and len(message) < 300
    assert ("update" in message) == (version == 999)


@pytest.mark.parametrize(
    "fields",
    [
        {"format": "something"},
        {"matrix": [[1, 0, 0], [0, 1, 0]]},
        {"matrix": "abc"},
        {"white_balances": {}},
        {"white_balances": {"daylight": {"multipliers": [1, 1], "kelvin": None}}},
        {"white_balances": {"daylight": {"multipliers": [0, 1, 1], "kelvin": None}}},
        {"white_balances": {"daylight": {"multipliers": [2, 1, 2], "kelvin": None, "spread": 1e308}}},
        {"white_balances": {"daylight": {"multipliers": [2, 2, 2], "kelvin": None}}},
        {"white_balances": {"day\nlight": {"multipliers": [2, 1, 2], "kelvin": None}}},
        {"white_balances": []},
        {"styles": {}},
        {"styles": {"standard": {"render": {"values": "x", "levels": ["a"], "interpolation": "cubic"}}}},
        {"styles": {"standard": {"render": 3}}},
        {"styles": None},
        {"options": [1]},
        {"camera": "x" * 10_000},
        {"camera": "A\nB \x1b[31m"},
        {"falloffs": [{"coefficients": [-1, 0, 0], "centre": [0, 0], "lens": "", "focal_mm": None, "aperture": None}]},
    ],
)
def test_wrong_values_in_the_description(saved: Path, fields: dict[str, Any]) -> None:
    _edit(saved, **fields)
    assert _refused(saved)


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("render_values", None, "style0_render_values is missing"),
        ("render_values", _npy(np.zeros((5, 5, 5, 3), dtype=np.float32)), "float64"),
        ("render_values", _npy(np.zeros((4, 5, 5, 3))), "node levels ask for"),
        ("render_values", _npy(np.full((5, 5, 5, 3), np.nan)), "not a finite number"),
        ("render_values", _stated((100_000, 100_000, 3)), "stated shape"),  # before memory is taken
        ("render_values", _stated((-5, -1, 3)), ""),
        ("render_values", b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65534 + b"\n", ""),
        ("render_response", _npy(np.linspace(1.0, 0.0, 65)[:, None].repeat(3, axis=1)), "output curve falls"),
        ("render_response", _npy(np.zeros((1 << 17, 3))), "refused, the array style0_render_response"),
        ("render_levels_r", _npy(np.linspace(0.0, 0.3, 5)), "from 0 to 1"),
        ("render_levels_r", _npy(np.linspace(0.0, 1.0, 5)[:, None]), "node levels"),
        ("render_levels_r", _npy(np.linspace(0.0, 1.0, 70_000)), "refused, the array style0_render_levels_r"),
        ("render_coverage", _npy(np.zeros((9, 9, 9)))[:4096], "style0_render_coverage"),
        ("render_coverage", _npy(np.zeros((130, 130, 130))), "refused, the array style0_render_coverage"),
        ("physical0_gamut_map_centres", _npy(np.zeros((20_001, 3))), "refused, the array style0_physical0_gamut_map"),
        ("physical0_response", _npy(np.zeros((2, 2, 2, 2, 2))), "refused, the array style0_physical0_response"),
    ],
)  # fmt: skip
def test_arrays_that_no_profile_has_are_refused(saved: Path, name: str, data: bytes | None, says: str) -> None:
    _rewrite(saved, {f"style0_{name}.npy": data})
    assert says in _refused(saved)


def test_pickles_are_never_loaded(saved: Path, tmp_path: Path) -> None:
    marker = tmp_path / "executed"

    class Bomb:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (marker,))

    objects = np.empty(1, dtype=object)
    objects[0] = Bomb()
    _rewrite(saved, {f"{VALUES}.npy": _npy(objects, allow_pickle=True)})
    _refused(saved)
    _rewrite(saved, {"profile.json": pickle.dumps(Bomb())})
    _refused(saved)
    assert not marker.exists()


def test_a_zip_bomb_is_refused(saved: Path) -> None:
    _rewrite(saved, {f"{VALUES}.npy": None})
    with (
        zipfile.ZipFile(saved, "a", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open(f"{VALUES}.npy", "w", force_zip64=True) as stream,
    ):
        block = bytes(16 * 1024 * 1024)
        for _ in range(33):  # 528 MB of zeros, 2 MB packed
            stream.write(block)
    assert "unpacks to" in _refused(saved)


def test_a_physical_model_is_judged_and_its_names_are_text(saved: Path) -> None:
    with zipfile.ZipFile(saved) as archive:
        styles = json.loads(archive.read("profile.json"))["styles"]
    model = styles["standard"]["physical"][0]
    model["matrix"] = [[1.0, 0.0], [0.0, 1.0]]
    _edit(saved, styles=styles)
    assert "matrix" in _refused(saved)
    model["matrix"], model["white_balances"] = np.eye(3).tolist(), [["daylight"], 3]
    _edit(saved, styles=styles)
    assert all(isinstance(name, str) for name in load_profile(saved).styles["standard"].physical[0].white_balances)
