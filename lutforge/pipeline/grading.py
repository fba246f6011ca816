"""Use case: a LUT, profiles or an OpenColorIO config, and images → graded images."""

from __future__ import annotations  # so that help() shows the names of types

# Modules that only some grades need are imported in functions, so that other commands start faster.
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from lutforge.errors import ImageError, SettingsError
from lutforge.grading.batch import BatchResult, apply_batch, plan_jobs
from lutforge.grading.grade import ConfigRecipe, LutRecipe, Recipe, ViewRecipe
from lutforge.grading.inputs import Failure, find_inputs, is_picture
from lutforge.pipeline.file_kinds import is_config, is_lut_picture, is_profile
from lutforge.pipeline.outputs import Paths, check_output, one_of, several
from lutforge.progress import Progress, silent


@dataclass(frozen=True)
class Grading:
    """The arguments of `apply`, and those that only the command has.

    paths: one LUT file, one config, or profiles of different cameras; then files and folders of images.
    transfer: RAW → RAW from another camera to that of `look`.
    resume: skip images that an earlier run graded.
    scheduler: the address of a Dask cluster.

    All others are as in `apply`.
    """

    paths: tuple[Path, ...]
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
        if self.paths and is_picture(self.paths[0]) and not is_lut_picture(self.paths[0]):
            raise ImageError(f"{self.paths[0]}: a picture; name the LUT, profile or config first, then the pictures")
        if not self.images:
            raise SettingsError("no image named: give the images after the profiles")
        if self.workers is not None and self.workers < 1:
            raise SettingsError(f"--workers {self.workers}: at least one thread is needed")
        if self.exposure is not None:
            one_of("exposure", self.exposure, ("exif",))
        self._check_view()
        self._check_space()

    def _check_view(self) -> None:
        """Raise SettingsError where --view and --display do not go with the other words."""
        if self.view is None:
            if self.display is not None:
                raise SettingsError(f"--display {self.display}: goes with --view, the view that the display shows")
        elif not is_config(self.paths[0]):
            raise SettingsError("--view goes with a config (.ocio, .ocioz)")
        elif self.target is not None:
            raise SettingsError("--view goes without --to: the view says what comes out")

    def _check_space(self) -> None:
        """Raise SettingsError where --space and --exposure do not go with the other words."""
        if self.space is None:
            if self.exposure is not None:
                raise SettingsError("--exposure goes with --space: it scales linear light")
        elif not is_profile(self.paths[0]):
            raise SettingsError("--space goes with profiles (.npz)")
        elif self.look is not None or self.transfer is not None:
            raise SettingsError("--as goes without --space: light of a scene is of no camera")
        elif self.suffix is not None and self.suffix.lower().lstrip(".") != "exr":
            raise SettingsError(f"--suffix {self.suffix}: linear light is written as .exr")

    @property
    def images(self) -> tuple[Path, ...]:
        """The images and folders: all paths but the first one and profiles."""
        return tuple(path for path in self.paths[1:] if not is_profile(path))

    @cached_property
    def recipe(self) -> Recipe:
        """The recipe of the profiles, LUT or config, checked. Raises LutForgeError where an option does not fit it."""
        path = self.paths[0]
        more_profiles = tuple(filter(is_profile, self.paths[1:]))
        recipe: Recipe
        if is_profile(path):
            recipe = self._recipe_from_profiles((path, *more_profiles))
        elif self.look is not None or self.transfer is not None or more_profiles:
            raise SettingsError("--as, --transfer and several profiles go with profiles (.npz) only")
        elif is_config(path):
            recipe = self._recipe_from_config(path)
        elif self.source is not None or self.target is not None or self.ev:
            raise SettingsError(
                "--from and --to go with a profile or a config, --ev with a profile; a LUT is applied as it is"
            )
        else:
            recipe = LutRecipe(path)
        recipe.check()
        return recipe

    def _recipe_from_profiles(self, profiles: tuple[Path, ...]) -> Recipe:
        """The recipe of profiles: to linear values of a space, or to another look."""
        from lutforge.grading.profile_recipe import ProfileRecipe
        from lutforge.grading.scene_recipe import SceneRecipe

        settings = (profiles, self.source, self.target, self.ev)
        if self.space is not None:
            return SceneRecipe(*settings, space=self.space, by_exposure=self.exposure is not None)
        return ProfileRecipe(*settings, self.look, self.transfer)

    def _recipe_from_config(self, path: Path) -> Recipe:
        """The recipe of a config: to another colour space, or through a view. Raises SettingsError."""
        if self.ev:
            raise SettingsError("--ev goes with a profile; a config converts from one colour space to another")
        if self.view is not None:
            return ViewRecipe(path, self.source, self.view, self.display)
        return ConfigRecipe(path, self.source, self.target)

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
        return find_inputs(self.images, self.folder, raw=is_profile(self.paths[0]))

    def commands(self) -> Iterator[str | Failure]:
        """The oiiotool lines that grade as `run` does, for a POSIX shell, or the reason why there is none."""
        from lutforge.grading.oiiotool_commands import oiiotool_commands

        if self.space is not None:
            raise SettingsError("--print-commands goes without --space: oiiotool cannot mark what is clipped")
        jobs = plan_jobs(self.inputs[0], self.folder, self.suffix)
        yield from oiiotool_commands(self.recipe, jobs, self.folder / "luts")

    def run(self, progress: Progress = silent) -> BatchResult:
        """Grade the images; those that fail are in the result. progress: called with the rate of work."""
        suffix = self.suffix if self.space is None else ".exr"
        images, notes = self.inputs
        result = apply_batch(
            self.recipe, images, self.folder, suffix, self.workers, progress,
            resume=self.resume, scheduler=self.scheduler,
        )  # fmt: skip
        return replace(result, notes=(*notes, *result.notes))


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
        source: STYLE/WB of the images, where their metadata do not state it; with a config, their colour space.
        target: STYLE/WB of the graded images, as-shot to keep either; with a config, their colour space.
        ev: exposure change in stops, with a profile.
        look: the profile of the camera whose look the images get.
        space: linear values of this colour space in place of a look, with profiles, in .exr.
        exposure: with `space`, "exif" divides by the stated exposures, so that pictures of a scene agree.
        view: with a config, the view for the graded images, in place of `target`.
        display: with `view`, its display; by default the config's first.
        suffix: another format for the output, such as ".exr".
        workers: threads; by default one per core.

    Returns:
        The outcome for each image: `done`, `failed` with the reason, `skipped`; and notes.

    Raises:
        LutForgeError: nothing can be graded; then nothing is written.
    """
    return Grading(
        paths=(*several(grade), *several(images)),
        output=Path(output),
        source=source,
        target=target,
        ev=ev,
        look=None if look is None else Path(look),
        suffix=suffix,
        workers=workers,
        space=space,
        exposure=exposure,
        view=view,
        display=display,
    ).run()
