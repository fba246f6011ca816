"""From samples to a camera profile: the stages of the calibration in order."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.consistency import check_agreement, thin_colours, thin_settings
from lutforge.calibration.continuation import continuation
from lutforge.calibration.errors_table import ErrorFigures, error_figures
from lutforge.calibration.lattice import MEASURING_TOLERANCE, TOLERANCE, fit_samples, folds
from lutforge.calibration.lattice_result import LatticeResult, result
from lutforge.calibration.matrix_and_response import MatrixAndResponse, fit_matrix_and_response
from lutforge.calibration.monochrome import inverse_of_greys, is_monochrome
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.output_curve import output_curve
from lutforge.calibration.physical import GamutMaps, fit_gamut_maps, fit_stages, linearize, render
from lutforge.calibration.plain_lattice import fit_plain
from lutforge.calibration.reference_camera import calibrate_by_reference
from lutforge.calibration.white_balance import complete_multipliers, named_white_balances
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile, PictureStyle
from lutforge.model.lattice import Lattice
from lutforge.samples.sample_set import SampleSet

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""Called with what is being done and the share that is done, 0 … 1."""

LEAST_SAMPLES = 10
FEW_SAMPLES = 500
CODE = 1.0 / 255.0


@dataclass(frozen=True, eq=False)
class StyleData:
    """The fitting samples of one style. balanced: Tw E (n, 3); encoded: I (n, 3); shot: (n,); samples: their rows.

    monochrome: the style is black and white.
    """

    balanced: Array
    encoded: Array
    shot: NDArray[np.str_]
    samples: SampleSet
    monochrome: bool = False

    def select(self, rows: NDArray[np.bool_]) -> "StyleData":
        """The rows of a mask."""
        return StyleData(
            self.balanced[rows], self.encoded[rows], self.shot[rows], self.samples.select(rows), self.monochrome
        )


@dataclass(frozen=True, eq=False)
class StyleFit:
    """base: the matrix and response that the lattices continue; render: Tw E → I; linearize: I → Tw E."""

    base: MatrixAndResponse
    render: LatticeResult
    linearize: LatticeResult


def _silent(what: str, share: float) -> None:
    pass


def calibrate(
    samples: SampleSet, options: CalibrationOptions | None = None, progress: Progress = _silent
) -> CameraProfile:
    """Fit a profile: white balances, matrix, and per style the model asked for, with held-out errors.

    "lattice": the lattices of both directions; "rbf": the physical model of chapter 4, and the lattices beside it.
    Samples with a reference camera's RAW get the physical model only (4.9). Raises CalibrationError, in one line with
    what to do, where the samples do not determine it.
    """
    options = options or CalibrationOptions()
    _check_one_camera(samples)
    if np.any(samples.raw_camera != samples.camera):
        return calibrate_by_reference(samples, options, progress)
    multipliers, notes = complete_multipliers(samples)
    enough, left_out = styles_with_enough(samples, multipliers)
    samples, multipliers, notes = samples.select(enough), multipliers[enough], (*notes, *left_out)
    matrix: Array | None = None
    physical: dict[str, GamutMaps] = {}
    if options.model == "rbf":
        progress("response, matrix and white balances", 0.0)
        matrix, multipliers, physical = _fit_physical(samples, multipliers, options)
    data, clipped = style_data(samples, multipliers)
    notes = (*notes, *thin_settings(samples))
    if clipped:
        notes = (*notes, f"{clipped} of {len(samples)} samples are clipped and take no part in the fit")
    styles, matrices = {}, {}
    for index, (name, style) in enumerate(data.items()):
        share = index / len(data)
        notes = (*notes, *thin_colours(style.encoded, name, monochrome=style.monochrome))
        notes = (*notes, *check_agreement(style.balanced, style.encoded, style.shot, name))
        progress(f"{name}: fitting", share)
        fit = fit_style(style, options)
        progress(f"{name}: held-out error", share + 0.5 / len(data))
        maps = physical.get(name)
        errors, weak = _held_out(style, fit, options, maps)
        notes = (*notes, *(f"{name}: {note}" for note in weak))
        styles[name] = PictureStyle(
            render=_render_with_plain(style, fit, options),
            linearize=fit.linearize.lattice,
            physical=() if maps is None else (maps.model,),
            errors=errors,
            coverage={"render": fit.render.coverage, "linearize": fit.linearize.coverage},
        )
        matrices[name] = (not style.monochrome, len(style.shot), fit.base.matrix)
    progress("done", 1.0)
    if matrix is None:
        matrix = max(matrices.values(), key=lambda entry: entry[:2])[2]
    matrix = matrix / matrix.sum(axis=1, keepdims=True)
    return CameraProfile(
        camera=str(samples.camera[0]),
        matrix=matrix,
        white_balances=named_white_balances(samples, multipliers, matrix),
        styles=styles,
        shots=tuple(name for name, _ in samples.by_shot()),
        options=options.as_json(),
        notes=notes,
    )


def _fit_physical(
    samples: SampleSet, multipliers: Array, options: CalibrationOptions
) -> tuple[Array, Array, dict[str, GamutMaps]]:
    """Ts, the multipliers (n, 3) of all samples, and by style the physical model, of all but black-and-white ones."""
    without = [name for name, style in style_data(samples, multipliers)[0].items() if style.monochrome]
    usable = unclipped(samples, multipliers) & ~np.isin(samples.style, without)
    if not usable.any():
        raise CalibrationError(
            f'style "{without[0]}" is black and white: its JPEGs hold no colour to fit the physical model to: '
            'use the "lattice" model, or add shots in another style'
        )
    inside, known = samples.select(usable), np.all(np.isfinite(samples.wb), axis=1)
    stages = fit_stages(inside, multipliers[usable], known[usable], options.preset)
    completed = multipliers.copy()
    completed[usable] = stages.multipliers
    automatic = np.where(samples.white_balance == "auto", np.char.add("auto\x00", samples.shot), samples.white_balance)
    for setting in np.unique(automatic[~known]):
        fitted = ~known & (automatic == setting) & usable
        if fitted.any():
            completed[~known & (automatic == setting)] = completed[fitted][0]
    balances = tuple(str(name) for name in np.unique(samples.white_balance))
    models = {}
    for name, style in stages.styles.items():
        rows = usable & (samples.style == name)
        models[name] = fit_gamut_maps(
            samples.raw[rows] * completed[rows],
            samples.srgb[rows],
            samples.shot[rows],
            stages.matrix,
            style.response,
            balances,
            preset=options.preset,
        )
    return stages.matrix, completed, models


def _check_one_camera(samples: SampleSet) -> None:
    if len(samples) < LEAST_SAMPLES:
        raise CalibrationError(
            f"{len(samples)} samples to calibrate from; at least {LEAST_SAMPLES} are needed: add shots"
        )
    cameras = np.unique(samples.camera)
    if len(cameras) > 1:
        raise CalibrationError(
            f"samples of {len(cameras)} cameras ({', '.join(cameras[:4])}): calibrate one camera at a time"
        )
    if len(np.unique(samples.raw_camera)) > 1:
        raise CalibrationError(
            f"the samples hold RAW of several cameras ({', '.join(np.unique(samples.raw_camera)[:4])}): "
            "use the camera's own, or one reference camera"
        )


def unclipped(samples: SampleSet, multipliers: Array) -> NDArray[np.bool_]:
    """(n,): no JPEG channel at 0 or 255, RAW neither saturated nor at black, nor beyond 1 after white balance."""
    usable: NDArray[np.bool_] = (
        np.all((samples.srgb >= 0.5 * CODE) & (samples.srgb <= 1 - 0.5 * CODE), axis=1)
        & np.all((samples.raw > 0.0) & (samples.raw < 0.999), axis=1)
        & np.all(samples.raw * multipliers < 1.0, axis=1)
    )
    return usable


def styles_with_enough(samples: SampleSet, multipliers: Array) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """(n,): samples of styles with enough unclipped ones to fit, and a note for each style that is left out.

    Raises CalibrationError where no style has enough.
    """
    usable = unclipped(samples, multipliers)
    counts = {str(name): int((usable & (samples.style == name)).sum()) for name in np.unique(samples.style)}
    few = {name: count for name, count in counts.items() if count < LEAST_SAMPLES}
    advice = "add shots with more colours, exposed so that neither the JPEG nor the RAW clips"
    notes = tuple(
        f'style "{name}": {count} unclipped samples; at least {LEAST_SAMPLES} are needed: {advice}'
        for name, count in few.items()
    )
    if len(few) == len(counts):
        raise CalibrationError(notes[0])
    return ~np.isin(samples.style, list(few)), tuple(f"left out: {note}" for note in notes)


def style_data(samples: SampleSet, multipliers: Array) -> tuple[dict[str, StyleData], int]:
    """The unclipped samples of each style that has enough, white-balanced, and how many are clipped."""
    enough, _ = styles_with_enough(samples, multipliers)
    balanced = samples.raw * multipliers
    usable = unclipped(samples, multipliers) & enough
    styles = {}
    for name in np.unique(samples.style[enough]):
        rows = usable & (samples.style == name)
        monochrome = is_monochrome(balanced[rows], samples.srgb[rows])
        styles[str(name)] = StyleData(
            balanced[rows], samples.srgb[rows], samples.shot[rows], samples.select(rows), monochrome
        )
    return styles, int((enough & ~usable).sum())


def data_by_style(samples: SampleSet) -> dict[str, StyleData]:
    """The fitting samples of each style of one camera with RAW of its own. Raises CalibrationError."""
    _check_one_camera(samples)
    if np.any(samples.raw_camera != samples.camera):
        raise CalibrationError(
            f"{samples.camera[0]} was sampled with another camera's RAW: its model has no lattice to choose a size of"
        )
    multipliers, _ = complete_multipliers(samples)
    return style_data(samples, multipliers)[0]


def fit_style(
    data: StyleData,
    options: CalibrationOptions,
    smoothness: tuple[float, float] | None = None,
    base: MatrixAndResponse | None = None,
    tolerance: float = TOLERANCE,
) -> StyleFit:
    """Both lattices of a style; smoothness: λ_S of (render, linearize), and base, where known already."""
    base = base or fit_matrix_and_response(data.balanced, data.encoded)
    chosen = smoothness or (None, None)
    render = fit_direction(data, options, base, inverse=False, smoothness=chosen[0], tolerance=tolerance)
    if data.monochrome:
        return StyleFit(base, render, _linearize_greys(data, options, render))
    linearize = fit_direction(data, options, base, inverse=True, smoothness=chosen[1], tolerance=tolerance)
    return StyleFit(base, render, linearize)


def fit_direction(
    data: StyleData,
    options: CalibrationOptions,
    base: MatrixAndResponse,
    *,
    inverse: bool,
    smoothness: float | None = None,
    tolerance: float = TOLERANCE,
) -> LatticeResult:
    """One lattice of a style: inverse is linearize, else render, with a response behind where the options have it.

    Of a black-and-white style linearize is the inverse of render's greys, with the smoothness of that.
    """
    if inverse and data.monochrome:
        render = fit_direction(data, options, base, inverse=False, smoothness=smoothness, tolerance=tolerance)
        return _linearize_greys(data, options, render)
    x, y = (data.encoded, data.balanced) if inverse else (data.balanced, data.encoded)
    curve = None if inverse else output_curve(base.response)
    guess = continuation(base, x, y, inverse=inverse, size=options.size, curve=curve)
    return fit_samples(
        x, y, data.shot, guess, options, clips=not inverse, curve=curve, smoothness=smoothness, tolerance=tolerance
    )


def _linearize_greys(data: StyleData, options: CalibrationOptions, render: LatticeResult) -> LatticeResult:
    """What linearizes a black-and-white style whose rendering is fitted."""
    return result(inverse_of_greys(render.lattice, options), data.encoded, data.balanced, render.smoothness)


def _render_with_plain(data: StyleData, fit: StyleFit, options: CalibrationOptions) -> Lattice:
    """The lattice that renders; where it has a response, with its form for files that can hold none."""
    if fit.render.lattice.response is None:
        return fit.render.lattice
    curved, smoothness = fit.render.lattice, fit.render.smoothness
    return replace(curved, plain=fit_plain(data.balanced, data.encoded, curved, options, smoothness).lattice)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Predictions of samples by fits that did not see their shot. rendered: I (n, 3); linearized: Tw E (n, 3)."""

    rendered: Array
    linearized: Array


def predict_held_out(
    data: StyleData, options: CalibrationOptions, smoothness: tuple[float, float] | None, most_folds: int
) -> HeldOut:
    """Refit without each shot (or each of `most_folds` groups of shots) and predict it. Needs two shots or more."""
    rendered, linearized = np.empty_like(data.encoded), np.empty_like(data.balanced)
    for mask in folds(data.shot, most_folds):
        fit = fit_style(data.select(~mask), options, smoothness, tolerance=MEASURING_TOLERANCE)
        rendered[mask] = np.clip(fit.render.lattice(data.balanced[mask]), 0.0, 1.0)
        linearized[mask] = np.clip(fit.linearize.lattice(data.encoded[mask]), 0.0, 1.0)
    return HeldOut(rendered, linearized)


def refit_physical(
    data: StyleData,
    options: CalibrationOptions,
    white_balances: tuple[str, ...],
    nuggets: tuple[float | None, float | None] = (None, None),
) -> GamutMaps:
    """The physical model of one style on other samples; nuggets: the smoothness of h and h⁻¹ where it was chosen."""
    known = np.ones(len(data.shot), dtype=np.bool_)
    stages = fit_stages(data.samples, data.balanced / data.samples.raw, known, options.preset)
    response = next(iter(stages.styles.values())).response
    return fit_gamut_maps(
        data.balanced, data.encoded, data.shot, stages.matrix, response, white_balances, nuggets, options.preset
    )


def predict_physical_held_out(
    data: StyleData, maps: GamutMaps, options: CalibrationOptions, most_folds: int
) -> HeldOut:
    """The same with the physical model. Raises CalibrationError where the rest of the shots does not determine it."""
    rendered, linearized = np.empty_like(data.encoded), np.empty_like(data.balanced)
    nuggets = (maps.nugget, maps.inverse_nugget)
    for mask in folds(data.shot, most_folds):
        model = refit_physical(data.select(~mask), options, maps.model.white_balances, nuggets).model
        rendered[mask] = render(model, data.balanced[mask])
        linearized[mask] = np.clip(linearize(model, data.encoded[mask]), 0.0, 1.0)
    return HeldOut(rendered, linearized)


def _held_out(
    data: StyleData, fit: StyleFit, options: CalibrationOptions, maps: GamutMaps | None
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Held-out figures of the model asked for by name, and what makes this style's calibration weak."""
    weak = []
    shots = np.unique(data.shot)
    if len(data.shot) < FEW_SAMPLES:
        weak.append(f"only {len(data.shot)} samples: colours between them are guessed from the matrix and response")
    if len(shots) < 2:
        weak.append("one shot only: no shot is left to measure the error on; add another of other colours")
        return {}, tuple(weak)
    if any((~mask).sum() < LEAST_SAMPLES for mask in folds(data.shot)):
        weak.append("too few samples to leave a shot out: the error is not known")
        return {}, tuple(weak)
    if maps is None:
        smoothness = (fit.render.smoothness, fit.linearize.smoothness)
        held = predict_held_out(data, options, smoothness, most_folds=5)
    else:
        try:
            held = predict_physical_held_out(data, maps, options, most_folds=5)
        except CalibrationError as error:
            weak.append(f"without one of its shots the rest does not suffice, so the error is not known ({error})")
            return {}, tuple(weak)
    return _figures(held, data), tuple(weak)


def _figures(held: HeldOut, data: StyleData) -> dict[str, float]:
    figures: dict[str, ErrorFigures] = {
        "render": error_figures(held.rendered, data.encoded, display=True),
    }
    if not data.monochrome:  # else the colour that its JPEGs do not hold would count
        figures["linearize"] = error_figures(held.linearized, data.balanced, display=False)
    errors = {}
    for direction, values in figures.items():
        errors[f"{direction}_mean"] = values.mean
        errors[f"{direction}_max"] = values.maximum
        if values.de00_mean is not None:
            errors[f"{direction}_de00_mean"] = values.de00_mean
    return errors
