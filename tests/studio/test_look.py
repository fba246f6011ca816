"""The look of a picture in headless Chromium: its pixels are OpenColorIO's, and all can be done by mouse and keyboard.

WebGL2 is SwiftShader's, on the processor.
"""

import re
import shutil
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from functools import partial
from io import BytesIO
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lutforge.arrays import Array
from lutforge.colour.icc_profile import adobe_rgb_profile
from lutforge.errors import LutError
from lutforge.images.icc import to_srgb
from lutforge.luts.ops import Cube, Curve, Matrix, Range
from lutforge.luts.sequence import Lut
from lutforge.model.lattice import grid, uniform_levels

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
pytest.importorskip("playwright.sync_api", reason="playwright drives the browser: pip install playwright")
import panel as pn
from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright

from lutforge.pipeline.photographs import picture_bytes
from lutforge.studio.look_view import LookView, pack_lut
from tests.cases.same_bytes import same_bytes

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
HEIGHT, WIDTH = 200, 300
# Bokeh warns of each message of a model that a page did not load with, as the studio's view does not.
pytestmark = pytest.mark.filterwarnings("ignore:reference already known")


def colours() -> NDArray[np.uint8]:
    """A picture of random colours, a quarter of them with a channel at 0 or 255, the first row grey."""
    rng = np.random.default_rng(5)
    codes = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    codes[: HEIGHT // 4] = np.where(rng.random((HEIGHT // 4, WIDTH, 3)) < 0.5, codes[: HEIGHT // 4], 255)
    codes[0] = np.linspace(0, 255, WIDTH).astype(np.uint8)[:, None]
    return codes


def png(codes: NDArray[np.uint8]) -> bytes:
    buffer = BytesIO()
    Image.fromarray(codes).save(buffer, format="PNG")
    return buffer.getvalue()


def bent(ev: float = 0.4, seed: int = 1) -> Lut:
    """Every kind of operation, with tables that no smaller ones stand for."""
    rng, even = np.random.default_rng(seed), grid(uniform_levels(17))
    front = np.sort(rng.random((4096, 3)), axis=0)
    first = np.clip(even + rng.normal(0, 0.08, even.shape), 0, 2)
    matrix = Matrix(np.eye(3) * 2.0**ev + rng.normal(0, 0.1, (3, 3)), np.array([0.01, 0.0, -0.02]))
    last = np.clip(even + rng.normal(0, 0.05, even.shape), -0.1, 1.1)
    back = Curve(np.linspace(0, 1, 2049)[:, None] ** np.array([0.9, 1.0, 1.1]), 0.0, 1.2)
    return Lut((Curve(front), Cube(first, "trilinear"), matrix, Range(0.0, None), Range(), Cube(last), back))


def floats(lut: Lut, codes: NDArray[np.uint8]) -> Array:
    """What OpenColorIO makes of the codes, 255 = full scale."""
    pixels = np.ascontiguousarray(codes, dtype=np.float32) / np.float32(255)
    lut.processor().applyRGB(pixels)
    return np.clip(pixels.astype(np.float64), 0, 1) * 255


@pytest.fixture(scope="module")
def browsers() -> Iterator[Callable[..., Browser]]:
    with sync_playwright() as playwright:
        opened: dict[tuple[str, ...], Browser] = {}

        def browser(*more: str) -> Browser:
            if more not in opened:
                options = [
                    "--no-sandbox",
                    "--disable-dev-shm-usage",
                    "--disable-gpu",
                    "--force-color-profile=srgb",
                    *more,
                ]
                opened[more] = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
            return opened[more]

        yield browser
        for each in opened.values():
            each.close()


Places = SimpleQueue[tuple[pn.Column, Any]]
"""The places for a view in the pages that have loaded, each with its Bokeh document."""


class Tab:
    """A page that is loaded once, which takes seconds, and shows one view after the other."""

    def __init__(self, page: Page, url: str, places: Places) -> None:
        self.errors: list[str] = []
        self.page = page
        page.set_default_timeout(30_000)
        expect.set_options(timeout=30_000)
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda message: self.errors.append(message.text) if message.type == "error" else None)
        page.goto(url)
        self._place, self._document = places.get(timeout=30)

    def do(self, action: Callable[[], Any]) -> Any:
        """Act as `PageLink.guarded` does, with all changes as one message; return what the action returns.

        Without the hold Panel may keep back what changes while an earlier message is being written.
        """
        done: Future[Any] = Future()

        def act() -> None:
            self._document.hold("combine")
            try:
                result = action()
            finally:
                self._document.unhold()
            done.set_result(result)

        self._document.add_next_tick_callback(act)
        return done.result(30)

    def show(self, view: LookView) -> Locator:
        """Show a view in place of the last one, and return its root when the page has drawn it."""
        root = self.page.locator(".look")
        self.do(self._place.clear)
        root.wait_for(state="detached")
        self.page.mouse.move(-1, -1)  # off the page, where the pointer is before a visitor comes
        self.do(lambda: self._place.append(view))
        root.wait_for()
        return root


class Served:
    """A view of its own in a tab: nothing of the views before it is left there."""

    def __init__(self, tab: Tab) -> None:
        tab.errors.clear()
        self.tab = tab
        self.page = tab.page
        self.view = LookView()
        self.root = tab.show(self.view)

    def do(self, action: Callable[[LookView], Any]) -> Any:
        """Act on the view, and return what the action returns."""
        return self.tab.do(lambda: action(self.view))

    def drawn(self) -> None:
        """Wait until the page shows the last look, in full, has measured it, and has nothing left to draw."""
        number = self.do(lambda view: view.number)
        expect(self.root).to_have_attribute("data-drawn", str(number))
        expect(self.root).to_have_attribute("data-rests", "true")
        expect(self.root).to_have_attribute("data-full", "true")

    def pixels(self) -> NDArray[np.uint8]:
        """The picture as the screen shows it at 100 %, (HEIGHT, WIDTH, 3)."""
        self.drawn()
        shot = np.asarray(Image.open(BytesIO(self.page.locator("canvas.picture").screenshot())).convert("RGB"))
        top, left = (shot.shape[0] - HEIGHT) // 2, (shot.shape[1] - WIDTH) // 2
        return shot[top : top + HEIGHT, left : left + WIDTH]

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.locator("canvas.picture").press(key)


@pytest.fixture(scope="module")
def served() -> Iterator[tuple[str, Places]]:
    places: Places = SimpleQueue()

    def page() -> Any:
        place, document = pn.Column(sizing_mode="stretch_both"), pn.state.curdoc
        pn.state.onload(lambda: places.put((place, document)))  # Panel loses changes made while a page loads
        return place

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    server = pn.serve({"/": page}, port=port, address="127.0.0.1", show=False, threaded=True, verbose=False)
    yield f"http://127.0.0.1:{port}/", places
    server.stop()


@pytest.fixture(scope="module")
def tab(browsers: Callable[..., Browser], served: tuple[str, Places]) -> Tab:
    return Tab(browsers().new_page(viewport={"width": 900, "height": 640}), *served)


@pytest.fixture
def look(tab: Tab) -> Iterator[Served]:
    """A view of the picture at 100 %, graded, with no waveform."""
    look = Served(tab)
    look.do(lambda view: view.param.update(mode="graded", scopes=False))
    look.do(lambda view: view.show(png(colours()), "colours.png"))
    expect(look.root).to_have_attribute("data-opened", re.compile(f"{WIDTH} × {HEIGHT}"))
    look.press("1")
    yield look
    assert tab.errors == []


@needs_chromium
def test_pixels_are_those_of_open_color_io(look: Served) -> None:
    assert np.array_equal(look.pixels(), colours())  # no look yet
    for lut in (bent(), bent(-0.7, seed=2), Lut((Cube(bent().ops[5].values, "trilinear"),))):  # type: ignore[union-attr]
        look.do(partial(LookView.grade, lut=lut, name="bent"))
        assert np.abs(look.pixels() - floats(lut, colours())).max() < 0.51


@needs_chromium
def test_a_look_is_drawn_once_and_then_measured(look: Served) -> None:
    look.do(lambda view: view.param.update(scopes=True))
    look.do(lambda view: view.grade(bent(), "bent"))
    look.drawn()
    told = "e => [Number(e.dataset.frames), Number(e.dataset.scoped)]"
    frames, scoped = look.root.evaluate(told)
    look.do(lambda view: view.grade(bent(-0.5), "darker"))
    look.drawn()
    assert look.root.evaluate(told)[0] <= frames + 2  # the second in full, where the first was hurried
    assert look.root.evaluate(told)[1] > scoped


@pytest.mark.slow
@needs_chromium
def test_scopes_follow_a_look_that_moves(look: Served) -> None:
    """They are not left for the end of the move, while one look follows the other at once."""
    look.do(lambda view: view.param.update(scopes=True))
    look.do(lambda view: view.grade(bent(), "bent"))
    look.drawn()
    before = look.root.get_attribute("data-measured")
    is_drawn = "number => Number(document.querySelector('.look')?.dataset.drawn ?? number) >= number"
    for step in range(200):
        look.do(partial(LookView.grade, lut=bent(0.002 * step), name="moving"))
        look.page.wait_for_function(is_drawn, arg=look.do(lambda view: view.number), polling="raf")
        if look.root.get_attribute("data-measured") != before:
            break
    else:
        pytest.fail("no scope was drawn while the look moved")


@pytest.mark.slow
@needs_chromium
def test_a_table_is_sent_once(look: Served) -> None:
    """A step of a slider sends what it changes; what the page has lost it asks for."""
    ops, sent = bent().ops, list[dict[str, Any]]()
    look.do(lambda view: view.grade(bent(), "bent"))
    look.drawn()

    def listened(tables: list[dict[str, Any]]) -> None:
        sent.extend(tables)
        LookView._send_msg(look.view, tables)

    look.do(lambda view: setattr(view, "_send_msg", listened))
    for ev in (0.1, 0.2):
        gain = Matrix(2.0**ev * np.eye(3))
        look.do(partial(LookView.grade, lut=Lut((*ops[:2], gain, *ops[3:])), name="brighter"))
        look.drawn()
    assert sent == []
    other = Cube(0.5 * ops[5].values)  # type: ignore[union-attr]
    look.do(partial(LookView.grade, lut=Lut((*ops[:5], other, *ops[6:])), name="darker"))
    look.drawn()
    assert [each["size"] for each in sent] == [[17, 17, 17]]
    lost = look.do(lambda view: view.number)
    look.root.evaluate(
        """root => new Promise(resolve => {
          const canvas = root.querySelector(".picture");
          const context = canvas.getContext("webgl2").getExtension("WEBGL_lose_context");
          canvas.addEventListener("webglcontextrestored", () => setTimeout(resolve, 1500));
          context.loseContext();
          setTimeout(() => context.restoreContext(), 300);
        })"""
    )
    assert lost == look.do(lambda view: view.number) and len(sent) == 1 + 4
    graded = floats(Lut((*ops[:5], other, *ops[6:])), colours())
    assert np.abs(look.pixels() - graded).max() < 0.51


@pytest.mark.slow
@needs_chromium
def test_wipe_and_sides(look: Served) -> None:
    lut = bent()
    look.do(lambda view: view.grade(lut, "bent"))
    graded = np.rint(floats(lut, colours()))
    look.press("w")
    line = look.page.get_by_role("slider", name="Wipe")
    expect(line).to_have_attribute("aria-valuenow", "50")
    look.drawn()
    box = look.page.locator(".stage").bounding_box()
    assert box is not None
    look.page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 300)
    look.page.mouse.down()
    look.page.mouse.move(box["x"] + 0.5 * box["width"] - 40, box["y"] + 300, steps=5)
    look.page.mouse.up()
    expect(line).to_have_attribute("aria-valuenow", str(round(50 - 4000 / box["width"])))
    look.drawn()
    assert look.do(lambda view: view.wipe) == pytest.approx(0.5 - 40 / box["width"], abs=0.003)
    seen, cut = look.pixels(), WIDTH // 2 - 40
    assert np.array_equal(seen[:60, : cut - 4], colours()[:60, : cut - 4])
    assert np.abs(seen[:60, cut + 14 :] - graded[:60, cut + 14 :]).max() <= 1
    line.press("ArrowRight")
    look.drawn()
    assert look.do(lambda view: view.wipe) == pytest.approx(0.51 - 40 / box["width"], abs=0.003)

    # Keep it as B, take another look, and see B on the left.
    look.press("b")
    expect(look.page.get_by_role("button", name="Beside B")).to_have_attribute("aria-pressed", "true")
    other = bent(-1, seed=4)
    look.do(lambda view: view.grade(other, "darker"))
    expect(look.page.locator(".side.left")).to_have_text("B: bent")
    expect(look.page.locator(".side.right")).to_have_text("darker")
    look.press("o")
    assert np.abs(look.pixels() - graded).max() <= 1
    look.page.get_by_role("button", name="Beside B").click()
    assert np.array_equal(look.pixels(), colours())
    look.press("s")
    look.drawn()
    expect(look.page.locator(".side.right")).to_be_visible()


@pytest.mark.slow
@needs_chromium
def test_pipette_and_zoom(look: Served) -> None:
    lut = bent()
    look.do(lambda view: view.grade(lut, "bent"))
    look.press("p", "ArrowLeft", "Shift+ArrowUp")
    x, y = WIDTH // 2 - 1, HEIGHT // 2 - 10
    values = look.page.locator(".values")
    jpeg = "  ".join(map(str, colours()[y, x]))
    codes = "  ".join(f"{value:.0f}" for value in np.rint(floats(lut, colours())[y, x]))
    expect(values).to_contain_text(f"x {x}, y {y}")
    expect(values).to_contain_text(f"JPEG {jpeg}")
    expect(values).to_contain_text(f"A {codes}")
    assert look.page.get_by_role("application", name=re.compile("colours.png")).count() == 1
    look.press("Escape", "0")
    expect(look.page.locator(".zoomed")).not_to_have_text("100 %")
    box = look.page.locator(".stage").bounding_box()
    assert box is not None
    look.page.mouse.dblclick(box["x"] + 200, box["y"] + 200)
    expect(look.page.locator(".zoomed")).to_have_text("100 %")
    look.page.mouse.wheel(0, -600)
    expect(look.page.locator(".zoomed")).to_have_text(re.compile("2[45]. %"))


@pytest.mark.slow
@needs_chromium
def test_overlays_and_waveform(look: Served) -> None:
    look.do(lambda view: view.grade(Lut((Range(),)), "as it is"))
    look.do(lambda view: view.cover(Lut((Matrix(np.eye(3)), Range()))))
    look.press("c")
    seen, codes = look.pixels().astype(int), colours()
    orange = np.abs(seen - (230, 97, 1)).max(axis=2) <= 1
    assert 0.4 < orange[(codes == 255).any(axis=2)].mean() < 0.6  # every second stripe
    assert not orange[
        ((codes > 0) & (codes < 255)).all(axis=2) & (np.abs(codes.astype(int) - (230, 97, 1)).max(2) > 2)
    ].any()
    look.press("c", "u")
    green = np.abs(look.pixels().astype(int) - (0, 158, 115)).max(axis=2) <= 1
    assert 0.4 < green[codes[..., 2] < 127].mean() < 0.6
    assert green[codes[..., 2] > 128].mean() < 0.001
    look.press("u", "h")
    expect(look.root).to_have_attribute("data-scoped", re.compile(r"\d"))
    clipped = 100 * (codes == 255).any(axis=2).mean()
    output = look.page.locator(".scopes p").inner_text()
    assert float(output.split(" %")[0]) == pytest.approx(clipped, abs=1.0)
    lit = "c => c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(v => v > 40 && v < 255)"
    assert look.page.get_by_role("img", name="Waveform").evaluate(lit)


@pytest.mark.slow
@needs_chromium
def test_a_browser_without_webgl_is_told(browsers: Callable[..., Browser], served: tuple[str, Places]) -> None:
    page = browsers("--disable-software-rasterizer").new_page()
    expect(Served(Tab(page, *served)).root).to_contain_text("no WebGL2")
    page.close()


def test_what_the_page_cannot_draw_is_refused() -> None:
    knots = np.linspace(0, 1, 4)[:, None] ** np.ones(3)
    with pytest.raises(LutError, match="bake"):
        pack_lut(Lut((Curve(knots, inputs=knots),)))
    (same, tables), (other, _) = pack_lut(bent()), pack_lut(bent(seed=2))
    assert (same, tables) == pack_lut(bent())
    assert same[0]["key"] != other[0]["key"] and set(tables) == {op["key"] for op in same if "key" in op}


def test_a_picture_in_another_space_is_shown_as_it_will_be_graded(tmp_path: Path) -> None:
    wide, plain = tmp_path / "wide.jpg", tmp_path / "plain.jpg"
    codes = np.full((16, 24, 3), (60, 140, 90), np.uint8)
    Image.fromarray(codes).save(wide, icc_profile=adobe_rgb_profile(), quality=100)
    Image.fromarray(codes).save(plain, quality=100)
    assert same_bytes(plain, picture_bytes(plain))
    with Image.open(BytesIO(picture_bytes(wide))) as shown:
        assert np.abs(np.asarray(shown, float) - to_srgb(codes, adobe_rgb_profile())).max() <= 2
