"""The oiiotool commands that grade as a batch would: for render farms that run programs, not Python."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from lutforge.apply.batch import Job
from lutforge.apply.grade import Grade, Recipe
from lutforge.apply.image import check_colours
from lutforge.apply.inputs import Failure
from lutforge.errors import ImageError, LutForgeError
from lutforge.images.read import ImageReader, is_premultiplied
from lutforge.images.write import SOFTWARE, describe_output, keeps_orientation
from lutforge.luts.sequence import Lut


def oiiotool_commands(recipe: Recipe, jobs: Sequence[Job], folder: Path) -> Iterator[str | Failure]:
    """Per image a line for a POSIX shell that gives the pixels of `apply`, or why there is none.

    folder: where the LUT of a profile's grade is written, once for the images that share it. Pixels are those of
    `apply_image` to within a code value.
    """
    files: dict[int, tuple[Lut, Path]] = {}
    for job in jobs:
        try:
            grade = recipe.grade(job.source)
            if grade.unchanged:
                raise ImageError(f"{job.source}: {grade.notes[0]}; copy it")
            words, lut = grade.oiiotool, grade.lut
            if lut is not None:
                path = folder / f"{recipe.key[:12]}-{len(files) + 1}.clf"
                words = ("--ociofiletransform", str(files.get(id(lut), (lut, path))[1]))
            command = _command(grade, words, job)
            if lut is not None and id(lut) not in files:
                files[id(lut)] = lut, lut.write(path)
            yield shlex.join(command)
        except LutForgeError as error:
            yield Failure(job.source, str(error))


def _command(grade: Grade, words: Sequence[str], job: Job) -> list[str]:
    if grade.raw:
        raise ImageError(f"{job.source}: oiiotool does not develop RAW files; let `lutforge apply` render it")
    if not words:
        raise ImageError(f"{job.source}: oiiotool has no such interpolation or conversion; let `lutforge apply` do it")
    if any(sign in word for word in words for sign in "$%"):
        path = next(word for word in words if set(word) & set("$%"))
        raise ImageError(f'{path}: OpenColorIO takes "$" and "%" in the path of a LUT for variables; rename it')
    with ImageReader(job.source) as reader:
        check_colours(job.source, reader.spec)
        described = describe_output(job.target, reader.spec, reader.format)
        premultiplied = is_premultiplied(reader.spec)
        turned = reader.spec.get_int_attribute("Orientation", 1) != 1 and not keeps_orientation(job.target)
    # Names are taken as they are: no frame numbers, no expressions.
    command = ["oiiotool", "--wildcardoff", "--evaloff", "--create-dir"]
    if not premultiplied and described.alpha_channel >= 0:
        command += ["--iconfig", "oiio:UnassociatedAlpha", "1"]
    command += ["-i", str(job.source)]
    conversions = ("--ociofiletransform", "--colorconvert") if premultiplied else ()
    command += [f"{word}:unpremult=1" if word in conversions else word for word in words]
    if turned:
        command += ["--reorient"]
    command += ["--nosoftwareattrib", "--sattrib", "Software", SOFTWARE]
    command += ["--sattrib", "Exif:ImageHistory", " ".join(grade.history.split())]
    command += _attributes(grade.attributes)
    command += ["-d", str(described.format)]
    compression = described.get_string_attribute("compression")
    if compression:
        command += ["--compression", compression]
    subsampling = described.get_string_attribute("jpeg:subsampling")
    if subsampling:
        command += ["--sattrib", "jpeg:subsampling", subsampling]
    return [*command, "-o", str(job.target)]


def _attributes(attributes: Mapping[str, object]) -> Iterator[str]:
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
