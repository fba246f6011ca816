"""One picture style: the samples that it is fitted to, its camera model, and the lattices that the model is baked to.

The samples are unclipped, and balanced by the multipliers of their setting.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.gamut_map import fit_gamut_map
from lutforge.calibration.inverse_gamut_map import fit_inverse
from lutforge.calibration.lattice.fit import bake_linearize, bake_render
from lutforge.calibration.lattice.monochrome import inverse_of_greys, is_monochrome
from lutforge.calibration.matrix_and_response import (
    LEAST_SAMPLES,
    MatrixAndResponse,
    fit_matrix_and_response,
    with_matrix_of_all,
)
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.same_scene import is_one_scene
from lutforge.calibration.scenes import RenderedScenes, likely_scenes
from lutforge.colour.srgb import srgb_encode
from lutforge.errors import CalibrationError
from lutforge.model.lattice import Lattice
from lutforge.model.profile import ByDirection, CameraModel
from lutforge.model.response import smooth_response
from lutforge.samples.clipping import HALF_CODE, SATURATED, unclipped_colours
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.cross_validation import joined_alike, leave_groups_out
from lutforge.threads import each, one_blas_thread

REFIT_CENTRES = 2_500
"""The most centres of a model that is fitted again to a part of the samples."""


@dataclass(frozen=True, eq=False)
class StyleData:
    """The fitting samples of one style. balanced: Tw E (n, 3); encoded: I (n, 3); shot: (n,); samples: their rows.

    monochrome: the style is black and white. given: matrix and response that hold whatever the samples are; fitted:
    matrix and response as fitted to just these samples; None where they are still to be fitted. clipped: samples of the
    style with a JPEG channel at an end and RAW that is whole. options: how the camera model is fitted.
    """

    balanced: Array
    encoded: Array
    shot: NDArray[np.str_]
    samples: SampleSet
    monochrome: bool = False
    given: MatrixAndResponse | None = None
    fitted: MatrixAndResponse | None = None
    clipped: "ClippedColours | None" = None
    options: CalibrationOptions = field(default_factory=CalibrationOptions)

    @cached_property
    def base_of_unsaturated(self) -> MatrixAndResponse:
        """The matrix and response of the colours that a gamut map leaves alone. Raises CalibrationError.

        This is the camera's own matrix: the one that suits all colours takes up a part of the gamut map.
        """
        known = self.given or self.fitted
        if known is not None:
            return known
        beta, curves = self.options.beta, self.options.curves
        saturates = self.samples.is_own_raw
        return fit_matrix_and_response(self.balanced, self.encoded, beta, curves, saturates=saturates)

    @cached_property
    def base(self) -> MatrixAndResponse:
        """The matrix that suits all colours, and the response. Raises CalibrationError.

        A black-and-white style has no matrix of its own: the fitted one maps all colours to one brightness, after
        which no gamut map could distinguish them.
        """
        if self.given is not None:
            return self.given
        smooth = MatrixAndResponse(self.base_of_unsaturated.matrix, smooth_response(self.base_of_unsaturated.response))
        if self.monochrome:
            return replace(smooth, matrix=np.eye(3))
        return with_matrix_of_all(smooth, self.balanced, self.encoded)

    @cached_property
    def scenes(self) -> RenderedScenes:
        """Likely scenes with the codes that the camera model renders them to. Raises CalibrationError."""
        clipped = None if self.clipped is None else (self.clipped.balanced, self.clipped.encoded)
        gamut_map = fit_gamut_map(self.base, self.balanced, self.encoded, clipped, self.options.centres)
        likely = likely_scenes(self.balanced)
        linear = likely.balanced @ self.base.matrix.T
        mapped = gamut_map(linear)
        codes = self.base.response.encode(mapped)
        whole = unclipped_colours(codes, likely.balanced)
        return RenderedScenes(gamut_map, likely.balanced, likely.weight, linear, mapped, codes, whole)

    @cached_property
    def model(self) -> CameraModel:
        """The camera model of chapter 4, its gamut map by kriging, and its inverse solved. Raises CalibrationError."""
        balances = tuple(str(name) for name in np.unique(self.samples.white_balance))
        scenes, base = self.scenes, self.base
        inverse = fit_inverse(
            scenes.gamut_map, base.matrix, base.response, scenes.linear, scenes.mapped, scenes.weight, scenes.whole
        )
        return CameraModel(balances, base.matrix, base.response, scenes.gamut_map, inverse)

    @property
    def both(self) -> ByDirection[tuple[Array, Array]]:
        """The values that each direction takes and gives at the samples, each (n, 3)."""
        return ByDirection((self.balanced, self.encoded), (self.encoded, self.balanced))

    @cached_property
    def scene(self) -> NDArray[np.str_]:
        """The shot of each sample, (n,), with shots of one scene under one name: none of them tests a fit to another.

        These are copies, the shots of a burst, and shots that are exposed alike.
        """
        places = np.nan_to_num(self.samples.position)
        raw = srgb_encode(np.clip(self.samples.raw, 0.0, 1.0))
        _, balance = np.unique(self.samples.white_balance, return_inverse=True)  # a burst has one
        points = np.hstack([255 * self.encoded, 255 * raw, 100 * places, 255 * balance[:, None]])
        of_shot = {str(name): self.samples.select(self.shot == name) for name in np.unique(self.shot)}
        return joined_alike(self.shot, points, lambda a, b: is_one_scene(of_shot[a], of_shot[b]))

    @cached_property
    def folds(self) -> list[tuple[Mask, "StyleData"]]:
        """The samples that are left out in turn to measure errors on, masks (n,), and those that stay."""
        return [(mask, self.select(~mask)) for mask in leave_groups_out(self.scene)]

    def select(self, rows: Mask) -> "StyleData":
        """The rows of a mask, and the clipped samples of the shots that have any."""
        parts = (self.balanced[rows], self.encoded[rows], self.shot[rows], self.samples.select(rows))
        clipped = None if self.clipped is None else self.clipped.of_shots(self.shot[rows])
        options = replace(self.options, centres=min(self.options.centres, REFIT_CENTRES))
        return StyleData(*parts, self.monochrome, self.given, None, clipped, options)


@dataclass(frozen=True, eq=False)
class ClippedColours:
    """Samples whose JPEG shows only that a channel is at its end or beyond. balanced, encoded: (m, 3); shot: (m,)."""

    balanced: Array
    encoded: Array
    shot: NDArray[np.str_]

    def of_shots(self, shots: NDArray[np.str_]) -> "ClippedColours":
        """The samples of these shots."""
        rows = np.isin(self.shot, shots)
        return ClippedColours(self.balanced[rows], self.encoded[rows], self.shot[rows])


def unclipped(samples: SampleSet, multipliers: Array) -> Mask:
    """Return the mask (n,) of samples that are not clipped, nor after white balance by multipliers (n, 3)."""
    return np.asarray(unclipped_colours(samples.srgb, samples.raw) & np.all(samples.raw * multipliers < 1.0, axis=1))


def styles_with_enough(samples: SampleSet, multipliers: Array) -> tuple[Mask, tuple[str, ...]]:
    """Mask (n,) of samples whose style has enough to fit, and notes on others. Raises CalibrationError: no style."""
    usable = unclipped(samples, multipliers)
    colours = np.rint(samples.srgb * 255) @ [1 << 16, 1 << 8, 1]  # a colour that a table repeats counts once
    counts = {str(name): len(np.unique(colours[usable & (samples.style == name)])) for name in np.unique(samples.style)}
    too_small = {name: count for name, count in counts.items() if count < LEAST_SAMPLES}
    advice = "add shots with more colours, exposed so that neither the JPEG nor the RAW clips"
    notes = tuple(
        f'style "{name}": {count} unclipped samples of different colours; at least {LEAST_SAMPLES} are needed: {advice}'
        for name, count in too_small.items()
    )
    if len(too_small) == len(counts):
        raise CalibrationError(notes[0])
    return ~np.isin(samples.style, list(too_small)), tuple(f"left out: {note}" for note in notes)


def style_data(
    samples: SampleSet,
    multipliers: Array,
    options: CalibrationOptions | None = None,
    given_bases: Mapping[str, MatrixAndResponse] | None = None,
) -> tuple[dict[str, StyleData], int]:
    """The samples of each style with enough unclipped ones, and how many samples take no part in any.

    given_bases: matrix and response of styles, where they hold whatever the samples are.
    """
    options = options or CalibrationOptions()
    given_bases = given_bases or {}
    enough, _ = styles_with_enough(samples, multipliers)
    balanced = samples.raw * multipliers
    usable = unclipped(samples, multipliers) & enough

    # Clipped in the JPEG alone, and in whole channels: a value between the last code and the end is a mixture.
    is_whole_raw = np.all(((samples.raw > 0.0) & (samples.raw < SATURATED) & (balanced < 1.0)), axis=1)
    is_at_end = (samples.srgb <= 0.0) | (samples.srgb >= 1.0)
    is_inside = (samples.srgb >= HALF_CODE) & (samples.srgb <= 1.0 - HALF_CODE)
    is_clipped = enough & ~usable & is_whole_raw & np.all(is_at_end | is_inside, axis=1)

    styles = {}
    for name in np.unique(samples.style[enough]):
        rows = usable & (samples.style == name)
        clipped_rows = is_clipped & (samples.style == name)
        styles[str(name)] = StyleData(
            balanced[rows],
            samples.srgb[rows],
            samples.shot[rows],
            samples.select(rows),
            monochrome=is_monochrome(balanced[rows], samples.srgb[rows]),
            given=given_bases.get(str(name)),
            clipped=ClippedColours(balanced[clipped_rows], samples.srgb[clipped_rows], samples.shot[clipped_rows]),
            options=options,
        )
    return styles, int((enough & ~usable & ~is_clipped).sum())


@one_blas_thread
def fit_lattices(data: StyleData, options: CalibrationOptions) -> ByDirection[Lattice]:
    """The lattices of both directions of a style, baked from its camera model. Raises CalibrationError.

    A black-and-white style is linearized by the inverse of the greys of its rendering.
    """
    if data.monochrome:
        render = bake_render(data.model, data.scenes, options)
        return ByDirection(render, inverse_of_greys(render, options))
    bakes = (bake_render, bake_linearize)
    return ByDirection(*each(lambda bake: bake(data.model, data.scenes, options), bakes))
