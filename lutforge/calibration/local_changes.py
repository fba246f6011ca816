"""Local changes: shots whose RAW and JPEG differ by place rather than by colour.

A graduated filter, a dodged face and local tone mapping change a JPEG in a part of the picture, and light that falls
off from side to side may be in the RAW alone. A fixed rendering takes each scene colour to one JPEG colour I, so that
y = log₂ Σ Tw E = λ(I) + φ(place) + ε, where λ is the same smooth function of colour for all shots of a style
(`partially_linear_model`), and φ is a Gaussian process over the places of one shot, spanned by its values at a grid.

A shot was changed in a part of the picture if φ differs by more than `LEAST_STOPS` between its places, and if φ
explains the shot far better than a change of tone and saturation does, which is the same at all places. Both are
compared by generalized cross-validation (Golub, Heath & Wahba 1979, https://doi.org/10.1080/00401706.1979.10489751),
so that the one with more coefficients is not preferred. λ and φ of all shots are fitted together; φ is eliminated shot
by shot.

Where more than a third of the shots were changed, all of them may have one field: a quadratic polynomial of the place
is fitted to all, and taken from the RAW if at most a third of the shots are still changed without it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from lutforge.arrays import Array, Mask
from lutforge.calibration.deviations import listed
from lutforge.calibration.partially_linear_model import (
    RESIDUAL_WEIGHTS,
    SAMPLE_NOISE,
    PartiallyLinearModel,
    StyleFunction,
    partially_linear_model,
)
from lutforge.calibration.shot_comparison import ADVICE
from lutforge.calibration.uneven_light import field_terms, parts_of_field
from lutforge.model.profile import Diagnosis
from lutforge.samples.sample_set import SampleSet, Text
from lutforge.threads import one_blas_thread

LEAST_STOPS = 0.15
"""Least difference between places of a shot, in stops: a tenth of the light, which moves a bright colour by six codes.
Of sound shots it is at most 0.12."""
FAR_BETTER = 0.7
"""Share of the error of a change of tone and saturation that is left with one of place, at most: half the variance."""
LEAST_SAMPLES_OF_SHOT = 20
"""Shots with fewer samples are not judged."""
GRID = np.stack(np.meshgrid(np.linspace(-0.9, 0.9, 7), np.linspace(-0.6, 0.6, 5)), axis=-1).reshape(-1, 2)
"""Places that span φ, over the picture."""
REACH = 0.35
"""Standard deviation of the Gaussian covariance of φ, where half the diagonal of the picture is 1."""
FIELD_NUGGET = 1e-4
"""This is added to the variances of φ at the grid."""
COLOUR_SPREAD = 3.0
"""Standard deviation of the coefficients of a change of tone and saturation, in stops."""
TONE_POWERS, TONED_RESIDUAL = 6, 2 / 255
"""A shot shows no hues if its red and blue are polynomials of green with so many terms, but for so much."""
ROUNDS = 8
"""Rounds of reweighting."""
EXTREME_PLACES = (5, 95)
"""Percentiles of φ over the samples of a shot, whose difference is what it is changed by."""

LOCAL_CHANGES = "RAW and JPEG differ by place, not by colour"
"""The cause where shots were changed in a part of the picture, and it is not known that the others are right."""
ADVICE_ON_PLACES = (
    "use the camera's JPEG without graduated filters, local adjustments or D-Lighting, and photograph in even light"
)


@dataclass(frozen=True)
class LocalChange:
    """A shot whose JPEG is brighter in one part than in another, compared with its RAW, by so many stops."""

    shot: str
    stops: float
    brightest: str
    darkest: str

    @property
    def words(self) -> str:
        """The change in words."""
        return (
            f"changed in a part of the picture: compared with the RAW, its JPEG is brighter at {_the(self.brightest)} "
            f"than at {_the(self.darkest)}, by {self.stops:.1f} EV ({1.0 - 2.0**-self.stops:.0%} of the light)"
        )


@dataclass(frozen=True, eq=False)
class LocalChanges:
    """What is found: the shots that were changed locally, of so many judged, and the field of nearly all shots.

    field: (5,) the coefficients of its polynomial in stops, by which RAW is brighter; None where there is none.
    half_size: the largest coordinates of the places that it was fitted to.
    """

    changes: tuple[LocalChange, ...] = ()
    judged: int = 0
    field: Array | None = None
    half_size: tuple[float, float] = (1.0, 1.0)

    @property
    def are_few(self) -> bool:
        """True where a third of the shots were changed or fewer, so that the others are known to be right."""
        return 3 * len(self.changes) <= self.judged

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on the field, and on the few shots that are left out."""
        notes = []
        if self.field is not None:
            fall, bright, dark = parts_of_field(self.field, self.half_size)
            notes.append(
                f"in the RAW, light falls by {fall:.0%} from {bright} to {dark} compared with the JPEG, in nearly all "
                "shots: corrected as a smooth field; even light is surer"
            )
        if self.changes and self.are_few:
            shots = ", ".join(f"{change.shot} ({change.words})" for change in self.changes)
            notes.append(f"shots deviate from what the others agree on and are left out, {shots}: {ADVICE}")
        return tuple(notes)

    @property
    def diagnosis(self) -> Diagnosis:
        """The changes as a cause that spoils the whole set."""
        first = max(self.changes, key=lambda change: change.stops)
        shots = listed([change.shot for change in self.changes])
        evidence = f"{len(self.changes)} of {self.judged} shots ({shots}); {first.shot} is {first.words}"
        return Diagnosis(LOCAL_CHANGES, evidence, ADVICE_ON_PLACES)


@one_blas_thread
def find_local_changes(samples: SampleSet, multipliers: Array, usable: Mask) -> LocalChanges:
    """Find the shots that were changed in a part of the picture, and the field that nearly all shots show.

    multipliers: (n, 3), what makes RAW white-balanced; usable: (n,) unclipped samples. Samples without a place are not
    judged, nor are black-and-white and toned shots, whose JPEG colour does not determine the brightness of RAW.
    """
    located = np.asarray(usable & np.all(np.isfinite(samples.position), axis=1))
    for name in np.unique(samples.shot[located]):
        of_shot = located & (samples.shot == name)
        if not _shows_hues(samples.srgb[of_shot]):
            located &= ~of_shot
    model = partially_linear_model(samples, multipliers, located)
    if model is None:
        return LocalChanges()

    changes, judged = _changes_of_shots(model, model.y)
    if 3 * len(changes) <= judged:
        return LocalChanges(changes, judged)

    field = _common_field(model)
    others, _ = _changes_of_shots(model, model.y - field_terms(model.samples.position) @ field)
    if 3 * len(others) <= judged:
        x, y = np.abs(model.samples.position).max(axis=0).tolist()
        return LocalChanges(others, judged, field, (x, y))
    return LocalChanges(changes, judged)


def without_field(samples: SampleSet, field: Array) -> SampleSet:
    """The samples with a field (5,) taken from the RAW; that of the middle of the picture stays as it is."""
    stops = np.nan_to_num(field_terms(samples.position) @ field)
    return replace(samples, raw=samples.raw * 2.0 ** -stops[:, None])


def _the(part: str) -> str:
    """The name of a part of a picture, with its article."""
    return part if part.startswith("the ") else f"the {part}"


def _changes_of_shots(model: PartiallyLinearModel, y: Array) -> tuple[tuple[LocalChange, ...], int]:
    """The shots that were changed locally, by brightness y (n,), and how many were judged."""
    changes = list[LocalChange]()
    judged = 0
    for function in model.functions:
        rows = function.of_style
        shots, places = model.samples.shot[rows], model.samples.position[rows]
        by_place = _fit_by_shot(function, y[rows], model.precision[rows], shots, _place_basis(places), _PLACE_PENALTY)
        colours = _colour_basis(model.samples.srgb[rows])
        by_colour = _fit_by_shot(function, y[rows], model.precision[rows], shots, colours, _COLOUR_PENALTY)
        for name, field in by_place.items():
            if field.count < LEAST_SAMPLES_OF_SHOT:
                continue
            judged += 1
            lowest, highest = np.percentile(field.values, EXTREME_PLACES)
            stops = float(highest - lowest)
            if stops > LEAST_STOPS and field.error < FAR_BETTER * by_colour[name].error:
                changes.append(LocalChange(name, stops, *_brightest_and_darkest(places[shots == name], field.values)))
    return tuple(changes), judged


@dataclass(frozen=True, eq=False)
class _ShotFit:
    """A change of one shot. values: (m,) at its samples, in stops; error: of its samples, cross-validated, in stops."""

    values: Array
    error: float

    @property
    def count(self) -> int:
        """The number of the shot's samples."""
        return len(self.values)


def _fit_by_shot(
    function: StyleFunction, y: Array, precision: Array, shots: Text, basis: Array, penalty: Array
) -> Mapping[str, _ShotFit]:
    """Fit λ of a style together with a change of each shot, robustly; return the changes by shot.

    y, precision: (n,); shots: (n,) names; basis: (n, k) and penalty: (k, k), of the change of a shot.
    """
    design = function.design
    rows_of_shot = {str(name): np.flatnonzero(shots == name) for name in np.unique(shots)}
    weight = precision
    fits: dict[str, _ShotFit] = {}
    for _ in range(ROUNDS):
        weighted = design * weight[:, None]
        normal = weighted.T @ design + function.penalty
        right = weighted.T @ y

        # The coefficients of each shot's change are eliminated from the equations of λ.
        factors = {}
        for name, rows in rows_of_shot.items():
            weighted_basis = basis[rows] * weight[rows, None]
            own = weighted_basis.T @ basis[rows]
            factor = cho_factor(own + penalty)
            cross, value = weighted_basis.T @ design[rows], weighted_basis.T @ y[rows]
            normal -= cross.T @ cho_solve(factor, cross)
            right -= cross.T @ cho_solve(factor, value)
            factors[name] = factor, cross, value, float(np.trace(cho_solve(factor, own)))
        of_function = np.linalg.solve(normal, right)

        residual = y - design @ of_function
        for name, (factor, cross, value, freedom) in factors.items():
            rows = rows_of_shot[name]
            change = basis[rows] @ cho_solve(factor, value - cross @ of_function)
            residual[rows] -= change
            mean = float(np.average(np.abs(residual[rows]), weights=precision[rows]))
            fits[name] = _ShotFit(change, mean / max(1.0 - freedom / len(rows), FIELD_NUGGET))
        weight = np.asarray(precision * RESIDUAL_WEIGHTS(np.abs(residual)))
    return fits


def _common_field(model: PartiallyLinearModel) -> Array:
    """The coefficients (5,) of a field that all shots share, in stops."""
    columns = np.column_stack([field_terms(model.samples.position), model.y])
    prior = SAMPLE_NOISE**2 * np.eye(columns.shape[1] - 1)
    projection = model.by_noise
    for _ in range(ROUNDS):
        residual = projection.residual(columns)
        terms, values = residual[:, :-1], residual[:, -1]
        weighted = terms * projection.weight[:, None]
        field = np.linalg.solve(weighted.T @ terms + prior, weighted.T @ values)
        projection = model.reweighted(values - terms @ field)
    return np.asarray(field)


def _place_basis(places: Array) -> Array:
    """The covariance (n, g) of φ at places (n, 2) with that at the grid."""
    squared = np.sum((places[:, None] - GRID) ** 2, axis=2)
    return np.asarray(np.exp(-squared / (2.0 * REACH**2)))


def _colour_basis(encoded: Array) -> Array:
    """What changes of tone and saturation do to the brightness of JPEG colours (n, 3), (n, 9)."""
    tone = encoded.mean(axis=1)
    chroma = encoded[:, [0, 2]] - tone[:, None]
    strength = np.linalg.norm(encoded - tone[:, None], axis=1)
    return np.column_stack([np.vander(tone, 4), chroma, chroma * tone[:, None], strength])


_PLACE_PENALTY = SAMPLE_NOISE**2 * (_place_basis(GRID) + FIELD_NUGGET * np.eye(len(GRID)))
_COLOUR_PENALTY = (SAMPLE_NOISE / COLOUR_SPREAD) ** 2 * np.eye(9)


def _shows_hues(encoded: Array) -> bool:
    """True where green does not determine the other channels of JPEG colours (n, 3)."""
    if len(encoded) < LEAST_SAMPLES_OF_SHOT:
        return True
    powers = np.vander(encoded[:, 1], TONE_POWERS)
    others = encoded[:, [0, 2]]
    residual = others - powers @ np.linalg.lstsq(powers, others, rcond=None)[0]
    return bool(residual.std(axis=0).max() > TONED_RESIDUAL)


def _brightest_and_darkest(places: Array, raw_stops: Array) -> tuple[str, str]:
    """The parts of a picture where the JPEG is brightest, and where it is darkest, compared with the RAW.

    places: (m, 2), as the sensor lies; raw_stops: (m,) by how much RAW is brighter than the JPEG implies.
    """
    columns = np.column_stack([field_terms(places), np.ones(len(places))])
    of_jpeg = np.asarray(-np.linalg.lstsq(columns, raw_stops, rcond=None)[0][:-1], dtype=np.float64)
    x, y = np.percentile(np.abs(places), 90, axis=0).tolist()
    _, bright, dark = parts_of_field(of_jpeg, (x, y))
    return bright, dark
