"""The measured figures that README and guide state: the file that holds them, and the blocks of pages that state them.

Between the lines `<!-- figures: NAME -->` and `<!-- end of figures -->` of a page stands the block NAME of
figures_of_pages.md, in which `{figure|format}` is a figure and `{machine of PART}` the machine that measured a part.
`make figures` measures them and writes the pages.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lutforge.atomic_write import atomic_path

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "examples" / "guide" / "figures.json"
PAGES = (ROOT / "README.md", *sorted((ROOT / "examples" / "guide").glob("*.md")))

Parts = dict[str, dict[str, Any]]
"""By part: "machine", its name, and "figures", a number by name."""

_BLOCK = re.compile(r"(<!-- figures: ([\w -]+) -->\n\n)(.*?)(\n\n<!-- end of figures -->)", re.DOTALL)
_PLACE = re.compile(r"\{([^{}|]+)\|([^{}|]+)\}")
_MACHINE = re.compile(r"\{machine of (\w+)\}")


def read_figures() -> Parts:
    """The figures that were measured last."""
    parts: Parts = json.loads(KEPT.read_text(encoding="utf-8"))
    return parts


def keep_figures(parts: Parts) -> None:
    """Write the figures."""
    with atomic_path(KEPT) as temporary:
        text = json.dumps(parts, indent=1, ensure_ascii=False, sort_keys=True)
        temporary.write_text(text + "\n", encoding="utf-8")


def read_templates() -> dict[str, str]:
    """The blocks of the pages by name, with places for figures."""
    text = Path(__file__).with_name("figures_of_pages.md").read_text(encoding="utf-8")
    parts = re.split(r"^=== ([\w -]+)\n", text, flags=re.MULTILINE)[1:]
    return {name: block.strip("\n") for name, block in zip(parts[::2], parts[1::2], strict=True)}


def filled(template: str, parts: Mapping[str, Mapping[str, Any]]) -> str:
    """A block with its figures. Raises KeyError at a figure that no part has measured."""
    figures = {name: value for part in parts.values() for name, value in part["figures"].items()}
    machines = _MACHINE.sub(lambda place: str(parts[place[1]]["machine"]), template)
    return _PLACE.sub(lambda place: format(figures[place[1]], place[2]), machines)


def blocks_of(page: str) -> list[str]:
    """The names of the blocks of a page."""
    return [block[2] for block in _BLOCK.finditer(page)]


def with_figures(page: str, templates: Mapping[str, str], parts: Mapping[str, Mapping[str, Any]]) -> str:
    """The text of a page with its blocks filled. Raises KeyError at a block without a template."""
    return _BLOCK.sub(lambda block: block[1] + filled(templates[block[2]], parts) + block[4], page)


def write_pages() -> list[Path]:
    """Write the figures into all pages; returns those that changed."""
    templates, parts = read_templates(), read_figures()
    changed = []
    for page in PAGES:
        before = page.read_text(encoding="utf-8")
        after = with_figures(before, templates, parts)
        if after != before:
            with atomic_path(page) as temporary:
                temporary.write_text(after, encoding="utf-8")
            changed.append(page)
    return changed
