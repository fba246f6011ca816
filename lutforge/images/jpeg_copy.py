"""The metadata segments of a JPEG, for a copy with other pixels or in another colour space."""

import struct
from collections.abc import Callable, Sequence

from lutforge.images.exif_places import exif_places
from lutforge.images.jpeg import ADOBE, APP0, APP1, APP2, COMMENT, EXIF, ICC, PREVIEWS, SOI, Segment
from lutforge.images.tiff import byte_order


def stored_metadata(segments: Sequence[Segment], plain: bool, comment: str) -> bytes:
    """SOI and the segments of a source, for a copy with other pixels, and a comment."""

    def without_thumbnail(block: bytes, places: dict[str, slice]) -> bytes:
        return _replaced(block, places["next directory"], bytes(4)) if "next directory" in places else block

    # The copy has no further pictures and no thumbnail, which would show the old colours, so the segments must not
    # point to them. Where colours are coded anew (not plain), the segment on the old coding is left out.
    segments = _with_exif(segments, without_thumbnail)
    copied = [segment for segment in segments if not segment.holds(PREVIEWS) and (plain or not segment.holds(ADOBE))]
    added = Segment(COMMENT, comment.encode()[:65_000].ljust(16))
    return SOI + b"".join(segment.stored for segment in (*copied, added))


def with_colours(segments: Sequence[Segment], profile: bytes | None, adobe_rgb: bool) -> tuple[Segment, ...]:
    """The segments with another ICC profile, or none, and with the colour space in EXIF changed where it states one."""
    changed = [segment for segment in segments if not segment.holds(ICC)]
    pieces = [] if profile is None else [profile[at : at + 65_000] for at in range(0, len(profile), 65_000)]
    icc = [Segment(APP2, ICC[1] + bytes([at, len(pieces)]) + piece) for at, piece in enumerate(pieces, 1)]
    after = max((at + 1 for at, segment in enumerate(changed) if segment.marker in (APP0, APP1)), default=0)
    changed[after:after] = icc

    def colours(block: bytes, places: dict[str, slice]) -> bytes:
        space = struct.pack(f"{byte_order(block)}H", 0xFFFF if adobe_rgb else 1)
        for name, value in (("colour space", space), ("interoperability", b"R03" if adobe_rgb else b"R98")):
            block = _replaced(block, places[name], value) if name in places else block
        return block

    return _with_exif(changed, colours)


def _with_exif(segments: Sequence[Segment], change: Callable[[bytes, dict[str, slice]], bytes]) -> tuple[Segment, ...]:
    """The segments with their EXIF block changed by a function that keeps its length."""
    changed = []
    for segment in segments:
        block = segment.body[len(EXIF[1]) :]
        places = exif_places(block) if segment.holds(EXIF) else {}
        changed.append(Segment(APP1, EXIF[1] + change(block, places)) if places else segment)
    return tuple(changed)


def _replaced(block: bytes, place: slice, new: bytes) -> bytes:
    """A block with new bytes in one place."""
    return block[: place.start] + new + block[place.stop :]
