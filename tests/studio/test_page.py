"""The studio as a visitor uses it, in headless Chromium: from samples to exports that equal the command line's.

With LUTFORGE_SCREENSHOTS=DIR the pictures of the README are written to DIR: studio_data.png and so on.
"""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlparse

import pytest

from tests.studio.shots_for_the_studio import chart_samples, photograph

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
pytest.importorskip("playwright.sync_api", reason="playwright drives the browser: pip install playwright")
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples, write_samples
from lutforge.studio.workspace import Filters, Workspace

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")

MOST_MS = 300_000  # a config of two weak styles is fitted for a minute and a half where nothing else runs
SCREENSHOTS = os.environ.get("LUTFORGE_SCREENSHOTS")
SIZE = 17 if SCREENSHOTS else 9
HOSTILE = "<script>document.title='broken'</script>"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the studio may open: samples, a photograph, and files that do harm."""
    folder = tmp_path_factory.mktemp("studio")
    samples = chart_samples(patches=60 if SCREENSHOTS else 45)
    write_samples(folder / "samples.csv", samples)
    if SCREENSHOTS:
        photograph(folder / "picture.jpg", 1155, 1732)
    else:
        photograph(folder / "picture.jpg", 240, 360)
    write_samples(folder / "hostile.csv", chart_samples(patches=9, names=(HOSTILE, HOSTILE)))
    header, first = (folder / "samples.csv").read_text().splitlines()[:2]
    (folder / "wide.csv").write_text(header + ",x" * 1_000_000 + "\n" + first + ",1" * 1_000_000 + "\n")
    (folder / "nan.csv").write_text(
        f"{header}\n{first}\n" + re.sub(r"[^,]+$", "nan", first.replace("0.", "nan", 6)) + "\n"
    )
    return folder


@pytest.fixture(scope="module")
def url(folder: Path) -> Iterator[str]:
    """The address of a studio that serves the folder."""
    command = [sys.executable, "-m", "lutforge", "studio", "--no-browser", "--port", "0", "--folder", str(folder)]
    log = (folder / "server.log").open("w")
    server = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder, start_new_session=True)
    try:
        deadline = time.monotonic() + 120
        while (found := re.search(r"http://\S+", (folder / "server.log").read_text())) is None:
            assert server.poll() is None and time.monotonic() < deadline, (folder / "server.log").read_text()
            time.sleep(0.1)
        yield found[0]
    finally:
        os.killpg(server.pid, signal.SIGTERM)
        server.wait(30)
        log.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
        yield browser
        browser.close()


class Visit:
    """A page of the studio, and what went wrong in it."""

    def __init__(self, context: BrowserContext, url: str) -> None:
        self.errors: list[str] = []
        self.page: Page = context.new_page()
        self.page.set_default_timeout(MOST_MS)
        self.page.on("console", lambda message: self.errors.append(message.text) if message.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.goto(url)
        self.reads("Open a sample table")

    def view(self, name: str) -> None:
        self.page.get_by_role("button", name=name, exact=True).click()

    def press(self, name: str) -> None:
        self.page.get_by_role("button", name=name, exact=True).click()

    def write(self, label: str, text: str) -> None:
        box = self.page.get_by_label(label, exact=True)
        box.fill(text)
        box.press("Enter")

    def slide(self, label: str, value: float) -> None:
        self.page.get_by_label(re.compile("^" + re.escape(label))).fill(f"{value:g}")

    def choose(self, label: str, option: str) -> None:
        self.page.get_by_label(label, exact=True).select_option(option)

    def reads(self, text: str) -> None:
        expect(self.page.get_by_text(text).first).to_be_visible(timeout=MOST_MS)

    def open(self, path: str, then: str) -> None:
        self.write("or its path", path)
        self.press("Open")
        self.reads(then)

    def picture(self, name: str) -> None:
        if SCREENSHOTS:
            self.page.wait_for_timeout(2500)
            self.page.screenshot(path=Path(SCREENSHOTS) / f"studio_{name}.png")

    def lasso(self, figure: int, corners: list[tuple[float, float]]) -> None:
        """Draw around corners, as shares of a figure's box."""
        box = self.page.locator(".bk-Figure").nth(figure).bounding_box()
        assert box is not None
        mouse = self.page.mouse
        at = [(box["x"] + x * box["width"], box["y"] + y * box["height"]) for x, y in corners]
        mouse.move(*at[0])
        mouse.down()
        for point in [*at[1:], at[0]]:
            mouse.move(*point, steps=6)
        mouse.up()


@pytest.fixture
def visit(browser: Browser, url: str) -> Iterator[Visit]:
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    visit = Visit(context, url)
    yield visit
    assert visit.errors == []
    context.close()


def command_line(*words: str, folder: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "lutforge", *words], cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )
    assert run.returncode == 0, run.stderr


def expected(samples: SampleSet, filters: Filters) -> str:
    return f"{int((~Workspace(samples, filters=filters).outliers).sum()):,} of {len(samples):,} samples are inliers"


@pytest.mark.slow
def test_from_samples_to_exports(visit: Visit, folder: Path) -> None:
    samples = read_samples(folder / "samples.csv")
    visit.choose("File in the folders", "samples.csv")
    visit.press("Open")
    visit.reads(f"samples.csv: {len(samples):,} samples of 18 shots")
    visit.reads(expected(samples, Filters()))

    # Filter, undo, redo; lasso all points of the second plot; mark by hand what rows name.
    visit.slide("Saturation limit", 0.4)
    visit.reads(expected(samples, Filters(saturation=0.4)))
    visit.press("Undo")
    visit.reads(expected(samples, Filters()))
    visit.press("Redo")
    visit.reads(expected(samples, Filters(saturation=0.4)))
    visit.lasso(1, [(0.108, 0.095), (0.935, 0.095), (0.935, 0.845), (0.108, 0.845)])
    visit.reads(f"{len(samples):,} selected")
    visit.write("Select row, shot or patch", "0-5")
    visit.reads("6 selected")
    visit.press("Mark outliers")
    visit.reads("6 samples marked as outliers")
    visit.write("Outlier group", "by hand")
    visit.press("Save group")
    visit.reads("outlier group by hand: 6 samples, in effect")

    visit.view("Models")
    visit.slide("Nodes per axis", SIZE)
    for model in ("Response only", "Matrix and white balance", "Gamut map", "Lattice"):
        visit.choose("Model", model)
        visit.press("Compute")
        visit.reads(f"{model}: fitted to")
        if model == "Gamut map":
            visit.picture("models")
    visit.reads("Matrix: white-balanced camera RGB → linear sRGB")
    visit.view("Maps")
    visit.reads("Colours to shoot next")
    visit.picture("maps")

    visit.view("Preview")
    visit.write("or its path", "picture.jpg")
    visit.press("Show")
    visit.choose("Taken as", "standard/tungsten")
    visit.choose("Wanted style", "vivid")
    visit.choose("Wanted white balance", "daylight")
    visit.slide("Exposure", 0.8)
    after = visit.page.get_by_alt_text("after: the photograph with the target settings")
    expect(after).to_have_attribute("src", re.compile("^data:image/jpeg"))
    before_overlay = after.get_attribute("src")
    visit.choose("Clipping", "marked orange and violet")
    expect(after).not_to_have_attribute("src", before_overlay or "")
    visit.reads("clipped to white")
    visit.choose("Clipping", "as it is")
    visit.picture("preview")

    visit.view("Export")
    visit.write("Name of the files", "mine")
    for button, news in (
        ("Save samples in the fit", "as the model in use was fitted to"),
        ("Save profile", "profile of Simulated"),
        ("Save workspace", "the whole workspace"),
        ("Bake LUT", "bake: written"),
        ("Write config", "config: written"),
    ):
        visit.press(button)
        visit.reads(news)
    visit.picture("export")
    command_line("calibrate", "mine.parquet", "--size", str(SIZE), "-o", "theirs.npz", folder=folder)
    setting = ["--from", "standard/tungsten", "--to", "vivid/daylight", "--ev", "0.8"]
    command_line("bake", "theirs.npz", "refinish", "-o", "theirs.clf", *setting, folder=folder)
    assert len(read_samples(folder / "mine.parquet")) == len(samples) - 6
    assert (folder / "mine.npz").read_bytes() == (folder / "theirs.npz").read_bytes()
    assert (folder / "mine_refinish.clf").read_bytes() == (folder / "theirs.clf").read_bytes()

    visit.view("Data & outliers")
    visit.choose("Left plot", "Transformed RAW against sRGB")
    visit.choose("Right plot", "Linearization")
    visit.open("mine.workspace", f"mine.workspace: {len(samples):,} samples of 18 shots")
    kept = replace(Filters(), saturation=0.4)
    marked = Workspace(samples, filters=kept).outliers | (samples.patch == "none")
    marked[:6] = True
    visit.reads(f"{int((~marked).sum()):,} of {len(samples):,} samples are inliers")
    visit.choose("Left plot", "sRGB BTF")
    visit.choose("Right plot", "sRGB against RAW")
    visit.write("Select row, shot or patch", "30-44")
    visit.reads("15 selected")
    visit.picture("data")


@pytest.mark.slow
def test_files_and_paths_that_do_harm(visit: Visit, folder: Path) -> None:
    visit.open("../../etc/passwd", "etc/passwd: outside the folders of this studio")
    visit.open("/etc/passwd", "/etc/passwd: outside the folders of this studio")
    visit.open("wide.csv", "wide.csv: line 1: no header")
    visit.open("nan.csv", "nan.csv: line 3:")
    visit.open("hostile.csv", "hostile.csv: 162 samples of 18 shots")
    visit.write("Outlier group", HOSTILE)
    visit.write("Select row, shot or patch", "3")
    visit.press("Save group")
    visit.reads(f"outlier group {HOSTILE}: 1 samples")
    visit.reads(f"shot {HOSTILE}")
    visit.view("Models")
    visit.choose("Model", "Matrix and white balance")
    visit.press("Compute")
    visit.reads("Matrix and white balance: fitted to")
    visit.view("Export")
    visit.write("Name of the files", "../../tmp/outside")
    visit.press("Save profile")
    visit.reads("outside the folders of this studio")
    assert visit.page.title() == "LutForge studio"
    assert visit.page.locator("script", has_text="broken").count() == 0


@pytest.mark.slow
def test_two_visitors_do_not_mix_and_a_fit_can_be_cancelled(browser: Browser, url: str, visit: Visit) -> None:
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    other = Visit(context, url)
    visit.open("samples.csv", "samples.csv: 810 samples" if not SCREENSHOTS else "samples.csv: 1,080 samples")
    other.open("hostile.csv", "hostile.csv: 162 samples")
    visit.view("Models")
    visit.choose("Model", "Gamut map")
    visit.press("Compute")
    # While one fits, the other, and the fitting page itself, go on.
    other.slide("Saturation limit", 0.5)
    other.reads("of 162 samples are inliers")
    visit.view("Export")
    visit.reads("Each export is a command")
    visit.press("Cancel")
    visit.reads("Gamut map: cancelled")
    expect(other.page.get_by_text("cancelled")).to_have_count(0)
    assert other.errors == []
    context.close()


NAMES_AND_PLACES = """controls => controls.map(e => [
  (e.innerText || "") + [...(e.labels || [])].map(label => label.innerText).join("")
    + (e.getAttribute("aria-label") || "") + (e.title || ""),
  e.tabIndex,
  e.outerHTML,
])"""


def test_every_control_is_labelled_and_reached_by_the_keyboard(visit: Visit) -> None:
    for view, text in (
        ("Data & outliers", "Residual distance"),
        ("Models", "Nodes per axis"),
        ("Maps", "Luminance Y"),
        ("Preview", "Wanted style"),
        ("Export", "Name of the files"),
    ):
        tab = visit.page.get_by_role("button", name=view, exact=True)
        tab.focus()
        tab.press("Enter")
        visit.reads(text)
        for role in ("textbox", "combobox", "slider", "checkbox", "button"):
            controls = visit.page.get_by_role(role).evaluate_all(NAMES_AND_PLACES)
            assert [html for name, place, html in controls if not name.strip() or place < 0] == [], (view, role)
        inside = visit.page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
        assert inside[0] <= 1280 and inside[1] <= 720, (view, inside)


@pytest.mark.parametrize("host", ["", "evil.example"], ids=["by its address", "by a name that resolves to it"])
def test_a_foreign_page_is_not_let_in(url: str, host: str) -> None:
    place = urlparse(url)
    request = (
        f"GET /ws HTTP/1.1\r\nHost: {host or place.netloc}\r\nOrigin: http://evil.example\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Protocol: bokeh\r\n\r\n"
    )
    with socket.create_connection((place.hostname or "", place.port or 0), timeout=60) as link:
        link.sendall(request.encode())
        assert b"403" in link.recv(100)
