"""The oiiotool commands that grade as a batch does, for render farms that run programs, not Python."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.atomic_write import atomic_path
from lutforge.errors import ImageError, LutForgeError
from lutforge.grading.grade import Grade, Recipe
from lutforge.grading.image_colours import check_colours
from lutforge.grading.inputs import Failure
from lutforge.grading.jobs import Job
from lutforge.images.output_spec import SOFTWARE_NAME, describe_output, keeps_orientation
from lutforge.images.read import ImageReader, is_premultiplied
from lutforge.luts.sequence import Lut

PLAIN_CONFIG = "plain.ocio"
"""The name of a config of one space, which oiiotool 2.4 needs to apply a LUT."""


def oiiotool_commands(recipe: Recipe, jobs: Sequence[Job], folder: Path) -> Iterator[str | Failure]:
    """For each image a line for a shell that grades as `apply` does, or the reason why there is none.

    folder: for files that the lines use. The lines run in any folder, and name a config, so that the variable OCIO does
    not matter; their paths are absolute, since OpenColorIO would look for relative ones next to the config. The shell
    makes the folder of the output, since older versions of oiiotool do not.
    """
    folder = folder.absolute()
    plain_config = folder / PLAIN_CONFIG
    files: dict[int, tuple[Lut, Path]] = {}
    for job in jobs:
        try:
            grade = recipe.grade(job.source)
            if grade.unchanged:
                raise ImageError(f"{job.source}: {grade.notes[0]}; copy it")
            words = grade.oiiotool
            lut = grade.lut
            if lut is not None:
                path = folder / f"{recipe.key[:12]}-{len(files) + 1}.clf"
                words = ("--ociofiletransform", str(files.get(id(lut), (lut, path))[1]))
            applies_lut = "--ociofiletransform" in words
            if applies_lut:
                words = ("--colorconfig", str(plain_config), *words)
            command = _command(grade, words, job)
            if applies_lut and not plain_config.exists():
                with atomic_path(plain_config) as temporary:
                    temporary.write_text(_plain_config(), encoding="utf-8")
            if lut is not None and id(lut) not in files:
                files[id(lut)] = lut, lut.write(path)
            yield f"{shlex.join(['mkdir', '-p', str(job.target.absolute().parent)])} && {shlex.join(command)}"
        except LutForgeError as error:
            yield Failure(job.source, str(error))


def _plain_config() -> str:
    """The text of a config with one colour space."""
    config = OCIO.Config.CreateRaw()
    config.setVersion(2, 0)
    config.addColorSpace(OCIO.ColorSpace(name="linear"))
    config.setRole(OCIO.ROLE_SCENE_LINEAR, "linear")  # oiiotool requires this role
    return str(config.serialize())


def _command(grade: Grade, words: Sequence[str], job: Job) -> list[str]:
    """The words of the command that grades an image. words: of the conversion. Raises ImageError if there is none."""
    if grade.raw:
        raise ImageError(f"{job.source}: oiiotool does not develop RAW files; let `lutforge apply` render it")
    if any(sign in word for word in words for sign in "$%"):
        path = next(word for word in words if set(word) & set("$%"))
        raise ImageError(f'{path}: OpenColorIO takes "$" and "%" in the path of a LUT for variables; rename it')
    with ImageReader(job.source) as reader:
        check_colours(job.source, reader.spec)
        described = describe_output(job.target, reader.spec, reader.format)
        premultiplied = is_premultiplied(reader.spec)
        turned = reader.spec.get_int_attribute("Orientation", 1) != 1 and not keeps_orientation(job.target)

    # File names are literal: no wildcards for frame numbers, no expressions.
    command = ["oiiotool", "--wildcardoff", "--evaloff"]
    if not premultiplied and described.alpha_channel >= 0:
        command += ["--iconfig", "oiio:UnassociatedAlpha", "1"]
    command += ["-i", str(job.source.absolute())]
    conversions = ("--ociofiletransform", "--colorconvert", "--ociodisplay") if premultiplied else ()
    command += [f"{word}:unpremult=1" if word in conversions else word for word in words]
    if turned:
        command += ["--reorient"]
    command += ["--nosoftwareattrib", "--sattrib", "Software", SOFTWARE_NAME]
    command += ["--sattrib", "Exif:ImageHistory", " ".join(grade.history.split())]
    command += _attributes(grade.attributes)
    command += ["-d", str(described.format)]
    if compression := described.get_string_attribute("compression"):
        command += ["--compression", compression]
    if subsampling := described.get_string_attribute("jpeg:subsampling"):
        command += ["--sattrib", "jpeg:subsampling", subsampling]
    return [*command, "-o", str(job.target.absolute())]


def _attributes(attributes: Mapping[str, object]) -> Iterator[str]:
    """The words that set or erase metadata. Raises ImageError on an ICC profile."""
    for name, value in attributes.items():
        if value is None:
            yield from ("--eraseattrib", name)
        elif isinstance(value, bytes):
            raise ImageError("oiiotool embeds no ICC profile: let `lutforge apply` grade pictures in Adobe RGB")
        elif isinstance(value, str):
            yield from ("--sattrib", name, value)
        elif isinstance(value, Sequence):
            kind = "int" if all(isinstance(entry, int) for entry in value) else "float"
            yield from (f"--attrib:type={kind}[{len(value)}]", name, ",".join(map(str, value)))
        else:
            yield from ("--attrib", name, str(value))
