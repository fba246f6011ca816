"""CIFF, the heap that Canon's .CRW files are: the records that say how a shot was taken.

Source: Canon, "CIFF Specification on Image Data File", version 1.0 revision 4 (1997); the Canon records
inside are those of its later maker notes.
"""

import struct
from mmap import mmap

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
