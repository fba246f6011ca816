"""README and guide are true: their commands, options, links and pictures exist, and the README's Python runs."""

import os
import re
import subprocess
import sys
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
from packaging.requirements import Requirement

import lutforge as lf
from lutforge.kits.all_kits import KITS
from lutforge.luts.lut_programs import PROGRAMS
from lutforge.simulate.camera import nikon_d5100
from tests.cases.page_figures import blocks_of, read_figures, read_templates, with_figures
from tests.cases.program_table import table
from tests.cases.samples import samples_of_settings
from tests.conftest import CommandLine

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "examples" / "guide").glob("*.md"))]


def commands(text: str) -> list[str]:
    """The lines of a page that run LutForge, whole where a backslash continues them, and those named in its prose."""
    whole = text.replace("\\\n", " ")
    blocks = re.findall(r"^ {4,}(lutforge [^\n]*)", whole, flags=re.MULTILINE)
    return blocks + re.findall(r"`(lutforge [^`]*)`", whole)


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "dumb")


@pytest.fixture
def known(lutforge: CommandLine, wide: None) -> set[str]:
    """The commands that `lutforge --help` lists."""
    listed = lutforge("--help").stdout.split("Commands", 1)[1]
    return set(re.findall(r"^\W*([a-z][a-z-]+)  ", listed, flags=re.MULTILINE))


def test_every_command_is_documented(known: set[str]) -> None:
    assert len(known) >= 9
    table = (ROOT / "examples" / "guide" / "commands.md").read_text(encoding="utf-8")
    assert known == set(re.findall(r"^\| `lutforge ([a-z-]+)", table, flags=re.MULTILINE))


@pytest.mark.usefixtures("wide")
def test_every_command_and_option_in_the_pages_exists(lutforge: CommandLine, known: set[str]) -> None:
    used: dict[str, set[str]] = {}
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for line in commands(text):
            command = line.split()[1]
            if command.startswith("-") or command == "COMMAND":
                continue
            assert command in known, f"{page.name}: {line}"
            used.setdefault(command, set()).update(re.findall(r"(?<!\S)--[a-z-]+", line))
    for row in re.findall(r"^\| `lutforge [a-z-]+.*", (ROOT / "examples/guide/commands.md").read_text(), re.MULTILINE):
        used[row.split()[2].strip("`")].update(re.findall(r"(?<=`)--[a-z-]+", row))
    for command, options in used.items():
        text = lutforge(command, "--help").stdout
        assert all(re.search(rf"{option}\b", text) for option in options), (command, options)


def test_every_link_and_picture_leads_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")):
            if not target.startswith("http"):
                assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_every_kit_has_a_page_that_is_listed() -> None:
    guide = ROOT / "examples" / "guide"
    pages = {page.name: page.read_text(encoding="utf-8") for page in guide.glob("*.md")}
    for program in KITS:
        page = f"{program}.md" if f"{program}.md" in pages else "other_programs.md"
        assert f"--for {program}" in pages[page]
        assert f"]({page}" in pages["developers.md"]
        assert f" {page}\n" in (ROOT / "mkdocs.yml").read_text(encoding="utf-8")


def test_the_readme_is_short_and_its_figures_are_those_of_the_guide() -> None:
    assert len(README.splitlines()) <= 200
    tables = (ROOT / "examples" / "guide" / "accuracy.md").read_text(encoding="utf-8")
    figures = re.findall(r"^\| [^|]*\| [^|]*\| \*\*(.+?)\*\*", README, flags=re.MULTILINE)
    assert len(figures) >= 6
    for figure in figures:
        assert figure in tables or figure.endswith(" of 10"), figure  # counted in a column of the tables


def test_the_pages_hold_the_figures_that_were_measured_last() -> None:
    """A figure that was changed by hand, a block that was damaged, and one that no page has any more are found."""
    templates, parts = read_templates(), read_figures()
    blocks: set[str] = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert with_figures(text, templates, parts) == text, f"{page.name}: make figures FIGURES='--only none'"
        assert len(blocks_of(text)) == text.count("<!-- figures:") == text.count("<!-- end of figures"), page.name
        blocks |= set(blocks_of(text))
    assert blocks == set(templates)


def test_pages_say_what_files_need_and_cost() -> None:
    """Which OpenColorIO reads a config and an archive, and what a refinish in three cubes costs."""
    guide = ROOT / "examples" / "guide"
    of_configs, of_batches = ((guide / name).read_text(encoding="utf-8") for name in ("ocio.md", "batches.md"))
    assert "every OpenColorIO since August 2021 (2.1)" in of_configs
    assert re.search(r"archives \(`\.ocioz`\) need OpenColorIO 2\.2", of_configs)
    assert re.search(r"refinish `\.clf`[^.]*\. oiiotool takes [\d.]+ to [\d.]+ times as long", of_batches)


def test_the_page_of_files_says_of_programs_what_check_says() -> None:
    text = (ROOT / "examples" / "guide" / "files.md").read_text(encoding="utf-8")
    assert table() in text, "python -m tests.cases.program_table"
    for program in PROGRAMS.values():
        assert not program.does or f"| {program.title} |" in text


def test_every_place_that_names_pythons_names_the_same() -> None:
    """Pip's bounds, classifiers, workflows, what is resolved, and the pages."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    classified = [word.rsplit(" ", 1)[1] for word in project["classifiers"] if re.search(r":: 3\.\d+$", word)]
    assert project["requires-python"] == f">={classified[0]},<3.{int(classified[-1][2:]) + 1}"
    for workflow in ("ci", "release"):
        text = (ROOT / ".github" / "workflows" / f"{workflow}.yml").read_text(encoding="utf-8")
        assert re.findall(r"3\.\d+", re.findall(r"python: \[(.*)\]", text)[0]) == classified, workflow
        assert ".ci/resolve" in text, workflow
    resolved = (ROOT / ".ci" / "resolve").read_text(encoding="utf-8")
    assert re.findall(r"3\.\d+", re.findall(r"^PYTHONS=(.*)$", resolved, re.MULTILINE)[0]) == classified
    for page in (README, (ROOT / "examples" / "guide" / "getting_started.md").read_text(encoding="utf-8")):
        assert f"Python {classified[0]} to {classified[-1]}" in page


def test_each_python_has_one_line_of_dependencies_per_package() -> None:
    """Environment markers of one package exclude each other, and none of them leaves a Python without the package."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    requirements = [Requirement(line) for line in project["dependencies"]]
    for minor in range(11, 15):
        applied = [
            one.name for one in requirements if not one.marker or one.marker.evaluate({"python_version": f"3.{minor}"})
        ]
        assert sorted(applied) == sorted({one.name for one in requirements}), minor


@pytest.mark.slow
@pytest.mark.usefixtures("small_inverses")
def test_its_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = README.split("```python\n", 1)[1].split("```", 1)[0]
    samples_of_settings(nikon_d5100(), 2, balances=("tungsten", "daylight")).save(tmp_path / "samples.csv")
    monkeypatch.chdir(tmp_path)
    names = {"pixels": np.random.default_rng(2).random((4, 5, 3))}
    exec(code, names)
    assert names["image"].shape == (4, 5, 3)
    assert (tmp_path / "fix.clf").stat().st_size > 0
    assert (tmp_path / "camera.npz").stat().st_size > 0


def test_the_python_of_getting_started_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "examples" / "guide" / "getting_started.md").read_text(encoding="utf-8")
    raw = np.random.default_rng(3).uniform(0.02, 0.5, (240, 3))
    names = {"raw": raw, "srgb": np.sqrt(raw), "shot": np.repeat(["a", "b", "c"], 80)}
    monkeypatch.chdir(tmp_path)
    table = lf.SampleSet.from_arrays(raw, np.sqrt(raw), camera="My camera", shot=names["shot"])
    table.save(tmp_path / "samples.csv")
    for code in re.findall("```python\n(.*?)```", page, flags=re.DOTALL):
        exec(code, names)
    assert names["count"] == 2
    assert names["light"].shape == (240, 3)
    assert lf.load_profile("camera.npz").camera == "My camera"


class Links(HTMLParser):
    """What a page leads to (`a`), what it loads (all else), and its anchors."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.leads: list[str] = []
        self.loads: list[str] = []
        self.anchors: set[str] = set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id" and value:
                self.anchors.add(value)
            elif name in ("href", "src") and value:
                (self.leads if tag == "a" else self.loads).append(value)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("material", reason="the site needs MkDocs: pip install 'lutforge[docs]'")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    run = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    return folder


def test_no_link_is_dead(site: Path) -> None:
    pages = {page: Links(page) for page in site.glob("*.html") if page.name != "404.html"}
    assert len(pages) >= len(list((ROOT / "examples" / "guide").glob("*.md")))
    for page, links in pages.items():
        for link in [*links.leads, *links.loads]:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = page if not parts.path else (page.parent / unquote(parts.path)).resolve()
            assert target.exists(), f"{page.name}: {link}"
            if parts.fragment and target in pages:
                assert unquote(parts.fragment) in pages[target].anchors, f"{page.name}: {link}"


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    for page in site.glob("*.html"):
        assert [link for link in Links(page).loads if urlsplit(link).netloc] == [], page.name
    for sheet in site.rglob("*.css"):
        assert "url(http" not in sheet.read_text(encoding="utf-8"), sheet.name
