"""Files that are a row of named chunks: PNG, WebP (RIFF) and JPEG 2000 (boxes)."""

import struct
from collections.abc import Callable, Iterator
from mmap import mmap

from lutforge.images.tiff import number

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
JP2_SIGNATURE = b"\0\0\0\x0cjP  \r\n\x87\n"

Chunk = tuple[bytes, slice, int]
"""The name of a chunk, the place of its body, and the offset of the next chunk."""


def chunks_of(
    data: bytes | mmap, at: int, chunk_at: Callable[[bytes | mmap, int], Chunk]
) -> Iterator[tuple[bytes, slice]]:
    """The chunks from an offset on, as names and places of their bodies; a damaged one ends them.

    chunk_at: reads the chunk at an offset: `png_chunk`, `riff_chunk` or `box_at`.
    """
    while at + 8 <= len(data):
        name, body, following = chunk_at(data, at)
        if not at + 8 <= body.start <= body.stop <= min(following, len(data)):
            return
        yield name, body
        at = following


def png_chunk(data: bytes | mmap, at: int) -> Chunk:
    """The chunk of a PNG at an offset."""
    length, name = struct.unpack_from(">I4s", data, at)
    return name, slice(at + 8, at + 8 + length), at + 12 + length  # a checksum follows


def riff_chunk(data: bytes | mmap, at: int) -> Chunk:
    """The chunk of a RIFF file at an offset."""
    name, length = struct.unpack_from("<4sI", data, at)
    return name, slice(at + 8, at + 8 + length), at + 8 + length + length % 2  # chunks begin at even offsets


def box_at(data: bytes | mmap, at: int) -> Chunk:
    """The box of a JPEG 2000 file at an offset; a size of 0 means to the end of the file, 1 a size of 64 bits."""
    size, name = struct.unpack_from(">I4s", data, at)
    head = 8
    if size == 1 and at + 16 <= len(data):
        size = number(data, ">", "Q", at + 8)
        head = 16
    end = at + size if size else len(data)
    return name, slice(at + head, end), end


def box(name: bytes, body: bytes) -> bytes:
    """The bytes of a box of JPEG 2000."""
    return struct.pack(">I", len(body) + 8) + name + body
