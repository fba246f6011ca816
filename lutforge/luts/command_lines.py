"""Command lines that apply a cube to pictures and films without changing anything else.

A cube takes RGB, a film holds Y'CbCr. A program that converts between the two by itself may use the matrix of BT.601
and write no tag: players then show an HD film in other colours. So the commands name BT.709, the matrix of HD and UHD
film for standard displays, before and after the cube and in the tags of the output.
"""

import shlex
from collections.abc import Callable
from pathlib import PurePath

CommandLine = Callable[[str | PurePath], str]
"""The command line of a LUT file, for a POSIX shell."""

_LAYOUTS = {8: "yuv420p", 10: "yuv420p10le"}
"""The pixel format of films that players read, by bits per channel."""

_ENCODER_OF_10_BITS = "libx265"
"""The encoder of films of 10 bits that most players read: H.265."""


def ffmpeg_cube(lut: str | PurePath) -> str:
    """Filters of libavfilter that apply a cube to pictures in RGB, 16 bits a channel."""
    # A path is an option's value within a filter graph; each of the two has special characters, which are escaped.
    name = "".join(f"\\{letter}" if letter in "\\':" else letter for letter in str(lut))
    name = "".join(f"\\{letter}" if letter in "\\'[],;" else letter for letter in name)
    return f"format=gbrp16le,lut3d=file={name}:interp=tetrahedral"


def ffmpeg_film(lut: str | PurePath, bits: int = 8) -> str:
    """Filters of libavfilter that apply a cube to HD film: to RGB, and back to 8 or 10 bits in video range."""
    back = f"scale=out_color_matrix=bt709:out_range=tv,format={_LAYOUTS[bits]}"
    return f"scale=in_color_matrix=bt709,{ffmpeg_cube(lut)},{back}"


def ffmpeg(lut: str | PurePath, bits: int = 8) -> str:
    """The command that grades a film by ffmpeg, sound and all, and writes 8 or 10 bits."""
    tags = "-colorspace bt709 -color_primaries bt709 -color_trc bt709 -color_range tv"
    encoder = "" if bits == 8 else f"-c:v {_ENCODER_OF_10_BITS} "
    return f"ffmpeg -i IN.mov -vf {_quoted(ffmpeg_film(lut, bits))} {tags} {encoder}-c:a copy OUT.mov"


def mpv(lut: str | PurePath) -> str:
    """The command that shows a film through a cube in mpv."""
    return f"mpv {_quoted(f'--vf=lavfi=[scale=in_color_matrix=bt709,{ffmpeg_cube(lut)}]')} IN.mov"


def melt(lut: str | PurePath, bits: int = 8) -> str:
    """The command that grades a film by MLT, the engine of Kdenlive and Shotcut, and writes 8 or 10 bits.

    The consumer asks for RGB: MLT then converts by the film's own matrix, in place of libavfilter by BT.601. The filter
    takes and gives 8 bits in any case (MLT 7.12); an output of 10 bits rounds no further.
    """
    filters = f"-filter avfilter.lut3d {shlex.quote(f'av.file={lut}')} av.interp=tetrahedral"
    encoder = "" if bits == 8 else f" vcodec={_ENCODER_OF_10_BITS} pix_fmt={_LAYOUTS[bits]}"
    return f"melt IN.mov {filters} -consumer avformat:OUT.mov mlt_image_format=rgb{encoder}"


def gmic(lut: str | PurePath, bits: int = 8) -> str:
    """The command that grades a picture of 8 or 16 bits a channel by G'MIC.

    G'MIC's command `map_clut` would make pictures 1 to 3 % brighter, since it counts one node too many per axis, and
    it assumes 8 bits.
    """
    top, factor = {8: (255, ""), 16: (65535, "257*")}[bits]
    lookup = f"s=(w#1-1)/{top};{factor}I(#1,s*R,s*G,s*B,1,1)"
    return f"gmic IN.png input_cube {_quoted(str(lut))} fill[0] {_quoted(lookup)} keep[0] round output OUT.png"


def _quoted(words: str) -> str:
    """One word of a shell, in double quotes where they suffice."""
    return shlex.quote(words) if any(letter in words for letter in '"$`\\!') else f'"{words}"'
