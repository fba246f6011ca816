"""Every measured figure that README and guide state: measured in one run, kept in a file, and written into the pages.

    python -m tests.benchmarks.figures [--only WORD …] [--within WORD …] [--keep DIR]

Each part is a benchmark in a process of its own; its figures go to figures.json beside the guide, with the name of this
machine. `--only` measures the parts whose names hold a word, and none for a word that no name holds; `--within`
measures what the words choose within a part (`--only speed --within start`). All other figures stay, and those of a
part that were not measured are named. Then the pages are written. All parts take some hours on an idle machine of two
cores.
"""

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.benchmarks.common import ROOT, chosen, kept
from tests.cases.page_figures import keep_figures, read_figures, write_pages

PARTS = ("accuracy", "speed", "lattices", "field", "fleet", "installation")
"""Modules beside this one; each takes `--json FILE`."""

KEEPING, CHOOSING = ("accuracy", "field"), ("accuracy", "speed", "fleet", "installation")
"""Those that take `--keep DIR`, too, and those that take `--only WORD …`."""


def machine() -> str:
    """The processor, the number of cores, and the system of this machine, in words."""
    model = platform.processor() or platform.machine()
    described = Path("/proc/cpuinfo")
    if described.exists():
        named = re.search(r"^model name\s*: (.*)$", described.read_text(encoding="utf-8"), re.MULTILINE)
        model = named[1].strip() if named else model
    return f"{model}, {os.cpu_count()} cores, {platform.system()}"


def measured(part: str, keep: Path, within: list[str]) -> dict[str, float]:
    """The figures of a part; what it prints is shown. Raises RuntimeError where it wrote none."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "figures.json"
        words = [f"tests.benchmarks.{part}", "--json", str(file)]
        words += ["--keep", str(keep)] if part in KEEPING else []
        words += ["--only", *within] if within and part in CHOOSING else []
        subprocess.run([sys.executable, "-m", *words], cwd=ROOT)  # a status of 1 says that a figure misses its limit
        if not file.exists():
            raise RuntimeError(f"{part}: measured nothing")
        figures: dict[str, float] = json.loads(file.read_text(encoding="utf-8"))
        return figures


def main() -> int:
    """Measure the parts, and write the pages; 1 where a part failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[], metavar="WORD", help="the parts whose names hold a word")
    parser.add_argument("--within", nargs="+", default=[], metavar="WORD", help="what is measured within these parts")
    parser.add_argument("--keep", type=Path, help="a folder: what is made there is used again by the next run")
    arguments = parser.parse_args()

    parts, failed = read_figures(), 0
    with kept(arguments.keep) as keep:
        for part in PARTS:
            if not chosen(part, arguments.only):
                continue
            try:
                figures = measured(part, keep, arguments.within)
            except RuntimeError as error:
                print(error, file=sys.stderr)
                failed += 1
                continue
            before = parts.get(part, {"figures": {}})["figures"]
            old = [name for name in before if name not in figures]
            if old:
                print(f"{part}: not measured now: {', '.join(old)}", file=sys.stderr)
            parts[part] = {"machine": machine(), "figures": before | figures}
            keep_figures(parts)

    for page in write_pages():
        print(f"{page.relative_to(ROOT)}: figures written")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
