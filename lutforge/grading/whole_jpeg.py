"""A JPEG file graded to a JPEG file: as 8-bit codes, with the quality of the source and all of its metadata."""

from concurrent.futures import Executor
from dataclasses import replace
from io import FileIO
from pathlib import Path

import numpy as np

from lutforge.atomic_write import atomic_path
from lutforge.grading.grade import Grade
from lutforge.grading.pixels import grade_codes
from lutforge.images.jpeg import APP1, APP2, JpegHeader
from lutforge.images.jpeg_copy import stored_metadata, with_colours
from lutforge.images.jpeg_pixels import decode, encode
from lutforge.images.output_spec import IN_ANOTHER_SPACE, SOFTWARE_NAME
from lutforge.images.xmp import XMP_SEGMENT, without_further_pictures


def jpeg_metadata(header: JpegHeader, grade: Grade) -> bytes:
    """The part of a graded JPEG before its pixels: the source's segments, and a comment on what was done.

    The thumbnail shows the old colours and is left out. Where the grade changes the colour space, the ICC profile and
    the tag ColorSpace change.
    """
    segments = header.segments
    attributes = grade.attributes
    if "ICCProfile" in attributes:
        new = attributes["ICCProfile"]
        adobe_rgb = attributes.get("Exif:ColorSpace") == IN_ANOTHER_SPACE
        segments = with_colours(segments, new if isinstance(new, bytes) else None, adobe_rgb)
    comment = f"{attributes.get('Software', SOFTWARE_NAME)}\n{' '.join(grade.history.split())}"

    # A gain map or film after the picture is left out, so XMP must not declare it.
    retained = []
    for segment in segments:
        if segment.holds((APP1, XMP_SEGMENT)):
            body = XMP_SEGMENT + without_further_pictures(segment.body[len(XMP_SEGMENT) :])
            segment = replace(segment, body=body)
        if not segment.holds((APP2, b"urn:iso:std:iso:ts:21496:-1")):
            retained.append(segment)
    return stored_metadata(retained, header.plain, comment)


def grade_whole(
    source: Path,
    header: JpegHeader,
    grade: Grade,
    target: Path,
    threads: Executor | None,
) -> None:
    """Grade a picture that is in memory as a whole, and write it."""
    assert grade.codes is not None
    start = jpeg_metadata(header, grade)
    canvas = np.empty((header.height, header.width, 4), np.uint8)
    decode(source, source.read_bytes(), canvas)
    grade_codes(grade.codes, canvas, threads)
    with atomic_path(target) as temporary, FileIO(temporary, "r+") as file:
        encode(file, canvas, start, header)
