"""The camera model that the thesis's authors published (Nikon D40, normal style): gold values and a refit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lutforge.calibration.physical.gamut_map import fit_gamut_map
from lutforge.errors import ProfileError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile_data import PictureStyle
from lutforge.model.published_model import PublishedModel, export_published, import_published, read_published_model

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


def test_what_is_exported_is_imported_as_the_same_model(
    models: list[PublishedModel], profile: CameraProfile, tmp_path: Path
) -> None:
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
    model = profile.styles["standard"].physical[0]
    even = replace(model, gamut_map=replace(model.gamut_map, offset=0.1))
    with pytest.raises(ProfileError, match="--preset thesis"):
        export_published(replace(profile, styles={"standard": PictureStyle(physical=(even,))}), "standard", tmp_path)
    with pytest.raises(ProfileError, match="no physical model"):
        export_published(replace(profile, styles={"standard": PictureStyle()}), "standard", tmp_path)
    with pytest.raises(ProfileError, match="no matrix from that of Reference"):
        export_published(replace(profile, raw_camera="Reference", raw_transfer=np.eye(3)), "standard", tmp_path)


def test_every_setting_is_the_product_that_the_files_print(
    paths: list[Path], models: list[PublishedModel], profile: CameraProfile
) -> None:
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
