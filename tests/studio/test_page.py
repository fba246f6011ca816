"""The studio as a visitor uses it, in headless Chromium: from shots to exports that equal the command line's.

With LUTFORGE_SCREENSHOTS=DIR the pictures of the guide are written to DIR: studio_samples.png and so on, and each step
in three sizes. `make studio-pictures` takes those of the guide alone.
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
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlparse
from urllib.request import urlopen

import pytest

from tests.cases.charts import photograph_chart
from tests.cases.same_bytes import same_bytes
from tests.studio.shots_for_the_studio import chart_samples, photograph

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
pytest.importorskip("playwright.sync_api", reason="playwright drives the browser: pip install playwright")
from bokeh.client import pull_session
from bokeh.models import ImportedStyleSheet
from platformdirs import user_cache_path
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from lutforge.calibration.options import CalibrationOptions
from lutforge.cli.demo_shots import demo_shots
from lutforge.colour.spectra import chart_reflectances
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.chart import chart_kind
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from lutforge.simulate.camera import nikon_d5100
from lutforge.studio.page import PAGE_NAMES
from lutforge.studio.workspace import Workspace

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")

MOST_MS = 300_000  # a config of two weak styles is fitted for a minute and a half where nothing else runs
SCREENSHOTS = os.environ.get("LUTFORGE_SCREENSHOTS")
SIZE = 17 if SCREENSHOTS else 9
SIZES = ((1280, 720), (1920, 1080), (3840, 2160))
HOSTILE = "<script>document.title='broken'</script>"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the studio may open: samples, a photograph, and files that do harm."""
    folder = tmp_path_factory.mktemp("studio")
    samples = chart_samples(patches=60 if SCREENSHOTS else 45)
    samples.save(folder / "samples.csv")
    if SCREENSHOTS:
        photograph(folder / "picture.jpg", 1155, 1732)
    else:
        photograph(folder / "picture.jpg", 240, 360)
    chart_samples(patches=9, names=(HOSTILE, HOSTILE)).save(folder / "hostile.csv")
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
    expect.set_options(timeout=MOST_MS)  # on a busy machine a page is slow in everything
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
        yield browser
        browser.close()


_SET = """(input, value) => {
  Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(input, value);
  for (const name of ["input", "change"]) input.dispatchEvent(new Event(name, { bubbles: true }));
}"""


class Visit:
    """A page of the studio, and what went wrong in it."""

    def __init__(self, context: BrowserContext, url: str) -> None:
        self.url = url
        self.errors: list[str] = []
        self.page: Page = context.new_page()
        self.page.set_default_timeout(MOST_MS)
        self.page.on("console", lambda message: self.errors.append(message.text) if message.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.goto(url)
        self.reads("Drop RAW files with their JPEGs here")
        expect(self.page.locator("[data-ready]")).to_be_attached(timeout=MOST_MS)

    def step(self, name: str) -> None:
        self.page.get_by_role("tab", name=re.compile("^" + name)).click()
        expect(self.page.locator("b", has_text=f"{name}.")).to_be_visible(timeout=MOST_MS)

    def press(self, name: str) -> None:
        self.page.get_by_role("button", name=name, exact=True).click()

    def press_named(self, name: str) -> None:
        """Press Undo or Redo, which name the change that they make."""
        self.page.get_by_role("button", name=re.compile(f"^{name}")).click()

    def fold(self, name: str) -> None:
        self.page.get_by_role("button", name=name).first.click()

    def write(self, label: str, text: str) -> None:
        box = self.page.get_by_label(label, exact=True)
        box.fill(text)
        box.press("Enter")

    def slide(self, label: str, value: float) -> None:
        """Move a slider, the upper end of one with two."""
        slider = self.page.get_by_role("slider", name=re.compile("^" + re.escape(label))).last
        slider.evaluate(_SET, f"{value:g}")

    def choose(self, label: str, option: str) -> None:
        """Choose from a list; a click that falls into its redrawing is lost, and made again, as a user does."""
        self.page.get_by_label(label, exact=True).first.click()
        item = self.page.locator(".MuiMenuItem-root").filter(has_text=re.compile(f"^{re.escape(option)}$"))
        for _ in range(3):
            item.click()
            with suppress(AssertionError):
                return expect(item).to_be_hidden(timeout=20_000)
        raise AssertionError(f"{label}: {option} cannot be chosen")

    def fit(self, nodes: int, *models: str) -> None:
        """Compute models, or the one that is chosen."""
        self.step("Model")
        self.fold("Options")
        self.slide("Nodes per axis", nodes)
        for model in models or ("Lattice",):
            if models:
                self.choose("Model", model)
            self.press("Compute")
            self.reads(f"{model}: fitted to")

    def look_at(self, picture: str, style: str, balance: str) -> None:
        """Show a picture that does not tell how it was taken, and say so."""
        self.step("Look")
        self.choose("Photograph in the folders", picture)
        self.press("Show")
        self.reads(f"{picture} does not tell how it was taken")
        self.choose("Taken as: style", style)
        self.choose("Taken as: white balance", balance)

    def export(self, name: str, **news: str) -> None:
        """Press buttons of the last step, each of which tells its news."""
        self.step("Export")
        self.write("Name of the files", name)
        for button, message in news.items():
            self.press(button.replace("_", " "))
            self.reads(message)

    def reads(self, text: str) -> None:
        expect(self.page.get_by_text(text).first).to_be_visible(timeout=MOST_MS)

    def left_and_continued(self) -> "Visit":
        """Close the tab, and go on in a new one."""
        context = self.page.context
        self.page.close()
        again = Visit(context, self.url)
        again.page.get_by_role("link", name="Continue where you were").click()
        again.page.wait_for_url("**/?continue")
        expect(again.page.locator("[data-ready]")).to_be_attached(timeout=MOST_MS)
        again.errors += self.errors
        return again

    def shows(self, **chosen: str) -> None:
        """Lists by their labels, with what is chosen in them."""
        for label, option in chosen.items():
            expect(self.page.get_by_label(label.replace("_", " "), exact=True).first).to_have_text(option)

    def is_at(self, label: str, value: str) -> None:
        """A slider with its value, of two the upper one."""
        expect(self.page.get_by_role("slider", name=re.compile("^" + re.escape(label))).last).to_have_value(value)

    def rests(self) -> None:
        """Wait until all figures are drawn, and one frame longer, in which they take their places."""
        self.page.wait_for_function("Bokeh.documents.every(document => document.is_idle)")
        self.page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def open(self, path: str, then: str) -> None:
        self.page.get_by_label("or its path", exact=True).fill(path)
        self.press("Sample")
        self.reads(then)

    def type_value(self, label: str, value: str) -> None:
        """Type the value of a slider over the one that is shown."""
        self.page.locator(".MuiFormControl-root", has_text=label).locator("strong").click()
        line = self.page.get_by_role("textbox", name=re.compile(f"^{re.escape(label)}.*, value$"))
        line.fill(value)
        line.press("Enter")

    def picture(self, name: str) -> None:
        if SCREENSHOTS:
            self.rests()
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
    # Plotly's resize handler runs once more on a figure that a new step has removed.
    assert [error for error in visit.errors if "_guiEditing" not in error] == []
    context.close()


def inlier_count(samples: SampleSet, saturation: float = 1.0) -> str:
    kept = ~Workspace(samples, limits={"saturation": (0.0, saturation)}).outliers
    return f"{int(kept.sum()):,} of {len(samples):,} samples are inliers"


@pytest.mark.slow
def test_a_page_that_loads_slowly_has_its_styles_from_its_own_server(url: str) -> None:
    """Its session has ended meanwhile, so that it begins another one without asking for the page again."""
    session = pull_session(url=url)
    try:
        styles = session.document.select({"type": ImportedStyleSheet})
        addresses = {style.url for style in styles}
    finally:
        session.close()
    assert addresses and all(address.startswith("static/extensions/") for address in addresses), addresses


@pytest.mark.slow
def test_from_a_folder_of_shots_to_a_kit(visit: Visit, folder: Path) -> None:
    """No path is typed, and no file dialog opened: shots, samples, model, look, kit; as the command line makes it."""
    demo_shots(folder / "shots", lambda name: None)
    visit.press("List again")
    visit.choose("Folder or file", "shots")
    visit.press("Sample")
    visit.reads("samples of 21 shots")
    cards = visit.page.locator(".pictures")
    expect(cards).to_have_count(21, timeout=MOST_MS)
    assert cards.first.locator("img").count() == 2
    first, second = (cards.nth(number).bounding_box() for number in range(2))
    assert first is not None and second is not None
    assert first["y"] == second["y"] and first["width"] > 0.4 * 960  # two columns fill a window of 1,280
    visit.picture("shots")
    box = visit.page.get_by_role("checkbox", name="LF0006-standard-tungsten-still-life")
    box.click()
    visit.reads("1 shots left out")
    box.click()
    visit.reads("all shots take part")
    visit.step("Samples")
    visit.choose("Picture of the shot", "LF0006-standard-tungsten-still-life")
    visit.write("Select row, shot or patch", "LF0006-standard-tungsten-still-life")
    visit.reads("selected, 0 of them outliers")
    visit.picture("samples")
    visit.fit(SIZE)
    visit.fold("Options")  # it closes again
    visit.picture("model")
    visit.step("Look")
    visit.choose("Photograph in the folders", "shots/LF0015-vivid-cloudy-still-life.JPG")
    visit.press("Show")
    visit.reads("taken as vivid/cloudy, as its metadata say")
    visit.choose("Wanted: style", "standard")
    visit.choose("Wanted: white balance", "daylight")
    visit.reads("From vivid/cloudy to standard/daylight")
    visit.picture("look")
    visit.export("mine", Save_profile="profile: written")
    visit.choose("Program of the kit", "rawtherapee")
    visit.press("Write kit")
    visit.reads("read README.md first")
    visit.press("Bake LUT")
    visit.reads("LUT, refinish: written")
    visit.picture("export")
    command = ["calibrate", "mine_samples.npz", "--size", str(SIZE), "-o", "theirs.npz"]
    run = subprocess.run([sys.executable, "-m", "lutforge", *command], cwd=folder, capture_output=True)
    assert run.returncode == 0, run.stderr
    assert same_bytes(folder / "mine.npz", folder / "theirs.npz")
    assert (folder / "mine_rawtherapee_kit" / "README.md").is_file()


@pytest.mark.slow
def test_filters_marks_and_stages_reach_what_is_exported(visit: Visit, folder: Path) -> None:
    samples = read_samples(folder / "samples.csv")
    visit.choose("Folder or file", "samples.csv")
    visit.press("Sample")
    visit.reads(f"samples.csv: {len(samples):,} samples of 18 shots")
    visit.step("Samples")
    visit.reads(inlier_count(samples))

    # Filter, undo, redo; lasso all points of the second plot; mark by hand what rows name.
    visit.slide("Saturation", 0.4)
    visit.reads(inlier_count(samples, 0.4))
    visit.press_named("Undo")
    visit.reads(inlier_count(samples))
    visit.press_named("Redo")
    visit.reads(inlier_count(samples, 0.4))
    visit.rests()
    visit.lasso(1, [(0.135, 0.1), (0.93, 0.1), (0.93, 0.81), (0.135, 0.81)])
    visit.reads(f"{len(samples):,} selected")
    visit.write("Select row, shot or patch", "0-5")
    visit.reads("6 selected")
    visit.press("Outliers")
    visit.reads("6 samples marked as outliers")
    visit.write("Outlier group", "by hand")
    visit.press("Save group")
    visit.reads("outlier group by hand: 6 samples, in effect")

    visit.fit(SIZE, "Response, matrix and white balance", "Lattice")
    visit.reads("It builds on the response and matrix that you fitted.")
    visit.reads("Matrix: white-balanced camera RGB → linear sRGB")
    visit.press("Lattice")

    visit.look_at("picture.jpg", "standard", "tungsten")
    visit.choose("Wanted: style", "vivid")
    visit.choose("Wanted: white balance", "daylight")
    visit.slide("Exposure", 0.8)
    visit.reads("From standard/tungsten to vivid/daylight, +0.8 EV.")

    written = {"Save_profile": "profile", "Bake_LUT": "LUT, refinish", "Write_config": "config"}
    news = {button: f"{what}: written" for button, what in (written | {"Save_workspace": "workspace"}).items()}
    visit.export("filtered", **news)
    assert len(read_samples(folder / "filtered_samples.npz")) == len(samples) - 6

    visit.step("Samples")
    visit.slide("Saturation", 0.5)
    expect(visit.page.get_by_role("tab", name="Model: stale")).to_be_visible(timeout=MOST_MS)
    expect(visit.page.get_by_role("tab", name="Export: stale")).to_be_visible(timeout=MOST_MS)
    visit.step("Shots")
    visit.open("filtered.workspace", f"filtered.workspace: {len(samples):,} samples of 18 shots")
    expect(visit.page.get_by_role("tab", name="Model: done")).to_be_visible(timeout=MOST_MS)


@pytest.mark.slow
def test_a_dropped_bracket_gives_a_linearization(visit: Visit, folder: Path, tmp_path: Path) -> None:
    files = photograph_chart(nikon_d5100(), chart_kind("classic"), chart_reflectances(), tmp_path, (-3, -2, -1, 0, 1))
    visit.page.locator("input[type=file]").set_input_files(files)
    visit.reads("5 pictures without RAW: a bracket of 5 exposures over 4.0 stops")
    visit.press("Fit response")
    visit.reads("response: fitted to 5 pictures")
    visit.reads("the response is a fixed property of this camera")
    visit.picture("bracket")
    visit.step("Export")
    visit.write("Name of the files", "phone")
    visit.choose("LUT file", ".cube")
    visit.press("Bake LUT")
    visit.reads("LUT, linearize: written")
    assert "LUT_1D_SIZE" in (folder / "phone_linearize.cube").read_text()


@pytest.mark.slow
def test_files_and_paths_that_do_harm(visit: Visit, folder: Path) -> None:
    visit.open("../../etc/passwd", "etc/passwd: outside the folders of this studio")
    visit.open("/etc/passwd", "/etc/passwd: outside the folders of this studio")
    visit.open("wide.csv", "wide.csv: line 1: no header")
    visit.open("nan.csv", "nan.csv: line 3:")
    visit.open("hostile.csv", "hostile.csv: 162 samples of 18 shots")
    visit.step("Samples")
    visit.write("Outlier group", HOSTILE)
    visit.write("Select row, shot or patch", "3")
    visit.press("Save group")
    visit.reads(f"outlier group {HOSTILE}: 1 samples")
    visit.reads(f"shot {HOSTILE}")
    visit.step("Model")
    visit.choose("Model", "Response, matrix and white balance")
    visit.press("Compute")
    visit.reads("Response, matrix and white balance: fitted to")
    visit.export("../../tmp/outside", Save_profile="outside the folders of this studio")
    assert visit.page.title() == "LutForge studio"
    assert visit.page.locator("script", has_text="broken").count() == 0


@pytest.mark.slow
def test_two_visitors_do_not_mix_and_a_fit_can_be_cancelled(browser: Browser, url: str, visit: Visit) -> None:
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    other = Visit(context, url)
    visit.open("samples.csv", "samples.csv: 810 samples" if not SCREENSHOTS else "samples.csv: 1,080 samples")
    other.open("hostile.csv", "hostile.csv: 162 samples")
    visit.step("Model")
    visit.choose("Model", "Lattice")
    visit.press("Compute")
    visit.press("Cancel")
    visit.reads("Lattice: cancelled")
    visit.press("Compute")
    # While one fits, the other, and the fitting page itself, go on.
    other.step("Samples")
    other.slide("Saturation", 0.5)
    other.reads("of 162 samples are inliers")
    visit.step("Export")
    visit.reads("Lattice: fitted")
    expect(other.page.get_by_text("cancelled")).to_have_count(0)
    assert other.errors == []
    context.close()


def shots_kept(visit: Visit, folder: Path) -> Visit:
    """Keep paths, boxes and Undo of Shots. Returns the visit that went on."""
    samples = read_samples(folder / "samples.csv")
    visit.press("List again")
    visit.write("or its path", "nothing.csv")
    visit.reads("nothing.csv: no such file")
    visit.write("or its path", "samples.csv")  # the enter key opens it
    visit.reads(f"samples.csv: {len(samples):,} samples of 18 shots")
    names = list(dict.fromkeys(samples.shot.tolist()))[:4]
    for number, name in enumerate(names, 1):
        visit.page.get_by_role("checkbox", name=name).click()
        visit.reads(f"{number} shots left out")
    visit.press_named("Undo")
    visit.reads("undone: 4 shots left out")
    visit.press_named("Redo")
    visit.press_named("Undo")
    visit.reads("undone: 4 shots left out")
    visit = visit.left_and_continued()
    for name in names:
        expect(visit.page.get_by_role("checkbox", name=name)).to_be_checked(checked=name == names[3])
    visit.press_named("Redo")
    visit.reads("done again: 4 shots left out")
    return visit


def samples_kept(visit: Visit) -> Visit:
    """Keep views, limits, a selection, marks and a group of Samples. Returns the visit that went on."""
    visit.step("Samples")
    visit.choose("Left plot", "Saturation against brightness")
    visit.choose("Right plot", "sRGB against RAW")
    visit.choose("Channel", "Blue")
    visit.choose("Colour by", "own colour")
    visit.page.get_by_label("Inliers only").click()
    visit.slide("Saturation", 0.5)
    visit.slide("Largest RAW value", 0.9)
    visit.write("Select row, shot or patch", "300-305")
    visit.reads("6 selected")
    visit.press("Outliers")
    visit.reads("6 samples marked as outliers")
    visit.write("Outlier group", "by hand")
    visit.press("Save group")
    visit.reads("outlier group by hand: 6 samples, in effect")
    inliers = visit.page.get_by_text("samples are inliers").inner_text()
    visit = visit.left_and_continued()
    visit.shows(Left_plot="Saturation against brightness", Channel="Blue", Colour_by="own colour")
    visit.is_at("Saturation", "0.5")
    visit.is_at("Largest RAW value", "0.9")
    visit.reads("6 selected, 6 of them outliers")
    assert visit.page.get_by_text("samples are inliers").inner_text() == inliers
    expect(visit.page.get_by_role("checkbox", name="by hand")).to_be_checked()
    expect(visit.page.get_by_label("Inliers only")).to_be_checked()
    expect(visit.page.get_by_label("Select row, shot or patch")).to_have_value("300-305")
    return visit


def model_kept(visit: Visit) -> Visit:
    """Keep options of Model, and two fits, during which the tab is closed. Returns the visit that went on."""
    visit.step("Model")
    visit.fold("Options")
    visit.slide("Nodes per axis", 9)
    visit.choose("Node levels", "evenly spaced")
    visit.choose("Interpolation", "tetrahedral")
    visit.fold("Response and gamut map")
    visit.slide("Number of curves", 12)
    visit.choose("Model", "Response, matrix and white balance")
    visit.press("Compute")
    visit.choose("Model", "Lattice")
    visit.press("Compute")
    expect(visit.page.get_by_role("status").filter(has_text="Lattice")).to_be_visible(timeout=MOST_MS)
    visit = visit.left_and_continued()
    expect(visit.page.get_by_role("tab", name="Model: done")).to_be_visible(timeout=MOST_MS)
    visit.reads("Lattice: fitted to")
    visit.reads("It builds on the response and matrix that you fitted.")
    visit.shows(Model="Lattice", Model_in_use="Lattice")
    visit.press("Lattice")
    visit.choose("Plane of", "Red")
    visit = visit.left_and_continued()
    expect(visit.page.get_by_role("button", name="Lattice", exact=True)).to_have_attribute("aria-pressed", "true")
    visit.shows(Plane_of="Red")
    visit.fold("Options")
    visit.is_at("Nodes per axis", "9")
    visit.shows(Node_levels="evenly spaced", Interpolation="tetrahedral")
    return visit


def look_kept(visit: Visit) -> Visit:
    """Keep what Look shows, before there is a picture and with one. Returns the visit that went on."""
    visit.step("Look")
    for button in ("Clipping", "100 %", "Fit", "Keep as B"):
        visit.press(button)
    visit.look_at("picture.jpg", "standard", "tungsten")
    visit.choose("Wanted: style", "vivid")
    visit.choose("Wanted: white balance", "cloudy")
    visit.slide("Exposure", 0.8)
    visit.press("Side by side")
    visit.reads("From standard/tungsten to vivid/cloudy, +0.8 EV.")
    visit = visit.left_and_continued()
    visit.reads("From standard/tungsten to vivid/cloudy, +0.8 EV.")
    visit.shows(Photograph_in_the_folders="picture.jpg")
    visit.is_at("Exposure", "0.8")
    for button in ("Clipping", "Side by side"):
        expect(visit.page.get_by_role("button", name=button)).to_have_attribute("aria-pressed", "true")
    expect(visit.page.locator(".look")).to_have_attribute("data-opened", re.compile("360 × 240"))
    visit.press_named("Undo")
    visit.reads("From standard/tungsten to vivid/cloudy, +0 EV.")
    visit.press_named("Redo")
    return visit


def export_kept(visit: Visit, folder: Path) -> Visit:
    """Keep names, kinds and files of Export, one of which is under way as the tab is closed.

    Returns the visit that went on.
    """
    visit.export("kept")
    visit.choose("Transform of the LUT", "linearize")
    visit.choose("Scene of render and linearize", "acescg")
    visit.choose("LUT file", ".cube")
    visit.choose("Program of the kit", "lightroom")
    for button, news in (("Save profile", "profile"), ("Save workspace", "workspace"), ("Bake LUT", "LUT, linearize")):
        visit.press(button)
        visit.reads(f"{news}: written")
    visit.press("Write kit")
    visit = visit.left_and_continued()
    visit.reads("read README.md first")
    for what in ("profile", "workspace", "LUT, linearize", "kit for lightroom"):
        visit.reads(f"{what}: kept")
    visit.shows(Transform_of_the_LUT="linearize", LUT_file=".cube", Program_of_the_kit="lightroom")
    expect(visit.page.get_by_label("Name of the files")).to_have_value("kept")
    assert (folder / "kept_lightroom_kit" / "README.md").is_file()
    expect(visit.page.get_by_role("tab", name=re.compile(": done$"))).to_have_count(5)
    return visit


@pytest.mark.slow
def test_nothing_is_lost_in_any_step_when_its_tab_is_closed_beside_another_tab(
    browser: Browser, url: str, folder: Path
) -> None:
    """Ten actions in each step, after which the tab is closed and another one goes on, also while work is under way."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    visit, other = Visit(context, url), Visit(context, url)
    other.open("hostile.csv", "hostile.csv: 162 samples")

    visit = shots_kept(visit, folder)
    visit = samples_kept(visit)
    visit = model_kept(visit)
    visit = look_kept(visit)
    visit = export_kept(visit, folder)

    # The other tab has kept what is its own, and heard of none of this.
    other.step("Samples")
    other.reads("of 162 samples are inliers")
    expect(other.page.get_by_role("tab", name="Model: to do")).to_be_visible(timeout=MOST_MS)
    assert [error for error in (*visit.errors, *other.errors) if "_guiEditing" not in error] == []
    context.close()


NAMES_AND_PLACES = """controls => controls.filter(
  e => e.checkVisibility({visibilityProperty: true}) && !e.disabled
).map(e => [
  (e.innerText || "") + [...(e.labels || [])].map(label => label.innerText).join("") + (e.title || "")
    + (e.getAttribute("aria-label") || "") + (e.getAttribute("aria-labelledby") || ""),
  e.closest('[role="group"]')?.querySelector('[tabindex="0"]') ? 0 : e.tabIndex,  // the arrow keys move in a group
  e.outerHTML,
])"""


@pytest.mark.slow
def test_every_control_is_labelled_and_reached_by_the_keyboard(visit: Visit) -> None:
    visit.open("hostile.csv", "hostile.csv: 162 samples")
    tab = visit.page.get_by_role("tab", name=re.compile("^Shots"))
    tab.focus()
    for step in PAGE_NAMES[1:]:
        visit.page.keyboard.press("ArrowRight")
        visit.page.keyboard.press("Enter")
        expect(visit.page.locator("b", has_text=f"{step}.")).to_be_visible(timeout=MOST_MS)
        for role in ("textbox", "combobox", "slider", "checkbox", "button"):
            controls = visit.page.get_by_role(role).evaluate_all(NAMES_AND_PLACES)
            assert [html for name, place, html in controls if not name.strip() or place < 0] == [], (step, role)


@pytest.fixture(scope="module")
def axe() -> str:
    """The source of axe-core, of the npm registry; kept in the user's cache."""
    home = user_cache_path("lutforge") / "axe"
    script = home / "node_modules" / "axe-core" / "axe.min.js"
    if not script.is_file():
        if shutil.which("npm") is None:
            pytest.skip("axe-core needs npm")
        install = ["npm", "install", "--prefix", str(home), "--no-audit", "--no-fund", "axe-core@4"]
        done = subprocess.run(install, capture_output=True, text=True, timeout=120)
        if done.returncode:
            pytest.skip("axe-core cannot be fetched here")
    return script.read_text(encoding="utf-8")


def assert_everywhere_in_the_window(visit: Visit, name: str, figures: str = ".bk-Figure") -> None:
    """In each size nothing leaves the window, and axe-core finds no serious fault."""
    page = visit.page
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        visit.rests()
        inside = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
        assert inside[0] <= width and inside[1] <= height, (name, inside)
        controls, main = (page.locator(part).bounding_box() for part in (".sidebar", "main"))
        assert controls is not None and main is not None
        assert controls["x"] + controls["width"] <= main["x"] + 1, (name, controls, main)
        for place in page.locator(f"{figures}:visible").all():
            box = place.bounding_box()
            assert box is not None and box["width"] >= 150 and box["height"] >= 130, (name, box)
            assert box["x"] + box["width"] <= width + 1 and box["y"] + box["height"] <= height + 1, (name, box)
        visit.picture(f"{name}_{width}")
    faults = [
        (fault["id"], node["html"][:160])
        for fault in page.evaluate("axe.run()")["violations"]
        for node in fault["nodes"]
        # A hint that fades in or out fails in contrast.
        if fault["impact"] in ("serious", "critical") and "MuiTooltip" not in node["html"]
    ]
    assert faults == [], name
    page.set_viewport_size({"width": 1280, "height": 720})


@pytest.mark.slow
def test_every_step_fills_the_window_and_axe_finds_no_serious_fault(visit: Visit, axe: str) -> None:
    visit.open("samples.csv", "samples.csv: ")
    visit.page.evaluate(axe)
    for step in PAGE_NAMES:
        visit.step(step)
        assert_everywhere_in_the_window(visit, step.lower())


@pytest.mark.slow
def test_gamut_map_in_3d(visit: Visit, axe: str) -> None:
    visit.page.evaluate(axe)
    visit.open("samples.csv", "samples.csv: ")
    visit.fit(9, "Lattice")
    visit.press("Gamut map")
    visit.reads("standard, Y = 0.25: where the gamut map takes this slice")
    visit.choose("Style", "vivid")
    visit.slide("Luminance Y of the slice", 0.5)
    visit.reads("vivid, Y = 0.50: where the gamut map takes this slice")
    assert_everywhere_in_the_window(visit, "gamut_surface", ".js-plotly-plot")


_DROP = """([name, bytes]) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([new Uint8Array(bytes)], name, { type: "image/jpeg" }));
  const options = { dataTransfer, bubbles: true, cancelable: true, composed: true };
  document.body.dispatchEvent(new DragEvent("drop", options));
}"""


@pytest.mark.slow
def test_look_by_drops_double_clicks_and_keys(visit: Visit, folder: Path, url: str) -> None:
    """And the session goes on after its tab was closed, with its photograph and its look."""
    calibrate(chart_samples(patches=45), CalibrationOptions(size=9)).save(folder / "camera.npz")
    page, picture = visit.page, [*(folder / "picture.jpg").read_bytes()]
    visit.open("camera.npz", "profile of Simulated")
    visit.step("Model")
    page.evaluate(_DROP, ["dropped.jpg", picture])
    visit.reads("this step takes no files")
    visit.step("Look")
    page.evaluate(_DROP, ["dropped.jpg", picture])
    visit.reads("dropped.jpg does not tell how it was taken")
    visit.press("Begin with the usual ones")
    visit.reads("From standard/daylight to standard/daylight, +0 EV.")

    # A slider back by a double click, and the steps of that by keys
    visit.slide("Exposure", 1.5)
    visit.reads("to standard/daylight, +1.5 EV.")
    page.get_by_role("slider", name=re.compile("^Exposure")).dblclick(force=True)
    visit.reads("to standard/daylight, +0 EV.")
    page.locator("canvas.picture").focus()
    for keys, stops in (("Control+z", "+1.5"), ("Control+z", "+0"), ("Control+Shift+z", "+1.5")):
        page.keyboard.press(keys)
        visit.reads(f"to standard/daylight, {stops} EV.")

    # A value that is typed, over the one shown or on the slider, and a photograph of the film strip
    visit.type_value("Exposure, EV", "0.73")
    visit.reads("to standard/daylight, +0.73 EV.")
    page.get_by_role("slider", name=re.compile("^Exposure")).focus()
    page.keyboard.type("1.5")
    page.keyboard.press("Enter")
    visit.reads("to standard/daylight, +1.5 EV.")
    frame = page.get_by_role("button", name="picture.jpg", exact=True)
    expect(frame.locator("img")).to_have_js_property("naturalWidth", 200)
    frame.click()
    visit.reads("picture.jpg does not tell how it was taken")
    expect(frame).to_have_attribute("aria-current", "true")
    visit.press("Side by side")

    # A path in its line is opened by the enter key
    shutil.copy(folder / "picture.jpg", folder / "other.jpg")
    visit.write("or its path", "other.jpg")
    visit.reads("other.jpg does not tell how it was taken")
    visit.press("Begin with the usual ones")
    visit.reads("From standard/daylight to standard/daylight, +1.5 EV.")
    context = page.context
    page.close()
    again = context.new_page()
    again.goto(url)
    link = again.get_by_role("link", name="Continue where you were")
    link.click()
    expect(again.get_by_text("to standard/daylight, +1.5 EV.")).to_be_visible(timeout=MOST_MS)
    expect(again.locator(".look")).to_have_attribute("data-opened", re.compile("360 × 240"))
    expect(again.get_by_role("button", name="Side by side")).to_have_attribute("aria-pressed", "true")
    expect(again.locator(".look")).to_have_attribute("data-scoped", re.compile(r"\d"))


@pytest.mark.slow
def test_something_is_painted_before_the_scripts_have_run(browser: Browser, url: str) -> None:
    context = browser.new_context()
    visit = Visit(context, url)
    painted = visit.page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    ran = visit.page.evaluate("performance.getEntriesByType('navigation')[0].domContentLoadedEventEnd")
    context.close()
    assert painted < ran


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="the memory of a process is read from /proc")
def test_pages_that_nobody_connects_to_are_not_kept(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "lutforge", "studio", "--no-browser", "--port", "0", "--folder", str(tmp_path)]
    log = tmp_path / "server.log"
    with log.open("w") as written:
        server = subprocess.Popen(command, stdout=written, stderr=written, cwd=tmp_path, start_new_session=True)
    try:
        deadline = time.monotonic() + 120
        while (found := re.search(r"http://\S+", log.read_text())) is None:
            assert server.poll() is None and time.monotonic() < deadline, log.read_text()
            time.sleep(0.1)

        def megabytes_after(loads: int) -> float:
            for _ in range(loads):
                with urlopen(found[0], timeout=60) as page:
                    page.read()
            status = Path(f"/proc/{server.pid}/status").read_text()
            return int(re.findall(r"VmRSS:\s+(\d+)", status)[0]) / 1024

        assert -megabytes_after(10) + megabytes_after(200) < 20
    finally:
        os.killpg(server.pid, signal.SIGTERM)
        server.wait(30)


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
