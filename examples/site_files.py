"""A hook of MkDocs: what the guide shows from the folders around it becomes part of the site."""

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

HERE = Path(__file__).parent


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add the pictures, tables and scripts beside the guide."""
    for pattern in ("pictures/*.jpg", "pictures/*.png", "*.md", "0*.py"):
        for path in sorted(HERE.glob(pattern)):
            files.append(File.generated(config, path.relative_to(HERE).as_posix(), abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Lead links out of the guide to the copies in the site; of what is not in it, keep the words."""

    def placed(link: re.Match[str]) -> str:
        words, target = link.groups()
        return words if target.startswith("../") else f"[{words}]({target})"

    return re.sub(r"\[([^\]]*)\]\(\.\./([^)]*)\)", placed, markdown)
