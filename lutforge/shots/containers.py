"""Files that contain metadata: JPEG, RAF, MRW and CR3, which hold TIFF structures, and CIFF.

CIFF is the heap that Canon's .CRW files are (Canon, "CIFF Specification on Image Data File", version 1.0 revision 4,
1997). Damaged directories are left out, and nothing outside the file is touched.
"""

import mmap
import struct
from collections.abc import Iterator

from lutforge.images.jpeg import SOI, read_header
from lutforge.images.tiff import number

Buffer = bytes | mmap.mmap
"""A whole file: both slice to bytes."""


def ciff_records(data: Buffer) -> dict[int, bytes]:
    """The small records of a CIFF file by tag."""
    order = "<" if data[:2] == b"II" else ">"
    records: dict[int, bytes] = {}
    _read_heap(data, order, number(data, order, "I", 2), len(data), records, depth=8, budget=[2000])
    return records


def _read_heap(
    data: Buffer, order: str, start: int, end: int, records: dict[int, bytes], depth: int, budget: list[int]
) -> None:
    """Add the small records of one heap by tag, the first of each; its last four bytes point at its directory."""
    if depth == 0 or start < 0 or end > len(data) or end - start < 6:
        return
    (directory,) = struct.unpack_from(order + "I", data, end - 4)
    position = start + directory
    if position + 2 > end:
        return
    (count,) = struct.unpack_from(order + "H", data, position)
    for index in range(count):
        entry = position + 2 + 10 * index
        if entry + 10 > end or budget[0] <= 0:
            return
        budget[0] -= 1
        tag, size, offset = struct.unpack_from(order + "HII", data, entry)
        if tag & 0x4000:  # the value is in the directory
            records.setdefault(tag & 0x3FFF, data[entry + 2 : entry + 10])
            continue
        low, high = start + offset, start + offset + size
        if high > end:
            continue
        if tag & 0x3800 in (0x2800, 0x3000):  # a heap in this heap
            _read_heap(data, order, low, high, records, depth - 1, budget)
        elif size <= 65536:  # larger ones are pictures
            records.setdefault(tag & 0x3FFF, data[low:high])


def tiff_blocks(data: Buffer) -> Iterator[tuple[Buffer, str]]:
    """The TIFF structures of a file, with the group of their first directory."""
    head = bytes(data[:32])
    if head[:15] == b"FUJIFILMCCD-RAW":  # a whole JPEG in it
        start, length = struct.unpack_from(">II", data, 84)
        yield from tiff_blocks(bytes(data[start : start + min(length, 1 << 27)]))
    elif head[:2] == SOI:
        header = read_header(data)
        if header is not None and header.exif is not None:
            yield header.exif, "Image"
    elif head[:4] == b"\0MRM":  # Minolta: blocks of name, length, body; TTW is a TIFF structure
        position, end = 8, min(len(data), 8 + struct.unpack_from(">I", data, 4)[0])
        while position + 8 <= end:
            name, length = struct.unpack_from(">4sI", data, position)
            if name == b"\0TTW":
                yield bytes(data[position + 8 : position + 8 + length]), "Image"
            position += 8 + length
    elif head[4:12] == b"ftypcrx ":  # Canon CR3: TIFF structures in boxes of moov/uuid
        groups = {b"CMT1": "Image", b"CMT2": "Photo", b"CMT3": "Canon"}
        yield from ((body, groups[name]) for name, body in _boxes(data, 0, len(data), 3, [1000]))
    else:
        yield data, "Image"


def _boxes(data: Buffer, start: int, end: int, depth: int, budget: list[int]) -> Iterator[tuple[bytes, bytes]]:
    """The bodies of a CR3 file's metadata boxes by name, boxes inside of boxes included (ISO/IEC 14496-12)."""
    while start + 8 <= end and budget[0] > 0:
        budget[0] -= 1
        size, name = struct.unpack_from(">I4s", data, start)
        body = start + 8
        if size == 1 and start + 16 <= end:
            (size,) = struct.unpack_from(">Q", data, start + 8)
            body = start + 16
        if size < body - start or start + size > end:
            break
        if name in (b"moov", b"uuid") and depth > 0:
            yield from _boxes(data, body + (16 if name == b"uuid" else 0), start + size, depth - 1, budget)
        elif name in (b"CMT1", b"CMT2", b"CMT3") and size < 1 << 24:
            yield name, bytes(data[body : start + size])
        start += size
