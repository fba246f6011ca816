"""Lightroom and Camera Raw: a DNG camera profile, or an XMP profile with an RGB table.

An RGB table is a block of numbers (type, version, dimensions, divisions; 16-bit differences from the identity, red
slowest; primaries, gamma, gamut; smallest and largest amount), deflated behind its size, written in an alphabet of 85
signs of which five stand for four bytes, and named by its MD5: `dng_big_table.cpp` of Adobe's DNG SDK 1.7.1
(https://helpx.adobe.com/camera-raw/digital-negative.html).
"""

import hashlib
import struct
import uuid
import zlib
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.kits.dcp import fit_dng_profile, write_dcp
from lutforge.kits.kit import Kit, Look, Source
from lutforge.luts.bake import bake

DIVISIONS = 32
"""Most nodes per axis that the format has."""

_ALPHABET = "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.-:+=^!/*?`'|()[]{}@%$#"


@dataclass(frozen=True)
class LightroomKit(Kit):
    """A profile of RAW files becomes a .dcp, one of pictures that Camera Raw exported an XMP profile."""

    program: str = "lightroom"
    title: str = "Lightroom and Camera Raw"
    source: Source = "any"
    tried: str = "the .dcp in RawTherapee 5.9; the XMP profile by a second decoder; neither in Adobe's programs"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the DNG profile, or the XMP profile."""
        if look.space == "raw":
            write_dcp(fit_dng_profile(look), folder / f"{look.file_name}.dcp")
            return [
                f"Lightroom: profile browser → + → Import Profiles: {look.file_name}.dcp (or copy it into the "
                "CameraRaw folder CameraProfiles), and start the program again.",
                f'Choose the profile "{look.title}" for RAW photographs of this camera. White balance, exposure and '
                "highlights stay as free as with Adobe's own profiles.",
            ]
        lut = bake(look.within("rec2020-srgb"), size=DIVISIONS, form="plain", interpolation="trilinear")
        assert lut.cube is not None  # the plain form is a cube
        text = xmp_profile(look.title, lut.cube.values)
        (folder / f"{look.file_name}.xmp").write_text(text, encoding="utf-8")
        return [
            f"Lightroom: profile browser → + → Import Profiles: {look.file_name}.xmp.",
            "Apply it to photographs whose other settings are those of the exported calibration pictures.",
        ]


def xmp_profile(name: str, cube: Array) -> str:
    """An XMP profile with a cube (32, 32, 32, 3) of Rec. 2020 behind sRGB's curve, both sides. Raises LutError."""
    if cube.shape != (DIVISIONS, DIVISIONS, DIVISIONS, 3):
        raise LutError(f"an RGB table of a profile has {DIVISIONS}³ nodes, not {cube.shape[0]}³")
    table = _rgb_table(cube)
    fingerprint = hashlib.md5(table, usedforsecurity=False).hexdigest().upper()
    identifier = uuid.uuid5(uuid.NAMESPACE_URL, f"lutforge:{name}:{fingerprint}").hex.upper()
    return f"""<x:xmpmeta xmlns:x="adobe:ns:meta/">
 <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <rdf:Description rdf:about="" xmlns:crs="http://ns.adobe.com/camera-raw-settings/1.0/"
   crs:PresetType="Look" crs:Cluster="" crs:UUID="{identifier}" crs:SupportsAmount="True" crs:SupportsColor="True"
   crs:SupportsMonochrome="False" crs:SupportsHighDynamicRange="True" crs:SupportsNormalDynamicRange="True"
   crs:SupportsSceneReferred="True" crs:SupportsOutputReferred="False" crs:Copyright="" crs:Version="15.0"
   crs:ProcessVersion="11.0" crs:ConvertToGrayscale="False" crs:RGBTable="{fingerprint}"
   crs:Table_{fingerprint}="{escape(_encoded(_deflated(table)), {'"': "&quot;"})}" crs:HasSettings="True">
   <crs:Name><rdf:Alt><rdf:li xml:lang="x-default">{escape(name)}</rdf:li></rdf:Alt></crs:Name>
   <crs:ShortName><rdf:Alt><rdf:li xml:lang="x-default">{escape(name)}</rdf:li></rdf:Alt></crs:ShortName>
   <crs:SortName><rdf:Alt><rdf:li xml:lang="x-default"/></rdf:Alt></crs:SortName>
   <crs:Group><rdf:Alt><rdf:li xml:lang="x-default">LutForge</rdf:li></rdf:Alt></crs:Group>
   <crs:Description><rdf:Alt><rdf:li xml:lang="x-default">the camera's own look</rdf:li></rdf:Alt></crs:Description>
  </rdf:Description>
 </rdf:RDF>
</x:xmpmeta>
"""


def _rgb_table(cube: Array) -> bytes:
    """The block before compression: differences from the identity, modulo 2¹⁶."""
    codes = np.rint(np.clip(cube, 0.0, 1.0) * 65535).astype(np.int64)
    even = (np.arange(DIVISIONS) * 65535 + DIVISIONS // 2) // (DIVISIONS - 1)
    identity = np.stack(np.meshgrid(even, even, even, indexing="ij"), axis=-1)
    samples = bytes(np.mod(codes - identity, 65536).astype("<u2").tobytes())
    rgb_table, version, dimensions = 1, 1, 3
    rec2020, srgb_gamma, clip = 4, 1, 0
    least_amount, largest_amount = 0.0, 2.0
    head = struct.pack("<4I", rgb_table, version, dimensions, DIVISIONS)
    return head + samples + struct.pack("<3I2d", rec2020, srgb_gamma, clip, least_amount, largest_amount)


def _deflated(block: bytes) -> bytes:
    return struct.pack("<I", len(block)) + zlib.compress(block)


def _encoded(data: bytes) -> str:
    """Base 85, the least significant digit first; k bytes at the end become k + 1 signs."""
    words = np.frombuffer(data + b"\0" * (-len(data) % 4), dtype="<u4").astype(np.int64)
    digits = words[:, None] // 85 ** np.arange(5) % 85
    text = "".join(np.array(list(_ALPHABET))[digits].ravel())
    return text[: len(text) - (-len(data) % 4)]
