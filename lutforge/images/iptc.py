"""IPTC in a JPEG: a packet among the image resources of Photoshop.

A resource is a signature, a number, a name and its data, both of even length
(https://www.adobe.com/devnet-apps/photoshop/fileformatashtml/, Image Resources Section).
"""

import struct

from lutforge.images.jpeg import Segment
from lutforge.images.tiff import number

PHOTOSHOP = (0xED, b"Photoshop 3.0\0")
"""Marker and beginning of the JPEG segments that hold Photoshop's image resources, IPTC among them."""
_SIGNATURE = b"8BIM"
_IPTC_RESOURCE = 0x0404


def iptc_of(resources: bytes) -> bytes:
    """The IPTC packet among Photoshop's image resources; empty where there is none."""
    at = 0
    while resources[at : at + 4] == _SIGNATURE:
        kind = number(resources, ">", "H", at + 4)
        start = at + 6 + (resources[at + 6] + 2) // 2 * 2
        size = number(resources, ">", "I", start)
        if kind == _IPTC_RESOURCE:
            return resources[start + 4 : start + 4 + size]
        at = start + 4 + size + size % 2
    return b""


def photoshop_segment(iptc: bytes) -> Segment:
    """The segment of a JPEG that holds an IPTC packet."""
    resource = struct.pack(">4sHHI", _SIGNATURE, _IPTC_RESOURCE, 0, len(iptc)) + iptc + bytes(len(iptc) % 2)
    return Segment(PHOTOSHOP[0], PHOTOSHOP[1] + resource)
