"""A JPEG to a JPEG: decoded, graded and encoded as 8-bit codes, with the source's quality and all of its metadata."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from threading import local

import numpy as np

from lutforge.apply.blocks import grade_codes, grade_floats
from lutforge.apply.colours import count_doubtful
from lutforge.apply.grade import Grade
from lutforge.arrays import Codes, Index
from lutforge.atomic_write import atomic_path
from lutforge.images.icc import to_srgb
from lutforge.images.jpeg import JpegHeader, decode, encode, read_header, stored_metadata, with_colours, with_thumbnail
from lutforge.images.write import IN_ANOTHER_SPACE, SOFTWARE, format_of

_memory = local()
"""Its attribute `codes` is what each thread uses for one picture after another: new memory costs as much as a tenth of
the codec."""


@dataclass(frozen=True, eq=False)
class JpegSource:
    """A JPEG file in memory, as it is stored."""

    path: Path
    data: bytes
    header: JpegHeader

    @property
    def is_graded_whole(self) -> bool:
        """True where the picture is graded as codes and whole; the others are graded region by region.

        Whole, as codes, pictures of more than 64 Mpixel would take more than 256 MB each.
        """
        return self.header.plain and self.header.width * self.header.height <= 64_000_000

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the file is not in the graded one."""
        if self.header.has_gain_map:
            return ("the gain map (Ultra HDR) is of the old colours, and was left out: the picture is SDR now",)
        if self.header.has_previews:
            return ("the previews behind the picture show the old colours, and were left out",)
        return ()

    def metadata(self, grade: Grade, profile: bytes = b"") -> bytes:
        """What stands in front of the graded pixels: the source's segments, with a comment on what was done.

        The thumbnail is graded in its place; where the colours get another space, ICC profile and ColorSpace change.
        profile: of the space that the picture was converted from, to sRGB, before it was graded.
        """
        segments, attributes, codes = self.header.segments, grade.attributes, grade.codes
        if "ICCProfile" in attributes:
            new = attributes["ICCProfile"]
            adobe_rgb = attributes.get("Exif:ColorSpace") == IN_ANOTHER_SPACE
            segments = with_colours(segments, new if isinstance(new, bytes) else None, adobe_rgb)
        if codes is not None:

            def graded(canvas: Codes) -> None:
                if profile:
                    canvas[..., :3] = to_srgb(np.ascontiguousarray(canvas[..., :3]), profile)
                grade_codes(codes, canvas, None)

            segments = with_thumbnail(segments, graded)
        comment = f"{attributes.get('Software', SOFTWARE)}\n{' '.join(grade.history.split())}"
        return stored_metadata(segments, self.header.plain, comment)


def jpeg_source(source: Path, target: Path, format: str) -> JpegSource | None:
    """The source, where both are JPEG files and it can be copied from. format: its own, by OpenImageIO's name."""
    if format != "jpeg" or format_of(target) != "jpeg":
        return None
    data = source.read_bytes()
    header = read_header(data)
    return None if header is None else JpegSource(source, data, header)


def grade_whole(
    jpeg: JpegSource,
    grade: Grade,
    target: Path,
    quality: int | None,
    threads: Executor | None,
    done: Callable[[int], None],
) -> Index:
    """Grade a picture, and return (3,) how many pixels are doubtful, as `count_doubtful` does.

    done: called with the number of pixels after each piece. Raises ImageError or OSError.
    """
    assert grade.codes is not None
    header = jpeg.header
    start = jpeg.metadata(grade)
    size = header.height * header.width * 4
    if getattr(_memory, "codes", np.empty(0)).size < size:
        _memory.codes = None  # frees the smaller one first
        _memory.codes = np.empty(size, np.uint8)
    canvas: Codes = _memory.codes[:size].reshape(header.height, header.width, 4)
    decode(jpeg.path, jpeg.data, canvas)
    doubtful = np.zeros(3, dtype=np.int64)
    if grade.confidence is not None:  # counted in every eighth row
        rows_in_eight = canvas[::8, :, :3]
        for top in range(0, len(rows_in_eight), 256):
            pixels = np.divide(rows_in_eight[top : top + 256], 255, dtype=np.float32)
            confidence = np.empty_like(pixels)
            grade_floats(grade.confidence, pixels, confidence, premultiplied=False, threads=threads)
            doubtful += count_doubtful(pixels, confidence)
        doubtful = doubtful * len(canvas) // len(rows_in_eight)
    grade_codes(grade.codes, canvas, threads, done)
    with atomic_path(target) as temporary, FileIO(temporary, "r+") as file:
        encode(file, canvas, start, header, quality)
    return doubtful
