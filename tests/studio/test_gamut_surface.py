"""The gamut map in 3D: its grid covers the slice of the cube, and a browser turns, zooms and saves it offline."""

import json
import shutil
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
pytest.importorskip("playwright.sync_api", reason="playwright drives the browser: pip install playwright")
import panel as pn
from playwright.sync_api import sync_playwright

from lutforge.model.gamut_map import GamutMap, identity_gamut_map
from lutforge.report.gamut_slices import LUMINANCE
from lutforge.studio.gamut_surface import GamutSurface, slice_grid, surface_of

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
CAMERA = "drawing => JSON.stringify(drawing.layout.scene.camera.eye)"


def halved() -> GamutMap:
    """Half of red; one control point at a grey of 0.25."""
    polynomial = np.vstack([np.zeros(3), np.diag([0.5, 1.0, 1.0])])
    return GamutMap(np.full((1, 3), 0.25), np.zeros((1, 3)), polynomial)


@pytest.mark.parametrize("luminance", [0.02, 0.0722, 0.25, 0.5, 0.7152, 0.9])
def test_the_grid_covers_the_slice_of_the_cube(luminance: float) -> None:
    grid = slice_grid(luminance)
    assert np.allclose(grid @ LUMINANCE, luminance) and grid.min() > -1e-12 and grid.max() < 1 + 1e-12
    assert np.allclose(grid[0], luminance)
    assert np.allclose(np.minimum(grid[-1], 1 - grid[-1]).min(axis=1), 0, atol=1e-12)  # on a face of the cube
    assert np.allclose(grid[-1, 0], grid[-1, -1])
    # Its cells make up the area of all colours of this luminance, seen along G.
    rng = np.random.default_rng(0).random((200_000, 2))
    green = (luminance - rng @ LUMINANCE[[0, 2]]) / LUMINANCE[1]
    red, blue = grid[-1, :, 0], grid[-1, :, 2]
    area = 0.5 * abs(np.sum(red[:-1] * blue[1:] - red[1:] * blue[:-1]))
    assert area == pytest.approx(((green >= 0) & (green <= 1)).mean(), abs=0.005)


def test_the_surface_is_where_the_map_takes_the_slice() -> None:
    drawn, grid = surface_of(halved(), 0.25, "halved"), slice_grid(0.25)
    assert np.allclose(drawn["after"], np.moveaxis(grid * [0.5, 1, 1], 2, 0), atol=1e-5)
    assert np.allclose(drawn["change"], 0.5 * grid[..., 0], atol=1e-5)
    assert np.allclose(drawn["centres"], [[0.25]] * 3)
    assert not np.any(surface_of(identity_gamut_map(), 0.25, "")["change"])
    assert surface_of(halved(), 0.6, "")["centres"] == [[], [], []]
    json.dumps(drawn)


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    def page() -> Any:
        surface = GamutSurface(surface=surface_of(halved(), 0.25, "halved, Y = 0.25"), sizing_mode="stretch_both")
        return pn.Column(surface, height=400, width=600)

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    server = pn.serve({"/": page}, port=port, address="127.0.0.1", show=False, threaded=True, verbose=False)
    yield f"http://127.0.0.1:{port}/"
    server.stop()


@pytest.mark.slow
@needs_chromium
def test_it_is_turned_and_zoomed_by_mouse_and_keys_and_saved(url: str, tmp_path: Path) -> None:
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
        page, asked, errors = browser.new_page(), [], []
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(url)
        drawing = page.get_by_role("application", name="halved, Y = 0.25")
        page.get_by_text("control points").wait_for()

        def eye() -> np.ndarray[Any, np.dtype[np.float64]]:
            return np.array([json.loads(drawing.evaluate(CAMERA))[axis] for axis in "xyz"])

        first = eye()
        drawing.press("ArrowRight")
        turned = eye()
        assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(first)) and turned[2] == pytest.approx(first[2])
        cosine = turned[:2] @ first[:2] / (first[:2] @ first[:2])
        assert cosine == pytest.approx(np.cos(np.pi / 36))
        drawing.press("+")
        assert np.allclose(eye(), turned / 1.15)
        drawing.press("0")
        assert np.array_equal(eye(), first)
        box = drawing.bounding_box()
        assert box is not None
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(*middle)
        page.mouse.down()
        page.mouse.move(middle[0], middle[1] + 20)
        page.mouse.up()
        assert eye()[2] > first[2]  # drawn down, it is seen from above
        high = eye()
        page.mouse.wheel(0, 100)
        page.wait_for_timeout(300)
        assert np.linalg.norm(eye()) > np.linalg.norm(high)
        for suffix in ("png", "svg"):
            with page.expect_download() as download:
                page.get_by_role("button", name=f"Save as {suffix.upper()}").click()
            assert download.value.suggested_filename == f"halved_Y_0_25.{suffix}"
            download.value.save_as(tmp_path / f"saved.{suffix}")
        colours = np.asarray(Image.open(tmp_path / "saved.png").convert("RGB")).reshape(-1, 3)
        assert len(np.unique(colours, axis=0)) > 500  # the surface's shades
        assert ElementTree.parse(tmp_path / "saved.svg").getroot().tag.endswith("svg")
        assert errors == [] and all(each.startswith((url, "data:", "blob:")) for each in asked)
        browser.close()


@needs_chromium
def test_without_webgl_it_says_what_shows_the_same(url: str) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu", "--disable-3d-apis"]
        )
        page = browser.new_page()
        page.goto(url)
        page.get_by_text("This browser has no WebGL: the slices show the same map, as arrows.").wait_for()
        assert page.get_by_role("application").count() == 0
        browser.close()
