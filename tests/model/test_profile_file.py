"""The profile file: round trip, equal bytes, and damaged or hostile files."""

import io
import json
import pickle
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from lutforge.errors import ProfileError, SettingsError
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.model.profile import Diagnosis, PictureStyle
from lutforge.model.provenance import Chart, Developed, OwnRaw, Provenance, ReferenceRaw, ResponseOnly
from lutforge.model.published_model import PublishedModel, export_published, import_published, read_published_model
from lutforge.model.vignetting import Vignetting
from lutforge.thesis.gamut_map import fit_gamut_map
from tests.cases.profiles import small_profile
from tests.cases.same_bytes import same_bytes

VALUES = "style0_render_values"


def _profile() -> CameraProfile:
    """The small profile with what a profile can hold beside: an output curve, vignetting, a diagnosis."""
    profile = small_profile()
    standard = profile.styles["standard"]
    assert standard.render is not None
    curve = np.linspace(0.0, 1.0, 65)[:, None] ** np.array([0.4, 0.5, 0.6])
    standard = replace(standard, render=replace(standard.render, output_curve=curve))
    vignettings = (Vignetting((0.1, 0.0, 0.3), (0.01, 0.0), "A lens", 24.0, 2.8), Vignetting((0.1, 0.2, 0.3)))
    return replace(
        profile, styles={**profile.styles, "standard": standard}, vignettings=vignettings,
        diagnoses=(Diagnosis("a cause", "its evidence", "advice"),), provenance=ReferenceRaw("Other", 0.9 * np.eye(3)),
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
    for name in ("camera", "shots", "notes", "options", "white_balances", "provenance", "vignettings", "diagnoses"):
        assert repr(getattr(second, name)) == repr(getattr(first, name)), name  # NaN equals nothing
    np.testing.assert_array_equal(second.matrix, first.matrix)
    x = np.random.default_rng(0).uniform(size=(50, 3))
    for name, style in first.styles.items():
        again = second.styles[name]
        assert again.errors == style.errors
        for direction, lattice in style.lattices.items():
            np.testing.assert_array_equal(again.lattices[direction](x), lattice(x))
        for direction, coverage in style.coverage.items():
            np.testing.assert_array_equal(again.coverage[direction], coverage)
        for model, loaded in zip(style.models, again.models, strict=True):
            np.testing.assert_array_equal(loaded.render(x), model.render(x))
            np.testing.assert_array_equal(loaded.linearize(x), model.linearize(x))
            assert loaded.white_balances == model.white_balances


PROVENANCES = [
    OwnRaw(),
    ReferenceRaw("Other", np.array([[0.9, 0.1, 0.0], [0.05, 0.9, 0.05], [0.0, 0.1, 0.9]])),
    Developed("darktable 4.2.1", "linear-rec2020"),
    Developed("chart makers' own program", "srgb"),
    Chart("classic", "D50", "linear-prophoto"),
    ResponseOnly(),
]


@pytest.mark.parametrize("provenance", PROVENANCES, ids=lambda provenance: type(provenance).__name__)
def test_every_provenance_comes_back(provenance: Provenance, tmp_path: Path) -> None:
    replace(small_profile(), provenance=provenance).save(tmp_path / "camera.npz")
    again = load_profile(tmp_path / "camera.npz").provenance
    assert type(again) is type(provenance)
    assert again == provenance


def test_every_provenance_is_tested() -> None:
    assert {type(provenance) for provenance in PROVENANCES} == set(get_args(Provenance))


@pytest.mark.parametrize(
    "stated",
    [
        {"kind": "made up"},
        {"kind": ["own raw"]},
        {},
        "own raw",
        None,
        {"kind": "developed", "program": "a", "space": "no such space"},
        {"kind": "developed", "program": "a" * 201, "space": "srgb"},
        {"kind": "developed", "program": "two\nlines", "space": "srgb"},
        {"kind": "developed", "program": "a", "space": "raw"},
        {"kind": "developed", "program": "a", "space": "s" * 100_000},
        {"kind": "chart", "name": "classic", "space": "srgb"},
        {"kind": "chart", "name": "classic", "light": "D\x00", "space": "srgb"},
        {"kind": "reference raw", "camera": "A"},
        {"kind": "reference raw", "camera": "A", "transfer": [[1.0]]},
        {"kind": "reference raw", "camera": "A", "transfer": [[0.0] * 3] * 3},
        {"kind": "reference raw", "camera": "A", "transfer": "a" * 9},
        {"kind": "reference raw", "camera": "a" * 201, "transfer": np.eye(3).tolist()},
    ],
)
def test_a_provenance_that_none_has_is_refused(saved: Path, stated: Any) -> None:
    _edit(saved, provenance=stated)
    assert len(_refused(saved)) < 400


def test_a_missing_style_names_the_known_ones(saved: Path) -> None:
    with pytest.raises(SettingsError, match=r"picture style 'neutral' is not in the profile; known: standard, vivid"):
        load_profile(saved).styles["neutral"]


def test_records_show_as_one_line(saved: Path) -> None:
    profile = load_profile(saved)
    for record in (profile, profile.styles["standard"], profile.styles["vivid"], profile.provenance):
        assert len(repr(record)) < 300
        assert "\n" not in repr(record)


def test_the_same_profile_gives_the_same_bytes(saved: Path, tmp_path: Path) -> None:
    load_profile(saved).save(tmp_path / "again.npz")
    assert same_bytes(tmp_path / "again.npz", saved)


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
        {"matrix": [[1, 1, 1], [1, 1, 1], [1, 1, 1]]},
        {"matrix": [[float("nan"), 0, 0], [0, 1, 0], [0, 0, 1]]},
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
        {
            "vignettings": [
                {"coefficients": [-1, 0, 0], "centre": [0, 0], "lens": "", "focal_mm": None, "aperture": None}
            ]
        },
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
        ("render_coverage", _npy(np.full((5, 5, 5), -1.0)), "negative"),
        ("render_coverage", _npy(np.ones((3, 3, 3))), "coverage of shape"),
        ("render_coverage", _npy(np.zeros((130, 130, 130))), "refused, the array style0_render_coverage"),
        ("model0_gamut_map_centres", _npy(np.zeros((20_001, 3))), "refused, the array style0_model0_gamut_map"),
        ("model0_response", _npy(np.zeros((2, 2, 2, 2, 2))), "refused, the array style0_model0_response"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",  # bytes would make names of megabytes
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
    model = styles["standard"]["models"][0]
    model["matrix"] = [[1.0, 0.0], [0.0, 1.0]]
    _edit(saved, styles=styles)
    assert "matrix" in _refused(saved)
    model["matrix"], model["white_balances"] = np.eye(3).tolist(), [["daylight"], 3]
    _edit(saved, styles=styles)
    assert all(isinstance(name, str) for name in load_profile(saved).styles["standard"].models[0].white_balances)


FOLDERS = ("fluorescent", "other_white_balances")


@pytest.fixture(scope="module")
def paths(shared_data: Path) -> list[Path]:
    return [shared_data / "nus_nikon_d40" / name for name in FOLDERS]


@pytest.fixture(scope="module")
def models(paths: list[Path]) -> list[PublishedModel]:
    return [read_published_model(path) for path in paths]


@pytest.fixture(scope="module")
def profile(paths: list[Path]) -> CameraProfile:
    return import_published(paths, "Nikon D40")


def test_the_files_are_read_as_they_stand(models: list[PublishedModel]) -> None:
    # raw2jpg_transform.txt, raw2jpg_ctrlPoints.txt of fluorescent/.
    model, other = models
    assert (len(model.linear), list(model.white_balances)) == (936, ["fluorescent"])
    assert len(other.linear) == 3018
    assert set(other.white_balances) == {"tungsten", "flash", "daylight", "cloudy", "shade"}
    assert other.white_balances["tungsten"].multipliers[2] > other.white_balances["daylight"].multipliers[2]


def test_they_render_their_own_centres_and_linearize_them(models: list[PublishedModel]) -> None:
    for published in models:
        model = published.model
        rendered = model.response.encode(model.gamut_map(published.linear))
        assert np.linalg.norm(rendered - published.encoded, axis=1).mean() * 255 < 0.6
        back = model.inverse_gamut_map(model.response.linearize(published.encoded))
        assert np.linalg.norm(back - published.linear, axis=1).mean() < 1e-3


def test_exports_are_imported_again(models: list[PublishedModel], profile: CameraProfile, tmp_path: Path) -> None:
    folders = export_published(profile, "standard", tmp_path / "nus_nikon_d40")
    again = import_published(folders, "Nikon D40")
    rng = np.random.default_rng(0)
    for name, balance in profile.white_balances.items():
        np.testing.assert_allclose(again.white_balances[name].factors, balance.factors, rtol=1e-8)
        raw = rng.random((500, 3)) / balance.factors
        selector = f"standard/{name}"
        np.testing.assert_allclose(again.render(selector)(raw), profile.render(selector)(raw), atol=1e-6)
        codes = rng.random((500, 3))
        np.testing.assert_allclose(again.linearize(selector)(codes), profile.linearize(selector)(codes), atol=1e-6)
    for first, second in zip(models, map(read_published_model, folders), strict=True):
        np.testing.assert_allclose(second.encoded, first.encoded, atol=1e-6)


def test_what_the_files_cannot_hold_is_refused(profile: CameraProfile, tmp_path: Path) -> None:
    model = profile.styles["standard"].models[0]
    even = replace(model, gamut_map=replace(model.gamut_map, offset=0.1, correction_offset=0.1))
    with pytest.raises(ProfileError, match="--preset thesis"):
        export_published(replace(profile, styles={"standard": PictureStyle(models=(even,))}), "standard", tmp_path)
    with pytest.raises(ProfileError, match="no camera model"):
        export_published(replace(profile, styles={"standard": PictureStyle()}), "standard", tmp_path)
    with pytest.raises(ProfileError, match="no matrix from that of Reference"):
        export_published(replace(profile, provenance=ReferenceRaw("Reference", np.eye(3))), "standard", tmp_path)


def test_settings_are_as_printed(paths: list[Path], models: list[PublishedModel], profile: CameraProfile) -> None:
    """Ts·Tw with the common factor of each setting, in linear light, to the files' six decimals."""
    for path, model in zip(paths, models, strict=True):
        lines = [line.split() for line in (path / "raw2jpg_transform.txt").read_text().splitlines()]
        assert list(model.white_balances) and int(lines[0][0]) == len(model.white_balances)
        for place, name in enumerate(model.white_balances):
            product = np.array(lines[5 + 5 * place : 8 + 5 * place], dtype=np.float64)
            factors = profile.multipliers(f"standard/{name}")
            np.testing.assert_allclose(model.model.matrix * factors, product, atol=1.5e-6)


def test_our_own_fit_of_its_pairs_split_in_two(models: list[PublishedModel]) -> None:
    model = models[1]
    source, target, encoded = model.linear, model.mapped, model.encoded
    means = []
    for seed in range(2):
        order = np.random.default_rng(seed).permutation(len(source))
        train, test = order[: int(0.7 * len(order))], order[int(0.7 * len(order)) :]
        fit = fit_gamut_map(source[train], target[train])
        rendered = model.model.response.encode(fit(source[test]))
        means.append(float(np.linalg.norm(rendered - encoded[test], axis=1).mean()))
    assert np.mean(means) <= 0.0035


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("raw2jpg_transform.txt", "abc", "line 1"),
        ("raw2jpg_transform.txt", "2\n1 0 0\n0 1 0\n0 0 1\n", "expected a count n"),
        ("raw2jpg_ctrlPoints.txt", "3\n0 0 0\n1 1 1\n", "says '3' points, 2 follow"),
        ("raw2jpg_coefs.txt", "1\n0 0 0\n", "rows for"),
        ("raw2jpg_respFcns.txt", "1\n0 0 nan\n", "not finite"),
        ("raw2jpg_respFcns.txt", "", "empty"),
    ],
)
def test_damaged_files_are_named(tmp_path: Path, name: str, text: str, message: str) -> None:
    write_small(tmp_path)
    read_published_model(tmp_path)  # whole, it reads
    (tmp_path / name).write_text(text)
    with pytest.raises(ProfileError, match=message) as caught:
        read_published_model(tmp_path)
    assert name in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_folder_or_file(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match="no such folder"):
        read_published_model(tmp_path / "none")
    with pytest.raises(ProfileError, match=r"holds no raw2jpg_transform\.txt; give"):
        read_published_model(tmp_path)
    with pytest.raises(ProfileError, match="holds no raw2jpg_transform"):  # before a name is asked for
        import_published([tmp_path])


def test_the_camera_is_named_by_the_folder_above_or_asked_for(tmp_path: Path) -> None:
    for name in ("nus_nikon_d40", "other"):
        (tmp_path / name / "daylight").mkdir(parents=True)
        write_small(tmp_path / name / "daylight")
    assert import_published([tmp_path / "nus_nikon_d40" / "daylight"]).camera == "Nikon D40"
    with pytest.raises(ProfileError, match="--camera"):
        import_published([tmp_path / "other" / "daylight"])


def write_small(folder: Path) -> None:
    """The identity in the published format: one centre, no weights."""
    identity = "1 0 0\n0 1 0\n0 0 1\n"
    for side in ("raw2jpg", "jpg2raw"):
        (folder / f"{side}_transform.txt").write_text(f"1\n{identity}9\n2 0 0\n0 1 0\n0 0 1.5\n2 1 1.5\n")
        (folder / f"{side}_ctrlPoints.txt").write_text("1\n0.5 0.5 0.5\n")
        (folder / f"{side}_destPoints.txt").write_text("1\n0.5 0.5 0.5\n")
        (folder / f"{side}_coefs.txt").write_text(f"5\n0 0 0\n0 0 0\n{identity}")
        rows = "".join(f"{i / 255} {i / 255} {i / 255}\n" for i in range(256))
        (folder / f"{side}_respFcns.txt").write_text("256\n" + rows)


def _document(path: Path) -> dict[str, Any]:
    with zipfile.ZipFile(path) as archive:
        document: dict[str, Any] = json.loads(archive.read("profile.json"))
    return document


MANY: dict[str, Callable[[dict[str, Any]], object]] = {
    "styles": lambda document: {f"s{n}": document["styles"]["vivid"] for n in range(3000)},
    "white_balances": lambda document: {f"b{n}": document["white_balances"]["daylight"] for n in range(3000)},
    "notes": lambda _: ["note"] * 10_000,
    "shots": lambda _: ["a"] * 100_000,
    "vignettings": lambda document: document["vignettings"][:1] * 10_000,
    "diagnoses": lambda document: document["diagnoses"][:1] * 10_000,
    "options": lambda _: {f"o{n}": 1 for n in range(10_000)},
}


@pytest.mark.parametrize("part", MANY)
def test_parts_of_a_profile_have_as_many_entries_as_a_camera_gives(saved: Path, part: str) -> None:
    _edit(saved, **{part: MANY[part](_document(saved))})
    assert "more than any profile's" in _refused(saved)


def test_models_arrays_and_texts_have_limits(saved: Path) -> None:
    document = _document(saved)
    original = saved.read_bytes()
    models = document["styles"]["standard"]["models"]
    for count, says in ((3000, "3000 models"), (2, "named twice")):
        styles = document["styles"] | {"standard": document["styles"]["standard"] | {"models": models * count}}
        _edit(saved, styles=styles)
        assert says in _refused(saved)
        saved.write_bytes(original)
    _edit(saved, styles=document["styles"] | {"again": document["styles"]["vivid"]})
    assert "named twice" in _refused(saved)
    saved.write_bytes(original)
    _edit(saved, notes=["a long note " * 1000])
    assert "longer than any profile's" in _refused(saved)


def test_the_sum_of_a_profile_is_judged_before_it_is_unpacked(saved: Path) -> None:
    """2 million numbers in each of six arrays that nobody names: 96 MB of a small file."""
    _rewrite(saved, {f"spare{n}.npy": _npy(np.zeros((126, 126, 126))) for n in range(6)})
    assert saved.stat().st_size < 1 << 20
    assert "it unpacks to" in _refused(saved)
