"""Recipes and grades: a recipe states how a batch grades images, and returns the grade of each image."""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge import __version__
from lutforge.arrays import Single
from lutforge.child_processes import guarded
from lutforge.errors import ConfigError, LutError, LutForgeError, alternatives
from lutforge.luts.check import check_lut, other_half
from lutforge.luts.forms import MAX_SIZE
from lutforge.luts.input_and_output import ENCODED, read_input_and_output
from lutforge.luts.ocio_transforms import OCIO_ERRORS, of_codes
from lutforge.luts.ops_from_ocio import OpWithoutParametersError
from lutforge.luts.reading import is_read_by_ocio, validated_processor
from lutforge.luts.sequence import Lut

if TYPE_CHECKING:
    from lutforge.model.vignetting import Vignetting


@dataclass(frozen=True, eq=False, kw_only=True)
class Grade:
    """The grade of one image.

    processor: colours in the image's own encoding → graded colours.
    history: one line for the output's metadata.
    attributes: further metadata to set in the output, by OpenImageIO's names; those with None, whose name is a regular
        expression, are erased.
    raw: the source is a RAW file, and its linear camera RGB is graded after a correction of vignetting.
    vignettings: those of the camera, of which the one of the RAW file's lens setting is corrected.
    notes: for the user.
    takes_linear, gives_linear: the input, or the output, is known to be scene-linear, and not an encoded picture.
    oiiotool: the arguments by which oiiotool does the same, where it can.
    lut: the LUT of `processor`, where it is in no file.
    unchanged: the pixels stay as they are.
    codes: as `processor`, for 8-bit codes in and out; None for RAW files.
    for_srgb: the input is known to be sRGB.
    marks_clipped: a channel "clipped" is added, 1 where a channel of the source is at 0 or 1.
    """

    processor: OCIO.CPUProcessor
    history: str
    attributes: Mapping[str, object] = field(default_factory=dict)
    raw: bool = False
    vignettings: "tuple[Vignetting, ...]" = ()
    notes: tuple[str, ...] = ()
    takes_linear: bool = False
    gives_linear: bool = False
    oiiotool: tuple[str, ...] = ()
    lut: Lut | None = None
    unchanged: bool = False
    codes: OCIO.CPUProcessor | None = None
    for_srgb: bool = False
    marks_clipped: bool = False


@dataclass(frozen=True)
class Recipe(ABC):
    """The instructions by which a batch grades images.

    Its fields are paths and settings only, so that another machine can rebuild it.
    """

    @cached_property
    def key(self) -> str:
        """A fingerprint of everything that affects the result."""
        return fingerprint(type(self).__name__, *(getattr(self, field.name) for field in fields(self)))

    def check(self) -> None:
        """Raise LutForgeError where a part that all images share is wrong, so that none can be graded."""
        self.grade(Path())

    @abstractmethod
    def grade(self, source: Path) -> Grade:
        """The grade of one image; images can share a grade. Raises LutForgeError where this image cannot be graded."""


def fingerprint(*parts: object) -> str:
    """Return the SHA-256, in hexadecimal, of the parts of a grade. Raises LutError where a file cannot be read.

    It covers the contents of files, other parts as text, and the versions of LutForge and OpenColorIO.
    """
    total = hashlib.sha256(f"{__version__} {OCIO.__version__}".encode())
    for part in parts:
        text = fingerprint(*part) if isinstance(part, tuple) else repr(part)
        try:
            data = part.read_bytes() if isinstance(part, Path) else text.encode()
        except OSError as error:
            raise LutError(f"{part}: {error.strerror or 'cannot be opened'}") from error
        total.update(hashlib.sha256(data).digest())
    return total.hexdigest()


@dataclass(frozen=True)
class LutRecipe(Recipe):
    """Grade all images by one LUT file. Problems that `check` finds in it are notes on each image.

    Cubes are interpolated as their file states, else tetrahedrally; cubes in pictures, such as Halds, trilinearly.
    """

    path: Path

    def grade(self, source: Path) -> Grade:
        """The grade by the LUT."""
        return self._grade

    @cached_property
    def _grade(self) -> Grade:
        second_file = other_half(self.path)
        if second_file is not None:
            raise LutError(
                f"{self.path}: half of a LUT, {second_file.name} is the other; bake a .clf or .cube to apply, or use "
                "the two in an OpenColorIO config"
            )

        lut: Lut | None = None
        problems: tuple[str, ...] = ()
        with suppress(OpWithoutParametersError):  # a LUT that only OpenColorIO can evaluate
            report = check_lut(self.path)
            lut = report.lut
            problems = report.problems
        stated = None if lut is None else read_input_and_output(lut.comments)
        takes_linear, gives_linear = (False, False) if stated is None else stated.are_linear

        lut_in_memory: Lut | None = None
        oiiotool: tuple[str, ...] = ()
        if lut is None or is_read_by_ocio(self.path, lut):
            of_file = validated_processor(self.path)
            processor = of_file.getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)
            codes = of_codes(of_file)
            oiiotool = ("--ociofiletransform", str(self.path.absolute()))
        else:
            lut_in_memory = lut
            is_large = lut.size > MAX_SIZE
            processor = LutProcessor(lut) if is_large else lut.processor()
            codes = None if is_large else lut.processor(codes=True)
        return Grade(
            processor=processor,
            codes=codes,
            history=f"graded with {self.path.name}",
            notes=tuple(f"{self.path}: {problem}" for problem in problems),
            takes_linear=takes_linear,
            gives_linear=gives_linear,
            for_srgb=stated is not None and stated.input == ENCODED,
            oiiotool=oiiotool,
            lut=lut_in_memory,
        )


@dataclass(frozen=True)
class LutProcessor:
    """A processor of float32 pixels, for a LUT with more nodes than OpenColorIO accepts."""

    lut: Lut

    def applyRGB(self, pixels: Single) -> None:  # noqa: N802 - the method of OpenColorIO's processors
        """Grade pixels (…, 3) in place."""
        pixels[:] = self.lut(pixels.astype(np.float64)).astype(np.float32)


@dataclass(frozen=True)
class RecipeFromConfig(Recipe):
    """Grade by a conversion of an OpenColorIO config, from one of its colour spaces."""

    path: Path
    source: str | None

    @cached_property
    def key(self) -> str:
        """A fingerprint of the conversion: the processor's cache ID depends on the contents of the config's LUTs."""
        return fingerprint("config", self._grade.processor.getCacheID())

    def grade(self, source: Path) -> Grade:
        """The grade by the conversion."""
        return self._grade

    @cached_property
    def _grade(self) -> Grade:
        from lutforge.ocio.check import load_config  # imported here: a LUT does not need it

        config = load_config(self.path)
        try:
            return self._conversion(config)
        except ConfigError:
            raise
        except (LutForgeError, *OCIO_ERRORS) as error:
            raise ConfigError(f"{self.path}: {error}") from error

    @abstractmethod
    def _conversion(self, config: OCIO.Config) -> Grade:
        """The grade. Raises ConfigError, OpenColorIO's errors, and those of `guarded`."""

    def _space(self, config: OCIO.Config, name: str) -> OCIO.ColorSpace:
        """A colour space of the config. Raises ConfigError on an unknown name."""
        space = config.getColorSpace(name)
        if space is None:
            raise ConfigError(
                f'{self.path}: no colour space "{name}"; {alternatives(name, config.getColorSpaceNames())}'
            )
        return space

    def _graded(
        self, processor: OCIO.Processor, history: str, linear: tuple[bool, bool], words: Sequence[str]
    ) -> Grade:
        """The grade of a processor. linear: its input, and its output, are linear; words: of oiiotool for the same."""
        takes_linear, gives_linear = linear
        return Grade(
            processor=processor.getDefaultCPUProcessor(),
            history=history,
            takes_linear=takes_linear,
            gives_linear=gives_linear,
            oiiotool=("--colorconfig", str(self.path.absolute()), *words),
            codes=of_codes(processor, OCIO.OPTIMIZATION_DEFAULT),
        )


@dataclass(frozen=True)
class ConfigRecipe(RecipeFromConfig):
    """Grade from one colour space of an OpenColorIO config to another."""

    target: str | None

    def _conversion(self, config: OCIO.Config) -> Grade:
        from lutforge.ocio.check import try_conversion

        if self.source is None or self.target is None:
            names = ", ".join(config.getColorSpaceNames())
            raise ConfigError(f"{self.path}: name two of its colour spaces with --from and --to: {names}")
        spaces = [self._space(config, name) for name in (self.source, self.target)]
        guarded(try_conversion, str(self.path), self.source, self.target)
        takes_linear, gives_linear = (_is_linear(config, space) for space in spaces)
        words = ("--colorconvert", self.source, self.target)
        processor = config.getProcessor(self.source, self.target)
        return self._graded(processor, f"{self.source} to {self.target}", (takes_linear, gives_linear), words)


@dataclass(frozen=True)
class ViewRecipe(RecipeFromConfig):
    """Grade from a colour space of an OpenColorIO config to what a display shows through a view.

    display: without one, the config's first.
    """

    view: str
    display: str | None

    def _conversion(self, config: OCIO.Config) -> Grade:
        from lutforge.ocio.check import try_view

        if self.source is None:
            names = ", ".join(config.getColorSpaceNames())
            raise ConfigError(f"{self.path}: name the colour space of the images with --from: {names}")
        source = self._space(config, self.source)
        display = self._named("display", self.display or config.getDefaultDisplay(), config.getDisplaysAll())
        kinds = (OCIO.VIEW_SHARED, OCIO.VIEW_DISPLAY_DEFINED)
        views = [view for kind in kinds for view in config.getViews(kind, display)]
        view = self._named(f"view of {display}", self.view, views)
        guarded(try_view, str(self.path), self.source, display, view)

        name = config.getDisplayViewColorSpaceName(display, view)
        space = config.getColorSpace(display if name == OCIO.OCIO_VIEW_USE_DISPLAY_NAME else name)
        takes_linear = _is_linear(config, source)
        gives_linear = takes_linear if space.isData() else _is_linear(config, space)
        words = ("--iscolorspace", self.source, "--ociodisplay", display, view)
        processor = config.getProcessor(self.source, display, view, OCIO.TRANSFORM_DIR_FORWARD)
        return self._graded(
            processor, f"{self.source} through {view} on {display}", (takes_linear, gives_linear), words
        )

    def _named(self, kind: str, name: str, names: Iterable[str]) -> str:
        """The name as the config writes it, in upper or lower case. Raises ConfigError."""
        by_lower = {entry.lower(): entry for entry in names}
        if name.lower() not in by_lower:
            raise ConfigError(f'{self.path}: no {kind} is called "{name}"; {alternatives(name, by_lower.values())}')
        return by_lower[name.lower()]


def _is_linear(config: OCIO.Config, space: OCIO.ColorSpace) -> bool:
    """True where a colour space of a config is linear."""
    return bool(config.isColorSpaceLinear(space.getName(), space.getReferenceSpaceType()))
