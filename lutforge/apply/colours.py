"""Colour checks of an image: whether a grade can take it, its colour-space metadata, and notes for the user."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.apply.grade import Grade
from lutforge.arrays import Index, Pixels
from lutforge.colour.rgb_spaces import adobe_rgb_profile
from lutforge.errors import ImageError
from lutforge.images.icc import is_broken, is_srgb
from lutforge.images.jpeg import JpegHeader
from lutforge.images.read import is_premultiplied
from lutforge.images.write import IN_ANOTHER_SPACE

_RGB = (("r", "g", "b"), ("red", "green", "blue"))

_NOT_RGB = {
    "CMYK": "CMYK", "YCbCrK": "CMYK", "color separated": "CMYK",
    "CIELAB": "CIELAB", "ICCLAB": "CIELAB", "ITULAB": "CIELAB",
}  # fmt: skip
"""What OpenImageIO says of files whose colours it gives as RGB all the same, and what they are."""

TELL_ADOBE_RGB: Mapping[str, object] = {"ICCProfile": adobe_rgb_profile(), "Exif:ColorSpace": IN_ANOTHER_SPACE}
"""Metadata, by OpenImageIO's names, of a picture in Adobe RGB."""


def check_colours(path: Path, spec: oiio.ImageSpec) -> None:
    """Raise ImageError where the first three channels are not RGB colours, or their alpha is not the fourth."""
    if spec.nchannels < 3:
        grey = " (greyscale); convert it to RGB first" if spec.nchannels <= 2 else ""
        raise ImageError(f"{path}: a LUT needs red, green and blue; this image has {spec.nchannels} channel(s){grey}")
    for name in ("jpeg:ColorSpace", "tiff:ColorSpace"):
        if (stored := spec.get_string_attribute(name)) in _NOT_RGB:
            raise ImageError(f"{path}: its colours are {_NOT_RGB[stored]}, not RGB; convert it to RGB first")
    if set(_last_words(spec.channelnames[:3])) == {"y", "ry", "by"}:
        raise ImageError(f"{path}: its colours are luminance and chroma, not RGB; convert it to RGB first")
    alpha = spec.alpha_channel
    if 0 <= alpha < 3 or (alpha > 3 and is_premultiplied(spec)):
        raise ImageError(f"{path}: channels are {', '.join(spec.channelnames)}; put R, G, B, A first")


def _last_words(names: Sequence[str]) -> Iterator[str]:
    """Channel names in lower case, without their layer."""
    return (name.rpartition(".")[2].lower() for name in names)


def colour_space(source: Path, spec: oiio.ImageSpec, format: str, jpeg: JpegHeader | None) -> Mapping[str, object]:
    """What tells that a picture is in Adobe RGB, where only a tag said it that OpenImageIO does not keep.

    jpeg: what stands in a JPEG whose own tags are kept; they are read no further than where DCF has this one.
    """
    if jpeg is not None:
        return TELL_ADOBE_RGB if jpeg.says_adobe_rgb and spec.getattribute("ICCProfile") is None else {}
    if format != "jpeg" or spec.getattribute("ICCProfile") is not None:
        return {}
    from lutforge.shots.maker_settings import in_adobe_rgb  # loads what reads metadata
    from lutforge.shots.tags import tags

    return TELL_ADOBE_RGB if in_adobe_rgb(tags(source)) else {}


def other_space(grade: Grade, source: oiio.ImageSpec, attributes: Mapping[str, object]) -> str:
    """The name of a picture's space where it is not sRGB and the grade does not know so, else "".

    attributes: of the output.
    """
    if "ICCProfile" in grade.attributes:
        return ""
    if "ICCProfile" in attributes:
        return "Adobe RGB"
    profile = source.getattribute("ICCProfile")
    if profile is None or is_srgb(bytes(profile)):
        return ""
    return source.get_string_attribute("ICCProfile:profile_description").strip() or "a space without a name"


def count_doubtful(pixels: Pixels, confidence: Pixels | None) -> Index:
    """Count the pixels (h, w, c) that cannot be trusted, by kind, (3,).

    They are clipped, else unlike every colour of the calibration, or no finite numbers. confidence: as
    `Grade.confidence` gives it, where it is known.
    """
    clipped, unlike, broken = np.intp(0), np.intp(0), np.intp(0)
    if confidence is not None:
        clips = confidence[..., 1] < 0.5
        clipped, unlike = np.count_nonzero(clips), np.count_nonzero((confidence[..., 2] < 0.5) & ~clips)
    with np.errstate(all="ignore"):
        total = np.sum(pixels)  # NaN and infinity stay what they are
    if not np.isfinite(total):
        broken = np.count_nonzero(~np.isfinite(pixels[..., :3]).all(axis=-1))
    return np.array([clipped, unlike, broken])


def notes_on(
    grade: Grade, format: str, source: oiio.ImageSpec, output: oiio.ImageSpec, space: str, doubtful: Index
) -> Iterator[str]:
    """Yield what the user should know of the colours of a graded image.

    format: of the source, as `Image.format`; space: as `other_space` names it; doubtful: as `count_doubtful` sums them.
    """
    # Scene-linear light in 8-bit files, which hardly ever hold it, and in formats that are made for it
    if grade.for_srgb and not grade.raw and format in ("openexr", "hdr"):
        yield "such a file holds scene-linear light, as a rule, and this grade takes encoded sRGB: encode it first"
    if grade.takes_linear and not grade.raw and str(source.format) == "uint8":
        yield "scene-linear light is what this grade takes, and 8-bit pictures are encoded: linearize them first"
    if grade.gives_linear and str(output.format) == "uint8":
        yield "scene-linear light in 8 bits shows bands: keep it in half or float, with --suffix .exr"
    if space:
        yield f"the picture is in {space}, and was graded as it is: what is made for sRGB wants it converted"
    profile = source.getattribute("ICCProfile")
    if profile is not None and is_broken(bytes(profile)):
        yield "the picture's ICC profile is broken: its colours were taken as they are"
    # Graded channels with unusual names, and further layers
    graded, others = ", ".join(source.channelnames[:3]), source.channelnames[3:]
    if tuple(_last_words(source.channelnames[:3])) not in _RGB:
        yield f"the channels {graded} were graded as red, green and blue"
    layers = dict.fromkeys(name.rpartition(".")[0] for name in others if name.lower().endswith((".r", ".red")))
    if layers:
        yield f"{graded} were graded; the layers {', '.join(layers)} are as they were"
    count = source.width * source.height
    clipped, unlike, broken = (int(number) for number in doubtful)
    if clipped > 0.001 * count:
        yield f"{clipped / count:.1%} of the pixels are clipped; what they lost stays neutral"
    if unlike > 0.001 * count:
        yield f"{unlike / count:.1%} of the pixels are of colours that the calibration hardly knows"
    if broken:
        are = "pixels are not finite numbers" if broken > 1 else "pixel is not a finite number"
        yield f"{broken} {are}; what became of them means nothing"
