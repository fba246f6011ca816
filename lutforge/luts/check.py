"""What is in a LUT file, who can read it, and what will go wrong. The readers' habits: their sources, and trials."""

from codecs import BOM_UTF8
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.errors import LutError
from lutforge.luts.contents import Curve, LutContents
from lutforge.luts.processor import evaluate, file_processor
from lutforge.luts.read import read_lut

Array = NDArray[np.float64]

FALL = 1e-5
"""A step of an output in the wrong direction that is more than rounding."""
MOST_FALLING = 0.1
"""Share of steps at which a channel may fall: cameras press strong colours into their gamut, where one makes room."""
USUAL_SIZES = (17, 33, 65)
MARKED = "begins with a byte order mark: OpenColorIO and ffmpeg refuse it; save it as UTF-8 without one"
_NOT_TEXT = ("CLF", "CTF", "Hald image")
"""Formats in which a byte order mark does no harm, or means nothing."""


@dataclass(frozen=True)
class LutReport:
    """A LUT file in figures and words.

    size: nodes per axis, or none; shaper: entries of the 1D table, or none; lowest, highest: of all outputs; clipped:
    share of nodes with a channel at or beyond 0 or 1; falling: share of the steps along a channel's own axis that go
    down; problems: what is wrong with the file; readers: program → what it makes of the file.
    """

    path: Path
    format: str
    dialect: str
    title: str
    comments: tuple[str, ...]
    size: tuple[int, int, int] | None
    shaper: int | None
    response: int | None
    domain: tuple[tuple[float, float, float], tuple[float, float, float]]
    lowest: float
    highest: float
    clipped: float
    falling: float
    black: tuple[float, float, float] | None
    white: tuple[float, float, float] | None
    problems: tuple[str, ...]
    readers: dict[str, str]
    stages: tuple[str, ...] = ()


def check_lut(path: str | Path) -> LutReport:
    """Read any LUT file and say what is in it. Raises LutError, one line, where it cannot be read."""
    path = Path(path)
    contents = read_lut(path)
    cube, shaper = contents.cube, contents.shaper
    last = contents.response
    outputs = (
        last.outputs
        if last is not None
        else cube
        if cube is not None
        else shaper.outputs
        if shaper is not None
        else np.zeros((1, 3))
    )
    falling = _falling(cube) if cube is not None else 0.0
    ends: list[tuple[float, float, float] | None] = [None, None]
    if cube is not None:
        ends = [_triple(cube[0, 0, 0]), _triple(cube[-1, -1, -1])]
    marked = contents.format not in _NOT_TEXT and _begins_with_mark(path)
    opencolorio, black_white = _through_opencolorio(path, contents)
    if black_white is not None:
        ends = [_triple(black_white[0]), _triple(black_white[1])]
    return LutReport(
        path=path,
        format=contents.format,
        dialect=contents.dialect,
        title=contents.title,
        comments=tuple(text for text in contents.comments if text),
        size=None if cube is None else (cube.shape[0], cube.shape[1], cube.shape[2]),
        shaper=None if shaper is None else len(shaper.outputs),
        response=None if contents.response is None else len(contents.response.outputs),
        domain=contents.domain,
        lowest=float(outputs.min()),
        highest=float(outputs.max()),
        clipped=float(np.mean(np.any((outputs <= 0) | (outputs >= 1), axis=-1))),
        falling=falling,
        black=ends[0],
        white=ends[1],
        problems=(*([MARKED] if marked else []), *_problems(contents, falling)),
        readers={
            **opencolorio,
            **({"other programs": "many refuse the byte order mark"} if marked else _readers(contents)),
        },
        stages=contents.stages,
    )


def _begins_with_mark(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(BOM_UTF8)) == BOM_UTF8


def report_lines(report: LutReport) -> list[str]:
    """The report as lines of text."""
    lines = [f"{report.path}: {report.format}" + (f", {report.dialect}" if report.dialect else "")]
    if report.title:
        lines.append(f"  title     {_shown(report.title)}")
    lines += [f"  comment   {_shown(text)}" for text in report.comments[:8]]
    if report.stages:
        lines.append(f"  stages    {' → '.join(report.stages)}")
    if report.size is not None:
        lines.append(f"  cube      {' × '.join(map(str, report.size))} nodes")
    if report.shaper is not None:
        lines.append(f"  shaper    {report.shaper} entries")
    if report.response is not None:
        lines.append(f"  response  {report.response} entries behind the cube")
    low, high = report.domain
    if (low, high) != ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)):
        lines.append(f"  domain    {' '.join(f'{v:g}' for v in low)} to {' '.join(f'{v:g}' for v in high)}")
    lines.append(
        f"  outputs   {report.lowest:.6g} to {report.highest:.6g}, {report.clipped:.1%} of the nodes at a limit"
    )
    for name, colour in (("black", report.black), ("white", report.white)):
        if colour is not None:
            lines.append(f"  {name}     {' '.join(f'{v:.5f}' for v in colour)}")
    lines += [f"  problem   {text}" for text in report.problems]
    lines += [f"  {program}: {verdict}" for program, verdict in report.readers.items()]
    return lines


def _shown(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)[:160]


def _triple(colour: NDArray[np.floating]) -> tuple[float, float, float]:
    r, g, b = (float(v) for v in colour)
    return r, g, b


def _falling(cube: Array) -> float:
    """Share of the steps along each channel's own axis at which that channel falls."""
    steps = [np.diff(cube[..., channel], axis=channel) for channel in range(3)]
    return float(np.mean(np.concatenate([(step < -FALL).ravel() for step in steps])))


def _problems(contents: LutContents, falling: float) -> list[str]:
    found = []
    for name, curve in (("shaper", contents.shaper), ("response", contents.response)):
        if curve is not None:
            found += _curve_problems(name, curve)
    cube = contents.cube
    if cube is not None:
        diagonal = cube[tuple(np.arange(min(cube.shape[:3])) for _ in range(3))]
        if np.any(np.diff(diagonal.mean(axis=1)) < -FALL):
            found.append("grey becomes darker somewhere where the input becomes lighter")
        if falling > MOST_FALLING:
            found.append(
                f"a channel falls while its own input rises at {falling:.1%} of the steps: banding or solarisation"
            )
        if np.ptp(cube) < 1e-6:
            found.append("all colours become one")
        if contents.response is None and (cube.min() < -1e-6 or cube.max() > 1 + 1e-6):
            found.append("outputs leave [0, 1]: programs with integers clip them, others pass them on")
    if contents.bits == 8:
        found.append("8 bits per channel: gradients will show bands; 16 are usual")
    if "TITLE" in contents.keywords and contents.dialect.startswith("1D shaper"):
        found.append("TITLE in a .cube with a shaper: OpenColorIO and Nuke refuse it; delete that line")
    if contents.keywords & {"DOMAIN_MIN", "DOMAIN_MAX"} and contents.dialect.startswith("1D shaper"):
        found.append("DOMAIN lines in a .cube with a shaper: OpenColorIO refuses it; delete them")
    return found


def _curve_problems(name: str, curve: Curve) -> list[str]:
    steps = np.diff(curve.outputs, axis=0)
    found = []
    if np.any(steps < -FALL):
        row = int(np.flatnonzero(np.any(steps < -FALL, axis=1))[0])
        found.append(f"the {name} falls at entry {row + 2} of {len(curve.outputs)}: it cannot be undone there")
    if np.any(np.ptp(curve.outputs, axis=0) < 1e-6):
        found.append(f"the {name} is constant: all inputs become one")
    return found


def _through_opencolorio(path: Path, contents: LutContents) -> tuple[dict[str, str], Array | None]:
    """What OpenColorIO makes of the file: its verdict, and the outputs of the lowest and highest input."""
    if contents.format == "Hald image":
        return {"OpenColorIO, Nuke": "cannot read images as LUTs"}, None
    warnings: list[str] = []
    OCIO.SetLoggingFunction(warnings.append)  # else they appear on the terminal
    try:
        ends = evaluate(file_processor(path), np.array(contents.domain))
    except LutError as error:
        return {"OpenColorIO, Nuke": f"refuses it: {_shown(str(error).removeprefix(f'{path}: '))}"}, None
    finally:
        OCIO.ResetToDefaultLoggingFunction()
    verdict = "reads it" + "".join(f"; it warns: {_shown(' '.join(text.split()))}" for text in warnings[:2])
    return {"OpenColorIO, Nuke": verdict}, ends.astype(np.float64)


def _readers(contents: LutContents) -> dict[str, str]:
    """The other programs that can be expected to meet such a file."""
    match contents.format, contents.dialect:
        case ".cube", "1D shaper + 3D (Resolve)":
            refuses = bool(contents.keywords & {"LUT_1D_INPUT_RANGE", "LUT_3D_INPUT_RANGE"})
            wrong = "refuses it" if refuses else "reads it without a word and renders wrong colours"
            return {
                "DaVinci Resolve": "reads it, shaper included",
                "ffmpeg, Kdenlive, Shotcut": f"{wrong}: give it a 3D-only .cube or a .csp",
                "OBS": "loads the 1D part only: wrong colours",
                "G'MIC, GIMP, OpenShot": "read wrong colours",
                "darktable": "refuses it",
                "Premiere, After Effects, Photoshop, Final Cut": "do not expect them to read the shaper",
            }
        case ".cube", "3D":
            return _plain_cube_readers(contents)
        case ".cube", _:
            return {"ffmpeg lut1d, Resolve, OBS": "read it", "programs of 3D LUTs": "refuse it, or misread it"}
        case (("CLF" | "CTF"), _):
            found = {"Resolve, Flame, Baselight, ART": "read CLF" if contents.format == "CLF" else "Flame reads CTF"}
            if "SMPTE" in contents.keywords:
                found["colour-clf-io 0.2.0"] = "refuses its namespace (SMPTE ST 2136-1)"
            found["ffmpeg, Photoshop, darktable"] = "cannot read it: give them a 3D-only .cube"
            return found
        case ".csp", _:
            return {"ffmpeg, Photoshop, After Effects": "read it", "Resolve, darktable": "do not read .csp"}
        case ".3dl", _:
            size = 0 if contents.cube is None else len(contents.cube)
            found = {"Flame, Lustre, darktable": "read it"}
            found["ffmpeg"] = "reads it" if size == 17 else f"takes 17 nodes per axis only, not {size}: garbage"
            return found
        case "Hald image", _:
            return {"RawTherapee, ART, ImageMagick, G'MIC, darktable": "read it", "video programs": "mostly do not"}
        case ((".spi1d" | ".spi3d"), _):
            return {"other programs": "mostly do not read it; it belongs in an OpenColorIO config"}
        case _:
            return {"other programs": "mostly do not read it"}


def _plain_cube_readers(contents: LutContents) -> dict[str, str]:
    size = 0 if contents.cube is None else len(contents.cube)
    low, high = contents.domain
    found = {"Resolve, Premiere, Photoshop, Final Cut, ffmpeg, OBS, darktable, G'MIC": "read it"}
    if (low, high) != ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)):
        found = {
            "Resolve, Premiere, Photoshop": "read it",
            "darktable": "refuses a domain other than 0 to 1",
            "G'MIC, OpenShot, OBS": "ignore the domain: wrong colours",
            "ffmpeg": "misreads a domain that does not begin at 0" if any(low) else "reads it",
        }
    if size > 64:
        found["After Effects before 2022"] = f"takes up to 64 nodes per axis, not {size}"
    if size > 129:
        found["OpenColorIO, Nuke"] = f"takes up to 129 nodes per axis, not {size}"
    elif size not in USUAL_SIZES:
        found["cameras and monitors"] = f"often take 17, 33 or 65 nodes per axis only, not {size}"
    return found
