"""The report: what it says is what the tables say, it needs nothing else, and names cannot break it."""

import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import style_data
from lutforge.evaluation.evaluation import Evaluation, EvaluationRow
from lutforge.evaluation.figures import ErrorFigures, error_figures
from lutforge.evaluation.methods import LATTICE
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.evaluation import evaluate
from lutforge.reports.page import Picture, Report, write_page
from lutforge.reports.report import build_report, error_tables, exposure_blocks
from lutforge.reports.shot_figures import rendered_cells, shown_shots
from lutforge.reports.tables import Table, balance_table, method_name
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from lutforge.simulate.camera import nikon_d5100
from tests.cases.profiles import small_profile
from tests.cases.same_bytes import same_bytes
from tests.cases.samples import chart_140, photograph_patches

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
HOSTILE = '<script>alert("$x$")</script>'


def shots(names: tuple[str, ...] = ("a", "b", "c"), count: int = 600) -> SampleSet:
    """Colours of the simulated camera, in shots of these names."""
    camera, rng = nikon_d5100(), np.random.default_rng(4)
    gain = np.array(camera.white_balances["daylight"].multipliers)
    raw = rng.uniform(0.02, 0.8, (count, 3)) / gain
    srgb = np.array(camera.render(raw, "standard", "daylight"))
    return SampleSet.from_arrays(
        raw, srgb, camera="Simulated <b>", white_balance="daylight", shot=np.resize(names, count),
        patch=np.arange(count).astype(np.str_), exposure_s=0.01, wb=gain,
    )  # fmt: skip


class Tags(HTMLParser):
    """All start tags with their attributes; whether elements nest soundly."""

    void = ("meta", "link", "img", "br")

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in self.void:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


HOW_GOOD, WHAT_FOR = "How good is it?", "What for?"


def answered(report: Report, question: str) -> str:
    """All that the first page says to one of its questions."""
    words: list[str] = []
    for block in report.answers[question]:
        match block:
            case str():
                words.append(block)
            case tuple():
                words += block
            case Table():
                words += [cell for row in block.rows for cell in row]
    return " ".join(words)


@pytest.fixture(scope="module")
def hostile() -> tuple[CameraProfile, SampleSet]:
    samples = shots(("a", "b", HOSTILE))
    return calibrate(samples, CalibrationOptions(size=9)), samples


@pytest.fixture(scope="module")
def report(hostile: tuple[CameraProfile, SampleSet]) -> Report:
    return build_report(*hostile)


@pytest.fixture(scope="module")
def written(report: Report, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of the report."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_page(report, path)
    return path


@pytest.mark.slow
def test_tables_are_those_of_evaluate(hostile: tuple[CameraProfile, SampleSet], report: Report) -> None:
    profile, samples = hostile
    evaluated = evaluate(profile, samples).rows
    tables = [block for blocks in report.sections.values() for block in blocks if isinstance(block, Table)]
    rows = [row for row in evaluated if row.direction == "render" and row.shot == "all"]
    shown = next(table for table in tables if table.caption.startswith("RAW → JPEG, all shots, held out"))
    assert [row[2] for row in shown.rows] == [method_name(row.method) for row in rows]
    mean = shown.header.index("mean")
    assert [row[mean] for row in shown.rows] == [f"{row.figures.mean:.4f}" for row in rows]
    own = next(row for row in rows if row.method == "camera model")
    for answer in (HOW_GOOD, WHAT_FOR):
        assert f"ΔE00 {own.figures.de00_mean:.2f}" in answered(report, answer)
    backward = (row for row in evaluated if row.direction == "linearize")
    back = next(row for row in backward if row.method == "camera model")
    assert f"{back.figures.mean:.4f}" in answered(report, HOW_GOOD)


def test_page_stands_alone_and_names_are_only_text(written: Path) -> None:
    html = written.read_text(encoding="utf-8")
    assert "yes, on colours like those of the shots" in html
    tags = Tags()
    tags.feed(html)
    assert tags.open == []
    assert not [tag for tag, _ in tags.seen if tag in ("script", "link", "iframe", "object", "b")]
    links = [value for _, attrs in tags.seen for key, value in attrs.items() if key in ("src", "href", "xlink:href")]
    assert links and all(value and (value.startswith(("#", "data:image/png;base64,"))) for value in links)
    assert not [key for _, attrs in tags.seen for key in attrs if key.startswith("on")]
    ids = [attrs["id"] for _, attrs in tags.seen if "id" in attrs]
    assert len(ids) == len(set(ids))
    assert set(re.findall(r"url\(#([^)]+)\)", html)) <= set(ids)
    assert HOSTILE not in html


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
def test_it_prints_on_a4_with_the_answers_on_page_one(written: Path) -> None:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        context = browser.new_context(offline=True, viewport={"width": 688, "height": 1002})  # A4 within the margins
        page, asked = context.new_page(), []
        page.on("request", lambda request: asked.append(request.url))
        page.goto(written.as_uri())
        page.emulate_media(media="print")
        headings = page.locator(".answer h2").all_inner_texts()
        end = page.locator(".answer").last.evaluate("e => e.getBoundingClientRect().bottom")
        width = page.evaluate("document.documentElement.scrollWidth")
        pages = page.pdf(format="A4", prefer_css_page_size=True).count(b"/Type /Page\n")
        browser.close()
    assert headings == ["How good is it?", "On which colours?", "What to shoot next?", "What for?"]
    assert end < 1002 and width <= 688
    assert pages >= 3
    assert len(asked) == 1  # the file itself


WORDS_ACROSS_LINES = """() => [...document.querySelectorAll("td, th, p, li")].filter(cell => {
  const walk = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT), range = document.createRange();
  for (let text; (text = walk.nextNode());)
    for (const word of text.data.matchAll(/[A-Za-z]{2,}/g)) {
      range.setStart(text, word.index);
      range.setEnd(text, word.index + word[0].length);
      if (new Set([...range.getClientRects()].map(box => Math.round(box.top))).size > 1) return true;
    }
  return false;
}).map(cell => cell.textContent)"""
"""The cells and paragraphs of a page in which a word is broken."""


def test_a_shot_may_have_any_name() -> None:
    """One named "all day", or "all", is a shot, and not all of them."""
    colours = np.random.default_rng(0).random((9, 3))
    figures = error_figures(colours, colours, display=True)
    names = (("all", True), ("all day", False), ("all", False))
    rows = tuple(
        EvaluationRow("render", "standard", shot, all_shots, LATTICE, True, figures) for shot, all_shots in names
    )
    whole, by_shot = error_tables(LATTICE, Evaluation("A camera", tuple(rows), ()))
    assert len(whole.rows) == 1
    assert len(by_shot.rows) == 2


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
def test_no_word_is_broken_and_tables_are_folded(written: Path) -> None:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(written.as_uri())
        first_screen = page.locator("body").inner_text()
        page.evaluate("document.querySelectorAll('details').forEach(fold => { fold.open = true; })")
        for width in (1280, 1024):
            page.set_viewport_size({"width": width, "height": 800})
            assert page.evaluate(WORDS_ACROSS_LINES) == []
            assert page.evaluate("document.documentElement.scrollWidth") <= width
        whole = page.locator("body").inner_text()
        browser.close()
    for word in ("rbf", "f and T"):
        assert word not in whole
    assert "Q1" in whole and "Q1" not in first_screen


def test_colours_are_ranked_by_their_errors(report: Report) -> None:
    text = answered(report, "On which colours?")
    assert re.fullmatch(r"standard: most exact on \w+ \(ΔE00 [\d.]+ in the mean\), least on \w+ \([\d.]+\)\.", text)
    best, worst = map(float, re.findall(r"\d+\.\d+", text))
    assert best < worst


@pytest.mark.slow
def test_same_input_gives_the_same_bytes(tmp_path: Path) -> None:
    profile = calibrate(shots(), CalibrationOptions(size=9))
    for name in ("one.html", "two.html"):
        report = build_report(profile)
        write_page(report, tmp_path / name)
    assert same_bytes(tmp_path / "one.html", tmp_path / "two.html")


def test_error_maps_of_real_files(demo: tuple[Path, str]) -> None:
    folder, _ = demo
    profile, samples = load_profile(folder / "camera.npz"), read_samples(folder / "samples.csv")
    samples = samples.select(samples.style == "standard")
    name = str(samples.shot[0])
    report = build_report(profile, samples, files={name: next((folder / "shots").rglob(f"{name}.*dng"))})
    (seen,) = (block for block in report.answers["See for yourself"] if isinstance(block, Picture))
    camera, predicted = (axis.images[0].get_array() for axis in seen.figure.axes)
    assert np.abs(np.asarray(camera) - np.asarray(predicted)).mean() < 0.02
    maps = [block for block in report.pictures if isinstance(block, Picture) and block.name.startswith("error_map_")]
    assert len(maps) == 1
    assert "not seen by the fits" in maps[0].caption
    titles = [axis.get_title() for axis in maps[0].figure.axes]
    for direction in ("RAW → JPEG", "JPEG → RAW"):
        means = [float(title.rsplit(" ", 1)[1]) for title in titles if title.startswith(direction)]
        assert len(means) == 3 and means[0] < means[2], titles  # LutForge below the polynomial
        methods = [title.split("\n")[1].split(":")[0] for title in titles if title.startswith(direction)]
        assert methods == ["camera model", "uniform lattice 17", "polynomial"]


def test_one_shot_is_not_praised() -> None:
    """An error on the shot that was fitted says nothing about others, and the report says no more."""
    samples = shots(("only",))
    report = build_report(calibrate(samples, CalibrationOptions(size=9)), samples)
    for question in (HOW_GOOD, WHAT_FOR):
        assert "not known" in answered(report, question) and "eye" not in answered(report, question)


@pytest.mark.parametrize("names", [("d",), ("a", "d")])
def test_a_shot_that_the_profile_has_not_seen_is_reported(
    names: tuple[str, ...], hostile: tuple[CameraProfile, SampleSet]
) -> None:
    report = build_report(hostile[0], shots(names))
    assert answered(report, HOW_GOOD).startswith("standard: on ")


def test_samples_of_another_camera_are_said_first(hostile: tuple[CameraProfile, SampleSet], report: Report) -> None:
    profile, samples = hostile
    other = replace(samples, camera=np.full(len(samples), "Another"), raw_camera=np.full(len(samples), "Another"))
    assert "The samples are of Another" in answered(build_report(profile, other), HOW_GOOD)
    assert "Another" not in answered(report, HOW_GOOD)


def test_the_pictures_are_ordered_by_the_figure_below_them() -> None:
    """In a shot that is largely dark, a small error of RGB is a large ΔE00."""
    figures = {"light": (0.010, 0.3), "middle": (0.006, 0.5), "dark": (0.004, 0.9)}
    rows = [
        EvaluationRow(
            "render",
            "standard",
            shot,
            False,
            LATTICE,
            True,
            ErrorFigures(9, mean, mean, mean, mean, mean, mean, de00, de00),
        )
        for shot, (mean, de00) in figures.items()
    ]
    files = dict.fromkeys(figures, Path("a.CRW"))
    shown = shown_shots(LATTICE, Evaluation("A camera", tuple(rows), ()), files)
    assert [row.shot for row in shown] == ["light", "middle", "dark"]


def test_burnt_out_light_is_white_in_a_shots_prediction() -> None:
    """Its RAW is at the sensor's end in all channels, and the white balance makes it 1.9, 1, 1.4."""
    cells = np.array([[[1.9, 1.0, 1.4], [0.2, 0.3, 0.4], [np.nan, 0.3, 0.4]]])
    rendered = rendered_cells(lambda balanced: balanced / balanced.max(axis=1, keepdims=True), cells)
    np.testing.assert_allclose(rendered, [[[1.0, 1.0, 1.0], [0.5, 0.75, 1.0], [0.5, 0.5, 0.5]]])


def test_a_spread_is_told_of_white_balances_that_shots_were_taken_with() -> None:
    assert [row[-1] for row in balance_table(small_profile()).rows] == ["–", "–", "10.0 %"]


def test_exposures_say_whether_the_response_is_fixed() -> None:
    light, stops = ("daylight",), (-2, -1, 0)
    samples = photograph_patches(nikon_d5100(), chart_140(), balances=light, stops=stops, exposure_error=0.0)
    late = samples.shot == "standard daylight +0"
    samples = replace(samples, exposure_s=np.where(late, samples.exposure_s / 1.05, samples.exposure_s))
    data, _ = style_data(samples, samples.wb)
    text, table, shutters, picture = exposure_blocks(data, np.eye(3))
    assert isinstance(text, str) and "standard: the response is a fixed property of this camera" in text
    assert isinstance(table, Table)
    removed, everything = (np.array(row[1:], dtype=float) for row in table.rows)
    assert "(1 = full scale)" in table.caption  # as the evaluation states the same error of whole models
    assert (removed < 0.05).all() and not np.array_equal(removed, everything)
    assert isinstance(shutters, Table)
    assert {row[0]: float(row[-1]) for row in shutters.rows} == pytest.approx(
        {name: 1.05 if name == "standard daylight +0" else 1.0 for name in np.unique(samples.shot)}, abs=0.003
    )
    assert isinstance(picture, Picture) and picture.name == "brightness_transfer_standard"
    single = data["standard"].select(data["standard"].shot == data["standard"].shot[0])
    assert list(exposure_blocks({"standard": single}, np.eye(3))) == []


def test_an_error_of_the_response_is_the_same_figure_everywhere_on_the_page() -> None:
    chart = photograph_patches(nikon_d5100(), chart_140(), balances=("daylight",), stops=(-2, -1, 0))
    chart = replace(chart, raw=0.4 * chart.raw)  # a camera that renders white well below saturation
    report = build_report(calibrate(chart, CalibrationOptions(size=9)), chart)
    tables = [block for blocks in report.sections.values() for block in blocks if isinstance(block, Table)]
    (response,) = (table for table in tables if "linearization error of the response" in table.caption)
    (whole,) = (table for table in tables if table.caption.startswith("Two exposures of one scene"))
    of_methods = {row[1]: row[-3:] for row in whole.rows}
    assert response.rows
    for source, *channels in response.rows:
        assert of_methods[f"f of exposures, {source}"] == tuple(channels)
