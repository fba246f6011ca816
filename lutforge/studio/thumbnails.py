"""Thumbnails of the photographs in the studio's folders: made when a page shows them, outside of its session."""

from pathlib import Path
from urllib.parse import urlencode

from tornado.ioloop import IOLoop
from tornado.web import RequestHandler

from lutforge.errors import LutForgeError
from lutforge.pipeline.file_kinds import PHOTOGRAPH_SUFFIXES
from lutforge.pipeline.photographs import thumbnail
from lutforge.studio.folders import Folders

ROUTE = "/thumbnail"


def addresses(folders: Folders, names: list[str]) -> list[dict[str, str]]:
    """Name and address of the thumbnail of each shot, whose files bear one name: of its JPEG, else of its RAW file."""
    by_kind = sorted(names, key=lambda name: PHOTOGRAPH_SUFFIXES.index(Path(name).suffix.lower()), reverse=True)
    shots = {Path(name).with_suffix(""): name for name in by_kind}
    shots = dict(sorted(shots.items()))
    return [{"name": name, "url": f"{ROUTE[1:]}?{urlencode(_version(folders, name))}"} for name in shots.values()]


def _version(folders: Folders, name: str) -> dict[str, object]:
    """What an address names: the file, and when it was written, so that a browser keeps no old picture of it."""
    return {"of": name, "at": folders.inside(name).stat().st_mtime_ns}


class ThumbnailHandler(RequestHandler):
    """Answers with the thumbnail of a file in the folders."""

    def initialize(self, folders: Folders) -> None:
        """Take the folders that the studio was started with."""
        self.folders = folders

    async def get(self) -> None:
        """Make the thumbnail beside the server's own work."""
        try:
            path = self.folders.inside(self.get_query_argument("of"))
            picture = await IOLoop.current().run_in_executor(None, thumbnail, path)
        except LutForgeError:
            self.send_error(404)
            return
        self.set_header("Content-Type", "image/jpeg")
        self.set_header("Cache-Control", "private, max-age=86400")
        self.finish(picture)
