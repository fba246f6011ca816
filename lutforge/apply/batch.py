"""Grade many images by one recipe; a file that fails is reported, and the others go on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from lutforge.apply.grade import Recipe
from lutforge.apply.image import Applied, apply_image
from lutforge.errors import ImageError, LutForgeError


@dataclass(frozen=True)
class Failure:
    """An image that was not graded, and why, in one line."""

    source: Path
    reason: str


@dataclass(frozen=True)
class BatchResult:
    """Every input is in one of the two."""

    done: tuple[Applied, ...]
    failed: tuple[Failure, ...]


Progress = Callable[[int, int, Path], None]
"""Called after each image with the number done, the total, and its path."""


def apply_batch(
    recipe: Recipe,
    sources: Sequence[str | Path],
    folder: str | Path,
    suffix: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> BatchResult:
    """Grade images into a folder under their own names.

    suffix: such as ".exr", for another format. Each output is written whole or not at all. Raises ImageError
    where two inputs would become one output or an output would replace an input; then nothing is written.
    """
    inputs = [Path(source) for source in sources]
    targets = plan_outputs(inputs, Path(folder), suffix)
    done: list[Applied] = []
    failed: list[Failure] = []
    for number, (source, target) in enumerate(zip(inputs, targets, strict=True), start=1):
        try:
            done.append(apply_image(recipe.grade(source), source, target, workers))
        except LutForgeError as error:
            failed.append(Failure(source, str(error)))
        except MemoryError:
            failed.append(Failure(source, f"{source}: not enough memory for this image"))
        if progress is not None:
            progress(number, len(inputs), source)
    return BatchResult(tuple(done), tuple(failed))


def plan_outputs(sources: Sequence[Path], folder: Path, suffix: str | None = None) -> list[Path]:
    """The output path of each input. Raises ImageError on a collision or on an output that is an input."""
    if suffix is not None and not suffix.startswith("."):
        suffix = f".{suffix}"
    targets = [folder / (source.name if suffix is None else source.stem + suffix) for source in sources]
    inputs = {source.resolve() for source in sources}
    seen: dict[str, Path] = {}
    for source, target in zip(sources, targets, strict=True):
        if target.resolve() in inputs:
            raise ImageError(f"{target}: the output would replace an input; choose another folder")
        # Some file systems do not tell upper from lower case.
        other = seen.setdefault(str(target.resolve()).lower(), source)
        if other is not source:
            raise ImageError(f"{source} and {other} would both become {target}; grade them into two folders")
    return targets
