"""Use case: a LUT, profiles or an OpenColorIO config, and images → graded images."""

from __future__ import annotations  # so that help() shows the names of types

# What only some grades need is imported where it is needed: a command should not wait for it.
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from lutforge.errors import ImageError, SettingsError
from lutforge.grading.batch import BatchResult, apply_batch, plan_jobs
from lutforge.grading.grade import ConfigRecipe, LutRecipe, Recipe, ViewRecipe
from lutforge.grading.inputs import Failure, find_inputs, is_picture
from lutforge.pipeline.outputs import TABLE_SUFFIXES, Paths, check_output, one_of, several
from lutforge.progress import Progress, silent


@dataclass(frozen=True)
class Grading:
    """What to grade, and how: the arguments of `apply`, and what the command alone has.

    words: paths: one LUT file, one config, or profiles of different cameras; then files and folders. transfer: RAW →
    RAW from another camera to that of `look`. resume: skip what an earlier run did. scheduler: the address of a Dask
    cluster.
    """

    words: tuple[Path, ...]
    output: Path | None = None
    source: str | None = None
    target: str | None = None
    ev: float = 0.0
    look: Path | None = None
    transfer: Path | None = None
    suffix: str | None = None
    workers: int | None = None
    resume: bool = False
    scheduler: str | None = None
    space: str | None = None
    exposure: str | None = None
    view: str | None = None
    display: str | None = None

    def __post_init__(self) -> None:
        if self.words and is_picture(self.words[0]) and not _is_lut(self.words[0]):
            raise ImageError(f"{self.words[0]}: a picture; name the LUT, profile or config first, then the pictures")
        if not self.images:
            raise SettingsError("no image named: give the images after the profiles")
        if self.workers is not None and self.workers < 1:
            raise SettingsError(f"--workers {self.workers}: at least one thread is needed")
        if self.exposure is not None:
            one_of("exposure", self.exposure, ("exif",))
        self._check_view()
        if self.space is None:
            if self.exposure is not None:
                raise SettingsError("--exposure goes with --space: it scales linear light")
        elif not _is_profile(self.words[0]):
            raise SettingsError("--space goes with profiles (.npz)")
        elif self.look is not None or self.transfer is not None:
            raise SettingsError("--as goes without --space: light of a scene is of no camera")
        elif self.suffix is not None and self.suffix.lower().lstrip(".") != "exr":
            raise SettingsError(f"--suffix {self.suffix}: linear light is written as .exr")

    def _check_view(self) -> None:
        """Raise SettingsError where --view and --display do not go with the other words."""
        if self.view is None:
            if self.display is not None:
                raise SettingsError(f"--display {self.display}: goes with --view, the view that the display shows")
        elif not _is_config(self.words[0]):
            raise SettingsError("--view goes with a config (.ocio, .ocioz)")
        elif self.target is not None:
            raise SettingsError("--view goes without --to: the view says what comes out")

    @property
    def images(self) -> tuple[Path, ...]:
        """The images and folders: every path after the first that is no profile."""
        return tuple(path for path in self.words[1:] if not _is_profile(path))

    @cached_property
    def recipe(self) -> Recipe:
        """The recipe of the profiles, LUT or config, checked. Raises LutForgeError where an option does not fit it."""
        recipe: Recipe
        path, *others = self.words[0], *filter(_is_profile, self.words[1:])  # LUT, config or profile; further profiles
        if _is_profile(path):
            from lutforge.grading.profile_recipe import ProfileRecipe
            from lutforge.grading.scene_recipe import SceneRecipe

            settings = ((path, *others), self.source, self.target, self.ev)
            if self.space is not None:
                recipe = SceneRecipe(*settings, space=self.space, by_exposure=self.exposure is not None)
            else:
                recipe = ProfileRecipe(*settings, self.look, self.transfer)
        elif self.look is not None or self.transfer is not None or others:
            raise SettingsError("--as, --transfer and several profiles go with profiles (.npz) only")
        elif _is_config(path):
            if self.ev:
                raise SettingsError("--ev goes with a profile; a config converts from one colour space to another")
            if self.view is not None:
                recipe = ViewRecipe(path, self.source, self.view, self.display)
            else:
                recipe = ConfigRecipe(path, self.source, self.target)
        elif self.source is not None or self.target is not None or self.ev:
            raise SettingsError(
                "--from and --to go with a profile or a config, --ev with a profile; a LUT is applied as it is"
            )
        else:
            recipe = LutRecipe(path)
        recipe.check()
        return recipe

    @cached_property
    def folder(self) -> Path:
        """The folder for the graded images. Raises ImageError where none is named or it is a file."""
        if self.output is None:
            raise SettingsError("no output: name a folder for the graded images with -o")
        if self.output.exists() and not self.output.is_dir():
            raise ImageError(f"{self.output}: is not a folder; name a folder for the graded images")
        check_output(self.output / "image")
        return self.output

    @cached_property
    def inputs(self) -> tuple[list[Path], list[str]]:
        """The images to grade, and notes. Raises ImageError or SettingsError."""
        return find_inputs(self.images, self.folder, raw=_is_profile(self.words[0]))

    def commands(self) -> Iterator[str | Failure]:
        """The oiiotool lines that grade as `run` would, for a POSIX shell, or why there is none."""
        from lutforge.grading.oiiotool_commands import oiiotool_commands

        if self.space is not None:
            raise SettingsError("--print-commands goes without --space: oiiotool cannot mark what is clipped")
        jobs = plan_jobs(self.inputs[0], self.folder, self.suffix)
        yield from oiiotool_commands(self.recipe, jobs, self.folder / "luts")

    def run(self, progress: Progress = silent) -> BatchResult:
        """Grade the images; one that fails is told of in the result, and the others go on. progress: tells the rate."""
        suffix = self.suffix if self.space is None else ".exr"
        images, notes = self.inputs
        result = apply_batch(
            self.recipe, images, self.folder, suffix, self.workers, progress,
            resume=self.resume, scheduler=self.scheduler,
        )  # fmt: skip
        return replace(result, notes=(*notes, *result.notes))


def _is_lut(path: Path) -> bool:
    """True of a picture that is a LUT by its size and content, such as a Hald image."""
    from lutforge.luts.picture import SUFFIXES, is_picture_of_lut

    return path.suffix.lower() in SUFFIXES and is_picture_of_lut(path)


def _is_profile(path: Path) -> bool:
    """True also of a table, which is no image either: the profile's reader then says what it is."""
    return path.suffix.lower() in TABLE_SUFFIXES


def _is_config(path: Path) -> bool:
    return path.suffix.lower() in (".ocio", ".ocioz")


def apply(
    grade: Paths,
    images: Paths,
    output: str | Path,
    *,
    source: str | None = None,
    target: str | None = None,
    ev: float = 0.0,
    look: str | Path | None = None,
    space: str | None = None,
    exposure: str | None = None,
    view: str | None = None,
    display: str | None = None,
    suffix: str | None = None,
    workers: int | None = None,
) -> BatchResult:
    """Grade images into a folder, with their metadata, bit depth and extra channels kept.

    Args:
        grade: a LUT file, an OpenColorIO config, or profiles (.npz) of one camera or several.
        images: files and folders; with profiles RAW files, too.
        output: the folder.
        source: STYLE/WB of the images where they do not tell; with a config, their colour space.
        target: STYLE/WB wanted, as-shot to keep either; with a config, the colour space wanted.
        ev: exposure change in stops, with a profile.
        look: the profile of the camera whose look is wanted.
        space: linear light in this colour space instead of a look, with profiles, in .exr.
        exposure: with `space`, "exif" divides by the stated exposures, so that pictures of a scene agree.
        view: with a config, the view through which the images are seen, in place of `target`.
        display: with `view`, the display that shows it; the config's first without.
        suffix: another format for the output, such as ".exr".
        workers: threads; one per core without.

    Returns:
        What became of each image: `done`, `failed` with the reason, `skipped`; and notes.

    Raises:
        LutForgeError: nothing can be graded; then nothing is written.
    """
    words, beside = (*several(grade), *several(images)), None if look is None else Path(look)
    return Grading(
        words, Path(output), source, target, ev, beside, suffix=suffix, workers=workers, space=space, exposure=exposure,
        view=view, display=display,
    ).run()  # fmt: skip
