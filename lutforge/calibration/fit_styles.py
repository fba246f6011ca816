"""The fits of all styles of a calibration, and the notes on what their samples lack."""

from collections.abc import Callable, Mapping

from lutforge.calibration.coverage_notes import thin_colours
from lutforge.calibration.lattice.fit import node_coverage
from lutforge.calibration.style import StyleData
from lutforge.model.lattice import Lattice
from lutforge.model.profile import ByDirection, CameraModel, PictureStyle
from lutforge.progress import Progress
from lutforge.threads import each


def fit_styles(
    data: Mapping[str, StyleData],
    models_of: Callable[[str], tuple[CameraModel, ...]],
    lattices_of: Callable[[StyleData], ByDirection[Lattice]],
    progress: Progress,
) -> dict[str, PictureStyle]:
    """Fit the styles, several at once. models_of: the camera models of a style by its name. Raises CalibrationError."""

    def fit_style(name: str) -> PictureStyle:
        style = data[name]
        lattices = lattices_of(style)
        coverage = {
            direction: node_coverage(lattice, style.both[direction][0]) for direction, lattice in lattices.items()
        }
        return PictureStyle(lattices.render, lattices.linearize, models_of(name), coverage=coverage)

    progress(f"fitting {', '.join(data)}", 0.0)
    styles = {}
    for name, fitted in zip(data, each(fit_style, list(data)), strict=True):
        styles[name] = fitted
        progress(f"{name}: fitted", len(styles) / len(data))
    progress("done", 1.0)
    return styles


def notes_on_fits(data: Mapping[str, StyleData], clipped: int, count: int) -> list[str]:
    """Notes on the samples that were fitted. clipped: how many of `count` samples are clipped."""
    notes = [f"{clipped} of {count} samples are clipped and take no part in the fit"] if clipped else []
    for name, style in data.items():
        notes += thin_colours(style.encoded, name, monochrome=style.monochrome)
    return notes
