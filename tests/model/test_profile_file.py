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

from lutforge.errors import LutForgeError, ProfileError
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.model.profile_file import save_profile
from tests.cases.profiles import small_profile


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "camera.npz"
    save_profile(small_profile(), path)
    return path


def _rewrite(path: Path, change: dict[str, bytes | None]) -> None:
    """Replace entries of the zip; None leaves one out."""
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    entries |= {name: data for name, data in change.items() if data is not None}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            if change.get(name, b"") is not None:
                archive.writestr(name, data)


def _edit(path: Path, **fields: Any) -> None:
    with zipfile.ZipFile(path) as archive:
        document = json.loads(archive.read("profile.json"))
    _rewrite(path, {"profile.json": json.dumps(document | fields).encode()})


def _npy(array: np.ndarray, *, allow_pickle: bool = False) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=allow_pickle)
    return stream.getvalue()


def _refused(path: Path) -> str:
    with pytest.raises(ProfileError) as caught:
        load_profile(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


def _with_response() -> CameraProfile:
    profile = small_profile()
    name, style = next(iter(profile.styles.items()))
    assert style.render is not None
    table = np.linspace(0.0, 1.0, 65)[:, None] ** np.array([0.4, 0.5, 0.6])
    render = replace(style.render, output_curve=table)
    return replace(profile, styles={**profile.styles, name: replace(style, render=render)})


def test_a_response_and_the_plain_form_come_back(tmp_path: Path) -> None:
    first = _with_response()
    save_profile(first, tmp_path / "a.npz")
    second = load_profile(tmp_path / "a.npz")
    for name, style in first.styles.items():
        wanted, got = style.render, second.styles[name].render
        assert wanted is not None and got is not None
        x = np.random.default_rng(0).random((100, 3))
        np.testing.assert_array_equal(got(x), wanted(x))
        assert (got.output_curve is None) == (wanted.output_curve is None)


def test_a_falling_response_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    save_profile(_with_response(), path)
    with zipfile.ZipFile(path) as archive:
        entry = next(name for name in archive.namelist() if name.endswith("render_response.npy"))
    _rewrite(path, {entry: _npy(np.linspace(1.0, 0.0, 65)[:, None].repeat(3, axis=1))})
    assert "response" in _refused(path)
    _rewrite(path, {entry: _npy(np.zeros((1 << 17, 3)))})
    assert "response" in _refused(path)


def test_everything_comes_back(saved: Path) -> None:
    first, second = small_profile(), load_profile(saved)
    assert second.camera == first.camera
    assert second.shots == first.shots and second.notes == first.notes
    assert dict(second.options) == dict(first.options)
    assert dict(second.white_balances) == dict(first.white_balances)
    np.testing.assert_array_equal(second.matrix, first.matrix)
    x = np.random.default_rng(0).uniform(size=(50, 3))
    for style in first.styles:
        np.testing.assert_array_equal(second.render(f"{style}/daylight")(x), first.render(f"{style}/daylight")(x))
        np.testing.assert_array_equal(second.linearize(f"{style}/tungsten")(x), first.linearize(f"{style}/tungsten")(x))
    np.testing.assert_array_equal(
        second.linearize("standard/daylight", model="rbf")(x), first.linearize("standard/daylight", model="rbf")(x)
    )
    for name, coverage in first.styles["standard"].coverage.items():
        np.testing.assert_array_equal(second.styles["standard"].coverage[name], coverage)


def test_the_same_profile_gives_the_same_bytes(saved: Path, tmp_path: Path) -> None:
    save_profile(load_profile(saved), tmp_path / "again.npz")
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


def test_flipped_bytes_never_give_a_traceback(saved: Path) -> None:
    data = bytearray(saved.read_bytes())
    rng = np.random.default_rng(3)
    for _ in range(60):
        damaged = data.copy()
        for place in rng.integers(0, len(data), 3):
            damaged[place] ^= int(rng.integers(1, 256))
        saved.write_bytes(bytes(damaged))
        try:
            load_profile(saved)
        except LutForgeError as error:
            assert "\n" not in str(error)


def test_not_a_profile(tmp_path: Path) -> None:
    text = tmp_path / "text.npz"
    text.write_text("hello")
    assert "not a LutForge profile" in _refused(text)
    other = tmp_path / "other.npz"
    np.savez(other, a=np.zeros(3))
    assert "profile.json" in _refused(other)


def test_a_missing_array_is_named(saved: Path) -> None:
    _rewrite(saved, {"style0_render_values.npy": None})
    assert "style0_render_values" in _refused(saved)


def test_another_version_asks_for_an_update_or_a_calibration(saved: Path) -> None:
    _edit(saved, version=999)
    assert "update" in _refused(saved)
    _edit(saved, version=1)
    assert "calibrate again" in _refused(saved)


@pytest.mark.parametrize("version", [0, "x", None, True, "1" * 1000])
def test_a_version_that_no_release_wrote_is_damage(saved: Path, version: object) -> None:
    _edit(saved, version=version)
    said = _refused(saved)
    assert "damaged" in said and "update" not in said and len(said) < 300


@pytest.mark.parametrize(
    "fields",
    [
        {"format": "something"},
        {"version": "1"},
        {"matrix": [[1, 0, 0], [0, 1, 0]]},
        {"matrix": "abc"},
        {"white_balances": {}},
        {"white_balances": {"daylight": {"multipliers": [1, 1], "kelvin": None}}},
        {"white_balances": {"daylight": {"multipliers": [0, 1, 1], "kelvin": None}}},
        {"white_balances": {"daylight": {"multipliers": [2, 1, 2], "kelvin": None, "spread": 1e308}}},
        {"white_balances": []},
        {"styles": {}},
        {"styles": {"standard": {"render": {"values": "x", "levels": ["a"], "interpolation": "cubic"}}}},
        {"styles": {"standard": {"render": 3}}},
        {"styles": None},
        {"version": 0},
        {"options": [1]},
        {"camera": "x" * 10_000},
        {"camera": "A\nB \x1b[31m"},
        {"white_balances": {"daylight": {"multipliers": [2, 2, 2], "kelvin": None}}},
        {"white_balances": {"day\nlight": {"multipliers": [2, 1, 2], "kelvin": None}}},
    ],
)
def test_wrong_values_in_the_description(saved: Path, fields: dict[str, Any]) -> None:
    _edit(saved, **fields)
    with pytest.raises(ProfileError) as caught:
        load_profile(saved)
    assert "\n" not in str(caught.value)


def test_pickles_are_never_loaded(saved: Path, tmp_path: Path) -> None:
    marker = tmp_path / "executed"

    class Bomb:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (marker,))

    objects = np.empty(1, dtype=object)
    objects[0] = Bomb()
    _rewrite(saved, {"style0_render_values.npy": _npy(objects, allow_pickle=True)})
    _refused(saved)
    _rewrite(saved, {"profile.json": pickle.dumps(Bomb())})
    _refused(saved)
    assert not marker.exists()


def test_a_huge_stated_shape_is_refused_before_memory_is_taken(saved: Path) -> None:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (100000, 100000, 3)})
    _rewrite(saved, {"style0_render_values.npy": header.getvalue() + b"\0" * 64})
    assert "stated shape" in _refused(saved)


def test_a_negative_shape_is_refused(saved: Path) -> None:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (-5, -1, 3)})
    _rewrite(saved, {"style0_render_values.npy": header.getvalue() + b"\0" * 64})
    assert _refused(saved)


def test_a_zip_bomb_is_refused(saved: Path) -> None:
    with zipfile.ZipFile(saved, "a", zipfile.ZIP_DEFLATED) as archive:
        name = "style0_render_values.npy"
        assert name in archive.namelist()
    entries: dict[str, bytes | None] = {"style0_render_values.npy": None}
    _rewrite(saved, entries)
    with (
        zipfile.ZipFile(saved, "a", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("style0_render_values.npy", "w", force_zip64=True) as stream,
    ):
        block = bytes(16 * 1024 * 1024)
        for _ in range(33):  # 528 MB of zeros, 2 MB packed
            stream.write(block)
    assert "unpacks to" in _refused(saved)


def test_wrong_arrays_are_refused(saved: Path) -> None:
    _rewrite(saved, {"style0_render_values.npy": _npy(np.zeros((5, 5, 5, 3), dtype=np.float32))})
    assert "float64" in _refused(saved)
    _rewrite(saved, {"style0_render_values.npy": _npy(np.zeros((4, 5, 5, 3)))})
    _refused(saved)
    _rewrite(saved, {"style0_render_values.npy": _npy(np.full((5, 5, 5, 3), np.nan))})
    _refused(saved)


def test_a_lattice_on_another_domain_is_refused(saved: Path) -> None:
    _rewrite(saved, {"style0_render_levels_r.npy": _npy(np.linspace(0.0, 0.3, 5))})
    assert "from 0 to 1" in _refused(saved)


def test_a_header_that_numpy_will_not_read_is_refused_in_one_line(saved: Path) -> None:
    header = b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65534 + b"\n"
    _rewrite(saved, {"style0_render_values.npy": header})
    assert "\n" not in _refused(saved)


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("style0_physical0_gamut_map_centres", np.zeros((20_001, 3))),
        ("style0_render_levels_r", np.linspace(0.0, 1.0, 70_000)),
        ("style0_render_coverage", np.zeros((300, 300, 300))),
        ("style0_physical0_response", np.zeros((2, 2, 2, 2, 2))),
    ],
)
def test_arrays_beyond_their_kind_are_refused_by_their_header(saved: Path, name: str, array: np.ndarray) -> None:
    _rewrite(saved, {f"{name}.npy": _npy(array)[:4096]})
    message = _refused(saved)
    assert name in message
    _rewrite(saved, {f"{name}.npy": _npy(array)})
    assert f"refused, the array {name}" in _refused(saved)


def test_shapes_that_no_profile_has_are_refused(saved: Path) -> None:
    whole = saved.read_bytes()
    for channel in "rgb":
        _rewrite(saved, {f"style0_render_levels_{channel}.npy": _npy(np.linspace(0.0, 1.0, 5)[:, None])})
    assert "node levels" in _refused(saved)
    saved.write_bytes(whole)
    with zipfile.ZipFile(saved) as archive:
        document = json.loads(archive.read("profile.json"))
    model = document["styles"]["standard"]["physical"][0]
    model["matrix"] = [[1.0, 0.0], [0.0, 1.0]]
    _rewrite(saved, {"profile.json": json.dumps(document).encode()})
    assert "matrix" in _refused(saved)
    model["matrix"], model["white_balances"] = np.eye(3).tolist(), [["daylight"], 3]
    _rewrite(saved, {"profile.json": json.dumps(document).encode()})
    assert all(isinstance(name, str) for name in load_profile(saved).styles["standard"].physical[0].white_balances)
