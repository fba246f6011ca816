"""The containers of RAW files that exifread does not know: RAF, MRW and CR3, which hold TIFF structures, and CIFF.

CIFF is the heap that Canon's .CRW files are (Canon, "CIFF Specification on Image Data File", version 1.0 revision 4,
1997); the Canon records inside are those of its later maker notes.
"""

import struct
from collections.abc import Iterator
from mmap import mmap

from lutforge.errors import ImageError

SIGNATURE = b"HEAPCCDR"
Buffer = bytes | mmap
"""A whole file: both slice to bytes."""


def is_ciff(data: Buffer) -> bool:
    """Whether a file that starts with these bytes (14 or more) is CIFF."""
    return data[:2] in (b"II", b"MM") and data[6:14] == SIGNATURE


def read_ciff(data: Buffer) -> tuple[str, dict[int, bytes]]:
    """Byte order ("<" or ">") and the small records of a CIFF file by tag (the first of each tag counts).

    Damaged directories are left out: nothing is raised, and nothing outside the file is touched.
    """
    order = "<" if data[:2] == b"II" else ">"
    records: dict[int, bytes] = {}
    if is_ciff(data):
        (start,) = struct.unpack_from(order + "I", data, 2)
        _read_heap(data, order, start, len(data), records, depth=8, budget=[2000])
    return order, records


def _read_heap(
    data: Buffer, order: str, start: int, end: int, records: dict[int, bytes], depth: int, budget: list[int]
) -> None:
    """One heap data[start:end]; its last four bytes point at its directory."""
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
        if tag & 0x4000:  # the value stands in the directory
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
        yield bytes(data[start : start + min(length, 1 << 27)]), "Image"
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


class Handle:
    """A file of bytes in memory for exifread, which reads number by number: few enough and short ones only."""

    def __init__(self, data: Buffer) -> None:
        self.data, self.at, self.reads = data, 0, 0

    def seek(self, to: int, whence: int = 0) -> None:
        """Move to a place."""
        self.at = to + (self.at if whence == 1 else 0)

    def tell(self) -> int:
        """Return the present position, in bytes from the start."""
        return self.at

    def read(self, size: int = 0) -> bytes:
        """Return the next bytes, a megabyte at most."""
        self.reads += 1
        if self.at < 0 or self.reads > 100_000:  # a camera's file takes some thousands
            raise ImageError("metadata that never end")
        part = bytes(self.data[self.at : self.at + min(size, 1 << 20)])
        self.at += len(part)
        return part
