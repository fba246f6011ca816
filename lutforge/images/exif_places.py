"""The places of some values in an EXIF block, which can then be changed without moving anything else."""

import struct

from lutforge.images.tiff import byte_order, number, offset_in, read_directory


def exif_places(block: bytes) -> dict[str, slice]:
    """Find the places of some values in an EXIF block, a TIFF structure; empty where the block is damaged.

    "next directory" is the offset of the second directory, which holds the thumbnail; "colour space" two bytes;
    "interoperability" three, "R98" for sRGB and "R03" for Adobe RGB (DCF 2.0).
    """
    order = byte_order(block)
    if order is None or block[2:4] != struct.pack(f"{order}H", 42):
        return {}
    try:  # by the tags of Exif 2.32: 4.5.4, 4.6.3, 4.6.5 and 4.6.7
        start = number(block, order, "I", 4)
        first, _ = read_directory(block, order, start)
        exif = offset_in(block, order, first, 0x8769)
        photo, _ = ({}, 0) if exif is None else read_directory(block, order, exif)
        interoperability = offset_in(block, order, photo, 0xA005)
        colours, _ = ({}, 0) if interoperability is None else read_directory(block, order, interoperability)
        link = start + 2 + 12 * number(block, order, "H", start)
    except struct.error:  # an offset beyond the end
        return {}
    places = {"next directory": slice(link, link + 4)} if link + 4 <= len(block) else {}
    for name, entries, tag, size in (("colour space", photo, 0xA001, 2), ("interoperability", colours, 1, 3)):
        if tag in entries:
            places[name] = slice(entries[tag].place.start, entries[tag].place.start + size)
    return places
