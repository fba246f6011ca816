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


def ffmpeg_cube(lut: str | PurePath) -> str:
    """Filters of libavfilter that apply a cube to pictures in RGB, 16 bits a channel."""
    # A path is an option's value within a filter graph; each of the two has special characters, which are escaped.
    name = "".join(f"\\{letter}" if letter in "\\':" else letter for letter in str(lut))
    name = "".join(f"\\{letter}" if letter in "\\'[],;" else letter for letter in name)
    return f"format=gbrp16le,lut3d=file={name}:interp=tetrahedral"


def ffmpeg_film(lut: str | PurePath) -> str:
    """Filters of libavfilter that apply a cube to HD film: to RGB, through it, and back to 8 bits in video range."""
    back = "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p"
    return f"scale=in_color_matrix=bt709,{ffmpeg_cube(lut)},{back}"


def ffmpeg(lut: str | PurePath) -> str:
    """The command that grades a film by ffmpeg, sound and all."""
    tags = "-colorspace bt709 -color_primaries bt709 -color_trc bt709 -color_range tv"
    return f"ffmpeg -i IN.mov -vf {_quoted(ffmpeg_film(lut))} {tags} -c:a copy OUT.mov"


def mpv(lut: str | PurePath) -> str:
    """The command that shows a film through a cube in mpv."""
    return f"mpv {_quoted(f'--vf=lavfi=[scale=in_color_matrix=bt709,{ffmpeg_cube(lut)}]')} IN.mov"


def melt(lut: str | PurePath) -> str:
    """The command that grades a film by MLT, the engine of Kdenlive and Shotcut.

    The consumer asks for RGB: MLT then converts by the film's own matrix, in place of libavfilter by BT.601.
    """
    filters = f"-filter avfilter.lut3d {shlex.quote(f'av.file={lut}')} av.interp=tetrahedral"
    return f"melt IN.mov {filters} -consumer avformat:OUT.mov mlt_image_format=rgb"


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
