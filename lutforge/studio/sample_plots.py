"""The plots of samples: which points each one shows, of one channel, and the curves through them (thesis A.3)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.colour.srgb import SRGB_TO_XYZ, srgb_decode
from lutforge.pipeline.evaluation import Predicted
from lutforge.reports.drawing import GREY
from lutforge.studio import ui
from lutforge.studio.workspace import Workspace

if TYPE_CHECKING:
    from lutforge.calibration.exposure_pairs import ExposurePairs

Rows = NDArray[np.intp]

BY_PAIR = "exposure pair"
BY_COLOUR = "own colour"
COLOURS = (BY_PAIR, BY_COLOUR)
"""The ways to colour points."""
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#5b5b5b", "#8c6d31")
"""Okabe and Ito's colours, told apart by colour-blind eyes, and three more."""
JPEG_COLOURS = "JPEG colours"
TRANSFORMED_RAW = "transformed RAW"
SPACES_OF = (JPEG_COLOURS, TRANSFORMED_RAW, "both")
"""The colours that are shown in CIE xy and XYZ."""

NO_PAIRS = "no two shots show the same patches at different exposures"
NO_MODEL_YET = "fit a model first: this plot shows values that it computes"
NO_VALUES = "no sample has these values"


@dataclass(frozen=True, eq=False)
class Points:
    """The points of a plot.

    x, y: (n,); row, partner: (n,) the samples that a point stands for, equal where it is one; pair: (n,) the number of
    the exposure pair, −1 for none; curves: (2, m) each; missing: why there are no points.
    """

    x: Array
    y: Array
    row: Rows
    partner: Rows
    pair: Rows
    x_label: str = ""
    y_label: str = ""
    curves: Sequence[Array] = ()
    missing: str = ""

    def __len__(self) -> int:
        return len(self.x)

    def select(self, keep: Mask) -> "Points":
        """The points of a mask (n,)."""
        return replace(self, **{name: getattr(self, name)[keep] for name in ("x", "y", "row", "partner", "pair")})


IDENTITY = (np.array([[0.0, 1.0], [0.0, 1.0]]),)
"""The curve on which points lie whose x and y are equal."""


def points(workspace: Workspace, plot: str, channel: int) -> Points:
    """The points of one plot, a key of `PLOTS`, and one channel, as far as they are known."""
    shown = PLOTS[plot].points(workspace, channel)
    if shown.missing:
        return shown
    known = np.isfinite(shown.x) & np.isfinite(shown.y)
    return replace(shown.select(known), missing="" if known.any() else NO_VALUES)


def srgb_btf(workspace: Workspace, channel: int) -> Points:
    """JPEG values of exposure pairs, with the brightness transfer functions of their ratios."""
    pairs = workspace.response_pairs
    if pairs is None:
        return _no_points(NO_PAIRS)
    curves = brightness_transfers(workspace, pairs.log_ratio, channel)
    labels = ("sRGB, shorter exposure", "sRGB, longer exposure")
    return _points_of_pairs(pairs, pairs.first[:, channel], pairs.second[:, channel], labels, curves)


def raw_btf(workspace: Workspace, channel: int) -> Points:
    """RAW values of exposure pairs."""
    pairs = workspace.response_pairs
    if pairs is None:
        return _no_points(NO_PAIRS)
    labels = ("RAW, shorter exposure", "RAW, longer exposure")
    return _points_of_pairs(pairs, pairs.raw_first[:, channel], pairs.raw_second[:, channel], labels)


def srgb_against_raw(workspace: Workspace, channel: int) -> Points:
    """JPEG values against RAW values."""
    samples = workspace.samples
    return _points_of_samples(
        workspace, samples.raw[:, channel], samples.srgb[:, channel], ("RAW, before white balance", "sRGB")
    )


def saturation_against_brightness(workspace: Workspace, channel: int) -> Points:
    """The saturation of JPEG colours against their largest channel; the same for each channel."""
    largest = workspace.samples.srgb.max(axis=1)
    saturation = workspace.columns["saturation"]
    return _points_of_samples(workspace, largest, saturation, ("largest channel, sRGB", "saturation"))


def transformed_against_srgb(workspace: Workspace, channel: int) -> Points:
    """JPEG values against transformed RAW, with the response of the first style."""
    if workspace.fitted is None:
        return _no_points(NO_MODEL_YET)
    x = workspace.fitted.predicted.transformed[:, channel]
    even = np.linspace(0.0, 1.0, 257)
    first_style = next(iter(workspace.fitted.profile.styles.values()))
    curve = np.stack([even, first_style.tones(even)[:, channel]])
    labels = ("transformed RAW, before the response", "sRGB")
    return _points_of_samples(workspace, x, workspace.samples.srgb[:, channel], labels, [curve])


def rendering(workspace: Workspace, channel: int) -> Points:
    """JPEG values before the response against transformed RAW: what the gamut map does."""
    return _linear_values(workspace, channel, lambda predicted: (predicted.transformed, predicted.decoded))


def linearizing(workspace: Workspace, channel: int) -> Points:
    """Linearized JPEG values against transformed RAW: how well the inverse finds the scene."""
    return _linear_values(workspace, channel, lambda predicted: (predicted.scene, predicted.linearized))


def _linear_values(workspace: Workspace, channel: int, values: Callable[[Predicted], tuple[Array, Array]]) -> Points:
    """Linear values of JPEGs against those of transformed RAW.

    values: a function of the predictions that returns x and y of the plot, each (n, 3).
    """
    if workspace.fitted is None:
        return _no_points(NO_MODEL_YET)
    x, y = values(workspace.fitted.predicted)
    labels = ("transformed RAW", "linearized sRGB")
    return _points_of_samples(workspace, x[:, channel], y[:, channel], labels, IDENTITY)


def linearization(workspace: Workspace, channel: int) -> Points:
    """Linearized JPEG values of exposure pairs, the shorter times the ratio k of the exposures."""
    if workspace.fitted is None:
        return _no_points(NO_MODEL_YET)
    pairs = workspace.response_pairs
    if pairs is None:
        return _no_points(NO_PAIRS)
    linearized = workspace.fitted.predicted.linearized[:, channel]
    x = np.exp(pairs.log_ratio) * linearized[pairs.first_row]
    labels = ("k · linearized, shorter exposure", "linearized, longer exposure")
    return _points_of_pairs(pairs, x, linearized[pairs.second_row], labels, IDENTITY)


@dataclass(frozen=True)
class SamplePlot:
    """A plot of samples. points: of a workspace and a channel."""

    title: str
    points: Callable[[Workspace, int], Points]


PLOTS = {
    "srgb_btf": SamplePlot("sRGB BTF", srgb_btf),
    "raw_btf": SamplePlot("RAW BTF", raw_btf),
    "srgb_raw": SamplePlot("sRGB against RAW", srgb_against_raw),
    "saturation": SamplePlot("Saturation against brightness", saturation_against_brightness),
    "transformed": SamplePlot("Transformed RAW against sRGB", transformed_against_srgb),
    "rendering": SamplePlot("RAW → sRGB: transformed RAW against linearized sRGB", rendering),
    "linearizing": SamplePlot("sRGB → RAW: transformed RAW against linearized sRGB", linearizing),
    "linearization": SamplePlot("Linearization", linearization),
}
"""The plots in the order in which they are offered."""


def _no_points(missing: str) -> Points:
    nothing = np.zeros(0, dtype=np.intp)
    return Points(np.zeros(0), np.zeros(0), nothing, nothing, nothing, missing=missing)


def _points_of_samples(
    workspace: Workspace, x: Array, y: Array, labels: tuple[str, str], curves: Sequence[Array] = ()
) -> Points:
    """A point for each sample, with the number of the exposure pair that it belongs to."""
    row = np.arange(len(workspace.samples))
    pair = np.full(len(row), -1, dtype=np.intp)
    if workspace.pairs is not None:
        pair[workspace.pairs.second_row] = pair[workspace.pairs.first_row] = workspace.pairs.shot_pair
    return Points(x, y, row, row, pair, *labels, curves)


def _points_of_pairs(
    pairs: "ExposurePairs", x: Array, y: Array, labels: tuple[str, str], curves: Sequence[Array] = ()
) -> Points:
    """A point for each two samples of one surface."""
    return Points(x, y, pairs.first_row, pairs.second_row, pairs.shot_pair, *labels, curves)


def brightness_transfers(workspace: Workspace, log_ratio: Array, channel: int) -> list[Array]:
    """(2, 256) each: f(k f⁻¹(I)) over I, the brightness transfer functions of the ratios k of exposure pairs."""
    response = workspace.response
    if response is None:
        return []
    encoded = np.linspace(0.0, 1.0, 256)
    linear = response.linearize(np.repeat(encoded[:, None], 3, axis=1))
    # Times are read off to a hundredth of a stop: what differs by less is one ratio.
    ratios = np.unique(np.rint(100 * log_ratio / np.log(2))).tolist()
    return [np.stack([encoded, response.encode(2.0 ** (ratio / 100) * linear)[:, channel]]) for ratio in ratios]


def colours_in_space(workspace: Workspace, shown: str) -> tuple[Array, Rows]:
    """Linear sRGB (n, 3) of the JPEG, of the transformed RAW, or of both, and the samples that they are of.

    shown: one of SPACES_OF.
    """
    parts = [] if shown == TRANSFORMED_RAW else [srgb_decode(np.clip(workspace.samples.srgb, 0.0, 1.0))]
    if shown != JPEG_COLOURS and workspace.fitted is not None:
        parts.append(workspace.fitted.predicted.scene)
    linear = np.concatenate([*parts, np.zeros((0, 3))])
    known = np.isfinite(linear).all(axis=1)
    return linear[known], np.tile(np.arange(len(workspace.samples)), len(parts))[known]


def tristimulus(linear: Array) -> Array:
    """CIE X, Z, Y (…, 3) of linear sRGB, Y of white 1, in the order of axes of which the last is up."""
    return np.asarray((linear @ SRGB_TO_XYZ.T)[..., [0, 2, 1]])


def colours(workspace: Workspace, all_points: Points, chosen: Rows, by: str) -> list[str]:
    """A colour "#rrggbb" of each chosen point. by: one of COLOURS."""
    row = all_points.row[chosen]
    pair = all_points.pair
    if by == BY_COLOUR:
        return ui.hex_colours(workspace.samples.srgb[row])
    number = np.where(pair < 0, -1, np.searchsorted(np.unique(pair[pair >= 0]), pair))[chosen]
    return [PALETTE[index % len(PALETTE)] if index >= 0 else GREY for index in number.tolist()]
